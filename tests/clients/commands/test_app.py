"""The ``dlo`` command against a mocked network: what it prints, what it saves, how it ends."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from dlo_client.commands import network_commands  # noqa: F401  it registers its commands
from dlo_client.commands.app import app
from dlo_client.contracts import InstancesResult, JobPage, JobState
from typer.testing import CliRunner, Result

from tests.clients import samples
from tests.clients.replies import Reply, Script, ok, refusal, reply

Dlo = Callable[..., Result]


@pytest.fixture
def dlo() -> Dlo:
    def run(network: Callable[[httpx.Request], httpx.Response], *arguments: object) -> Result:
        transport = httpx.MockTransport(network)
        return CliRunner().invoke(app, [str(argument) for argument in arguments], obj=transport)

    return run


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "desk [1].png"
    path.write_bytes(b"picture")
    return path


class Service:
    """Finds two cables in every picture whose bytes are not torn."""

    def __init__(self) -> None:
        self.requests: list[bytes] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if "/files/" in request.url.path:
            return httpx.Response(200, content=samples.OVERLAY)
        self.requests.append(request.content)
        if b"torn" in request.content:  # a multipart boundary is hexadecimal: "bad" may stand in it
            return _made(refusal(samples.refused(422, "invalid_image")))
        return _made(ok(samples.instances_job()))


def _made(answer: Reply) -> httpx.Response:
    assert callable(answer)
    return answer()


def _rows(done: Result) -> list[list[str]]:
    return [line.split() for line in done.stdout.splitlines() if line.strip()]


def test_instances_prints_what_was_found(dlo: Dlo, picture: Path) -> None:
    done = dlo(Service(), "instances", picture)
    assert done.exit_code == 0
    rows = _rows(done)
    assert f"{picture}: 160 x 120, 2 instances, 1 crossing" in done.stdout
    assert ["1", "0.95", "7.0", "149", "free,", "border"] in rows
    assert ["2", "0.95", "7.0", "100", "free,", "hidden"] in rows
    assert ["1", "80,", "60", "1", "at", "47%", "2", "at", "50%", "0.90"] in rows
    assert "ms: segment 31.5, instances 8.2 (paths 2.0), total 40.0" in done.stdout
    assert "saved" not in done.stdout


def test_results_are_saved_under_the_pictures_name(dlo: Dlo, picture: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    done = dlo(Service(), "instances", picture, "--out", out)
    assert (out / "desk [1].overlay.png").read_bytes() == samples.OVERLAY
    saved = (out / "desk [1].result.json").read_text()
    assert InstancesResult.model_validate_json(saved) == samples.two_cables()
    assert f"saved {out / 'desk [1].overlay.png'}" in done.stdout


def test_pictures_of_the_same_name_do_not_overwrite_one_another(
    dlo: Dlo, picture: Path, tmp_path: Path
) -> None:
    done = dlo(
        Service(),
        "instances",
        picture,
        picture.rename(tmp_path / "a.png"),
        "--out",
        tmp_path / "out",
    )
    assert done.exit_code == 1
    other = tmp_path / "b" / "a.png"
    other.parent.mkdir()
    other.write_bytes(b"picture")
    done = dlo(Service(), "instances", tmp_path / "a.png", other, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "a.result.json").exists()
    assert (tmp_path / "out" / "a-2.result.json").exists()


def test_options_reach_the_request(dlo: Dlo, picture: Path) -> None:
    service = Service()
    dlo(service, "instances", picture, "--threshold", "0.3", "--points", "50", "--method", "rt_dlo")
    sent = service.requests[0]
    for part in (
        b'"threshold":0.3',
        b'"points_per_instance":50',
        b'"method":"rt_dlo"',
        b'"files":[]',
    ):
        assert part in sent


def test_a_bad_picture_does_not_stop_the_next(dlo: Dlo, picture: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.png"
    bad.write_bytes(b"torn")
    missing = tmp_path / "missing.png"
    done = dlo(Service(), "instances", bad, missing, picture)
    assert done.exit_code == 1
    assert f"error: {bad}: Refused: it was refused" in done.stderr
    assert f"error: {missing}: No such file or directory" in done.stderr
    assert f"{picture}: 160 x 120" in done.stdout
    assert "Traceback" not in done.output


def test_without_a_service_it_stops_at_the_first_picture(dlo: Dlo, picture: Path) -> None:
    done = dlo(Script(httpx.ProxyError("no way out")), "instances", picture, picture)
    assert done.exit_code == 1
    assert done.stderr.count("error:") == 1
    assert "cannot reach http://127.0.0.1:8000/v1/jobs" in done.stderr


def test_a_bad_address_is_a_readable_problem(dlo: Dlo) -> None:
    done = dlo(Service(), "--url", "localhost:8000", "models")
    assert done.exit_code == 1
    assert (
        done.stderr == "error: 'localhost:8000' is not an address such as http://127.0.0.1:8000\n"
    )


def test_json_is_one_object_a_line(dlo: Dlo, picture: Path) -> None:
    done = dlo(Service(), "instances", picture, picture, "--json")
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert [record["image"] for record in records] == [str(picture), str(picture)]
    assert records[0]["job"]["result"]["instances"][0]["width_px"] == 7.0


@pytest.mark.parametrize(
    "option", [("--threshold", "1.5"), ("--points", "1"), ("--method", "magic")]
)
def test_a_bad_option_is_named(dlo: Dlo, picture: Path, option: tuple[str, str]) -> None:
    service = Service()
    done = dlo(service, "instances", picture, *option)
    assert done.exit_code == 2
    assert option[0] in done.stderr
    assert service.requests == []


def test_jobs_are_listed_up_to_the_limit(dlo: Dlo) -> None:
    queued = samples.job(
        JobState.QUEUED, label="a label that is far too long for a narrow terminal " * 3
    )
    script = Script(ok(JobPage(jobs=[queued, samples.job(), samples.job()], next_cursor="more")))
    done = dlo(script, "jobs", "--limit", 2, "--state", "queued", "--kind", "noop")
    assert done.exit_code == 0
    assert done.stdout.count(samples.JOB_ID) == 2
    assert (queued.label or "").strip() in done.stdout
    assert dict(script.requests[0].url.params) == {"limit": "2", "state": "queued", "kind": "noop"}


def test_models_are_listed(dlo: Dlo) -> None:
    done = dlo(Script(reply(text=f"[{samples.network().model_dump_json()}]")), "models")
    assert _rows(done)[-1] == [
        "foreground_compact",
        "1",
        "foreground",
        "yes",
        "yes",
        "31.0",
        "a" * 12,
        "the",
        "release",
        "iou",
        "0.61",
    ]


def test_cancel_says_what_became_of_the_job(dlo: Dlo) -> None:
    script = Script(ok(samples.job(JobState.CANCELLED)))
    done = dlo(script, "cancel", samples.JOB_ID)
    assert script.requests[0].method == "DELETE"
    assert _rows(done)[-1][:2] == [samples.JOB_ID, "cancelled"]


def test_an_unknown_job_is_a_readable_problem(dlo: Dlo) -> None:
    done = dlo(Script(refusal(samples.refused(404))), "cancel", "nope")
    assert done.exit_code == 1
    assert done.stderr == "error: Refused: it was refused\n"


def test_address_and_key_are_global_options(dlo: Dlo) -> None:
    script = Script(reply(text="[]"))
    dlo(script, "--url", "http://cell:9", "--key", "secret", "models")
    assert str(script.requests[0].url) == "http://cell:9/v1/models"
    assert script.requests[0].headers["Authorization"] == "Bearer secret"


def test_the_version_is_printed(dlo: Dlo) -> None:
    done = dlo(Service(), "--version")
    assert done.exit_code == 0
    assert done.stdout.startswith("dlo ")


def test_the_help_explains_the_exit_codes(dlo: Dlo) -> None:
    assert "Exit code" in dlo(Service(), "--help").stdout
