"""``dlo models …`` and ``dlo adapt``: what they send, print and how they end."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import httpx
import pytest
from dlo_client.commands import adapt_commands, network_commands  # noqa: F401  they register their commands
from dlo_client.commands.app import app
from dlo_client.contracts import AdaptResult, Job, JobState, NetworkInfo
from dlo_client.contracts.adaptation import AsidePicture, Overlap, Retained
from dlo_client.contracts.networks import NetworkVersion
from typer.testing import CliRunner, Result

from tests.clients import samples
from tests.clients.labelling.test_adaptation import folder, source  # noqa: F401  fixtures
from tests.clients.replies import event

Dlo = Callable[..., Result]
CELL = samples.network().model_copy(
    update={
        "name": "cell7",
        "version": "2",
        "shipped": False,
        "parent": "foreground_compact@1",
        "versions": [
            NetworkVersion(
                version=k,
                sha256=samples.SHA,
                created_at=datetime(2026, 11, 28, tzinfo=UTC),
                origin="adapted",
                metrics={"dice_after": 80.0 + k},
            )
            for k in (1, 2)
        ],
    }
)


class Service:
    """Answers as the routes for networks and labels do, and remembers what was asked."""

    def __init__(self, result: AdaptResult | None = None) -> None:
        self.asked: list[tuple[str, str, bytes]] = []
        self.result = result

    def __call__(self, request: httpx.Request) -> httpx.Response:
        path = request.url.path
        self.asked.append(
            (
                request.method,
                path + (f"?{request.url.query.decode()}" if request.url.query else ""),
                request.content,
            )
        )
        if path.endswith("/file"):
            return httpx.Response(200, content=b"network")
        if path == "/v1/labels":
            return httpx.Response(201, json={"id": samples.SHA, "bytes": 9, "pictures": 5})
        if path.endswith("/events"):
            return httpx.Response(200, text=event(1) + event(2, JobState.SUCCEEDED, 1.0))
        if path.startswith("/v1/jobs"):
            state = JobState.QUEUED if request.method == "POST" else JobState.SUCCEEDED
            job = samples.job(state, kind="adapt", priority="training", result=self.result)
            return httpx.Response(
                200, text=Job[AdaptResult].model_validate(job.model_dump()).model_dump_json()
            )
        if request.method == "DELETE":
            return httpx.Response(204)
        return httpx.Response(200, text=CELL.model_dump_json())


@pytest.fixture
def dlo() -> Dlo:
    def run(network: Callable[[httpx.Request], httpx.Response], *arguments: object) -> Result:
        return CliRunner().invoke(
            app, [str(a) for a in arguments], obj=httpx.MockTransport(network)
        )

    return run


def result(*, accepted: bool = True, in_service: bool = False) -> AdaptResult:
    return AdaptResult(
        accepted=accepted,
        refused=None if accepted else "Dice on the pictures kept aside falls from 70.0 to 60.0",
        model="cell7" if accepted else None,
        version=2 if accepted else None,
        in_service=in_service,
        before=Overlap(dice=70),
        after=Overlap(dice=82),
        general=Retained(before=85, after=84.8),
        trained_on=4,
        kept_aside=[AsidePicture(name="a.jpg", before=70, after=82)],
        kept_share=0.5,
        minutes=4,
        models=[],
    )


def test_a_network_is_shown_with_its_versions(dlo: Dlo) -> None:
    done = dlo(Service(), "models", "show", "cell7")
    assert done.exit_code == 0
    assert "foreground_compact@1" in done.stdout
    rows = [line for line in done.stdout.splitlines() if "2026-11-28" in line]
    assert [("in service" in row) for row in rows] == [False, True]


@pytest.mark.parametrize(
    ("words", "asked"),
    [
        (("use", "cell7", 1), ("PUT", "/v1/models/cell7")),
        (("delete", "cell7", "--version", 1), ("DELETE", "/v1/models/cell7?version=1")),
        (("delete", "cell7"), ("DELETE", "/v1/models/cell7")),
    ],
)
def test_versions_are_chosen_and_deleted(dlo: Dlo, words: tuple, asked: tuple[str, str]) -> None:
    service = Service()
    assert dlo(service, "models", *words).exit_code == 0
    assert service.asked[0][:2] == asked
    assert words[0] == "delete" or json.loads(service.asked[0][2]) == {"version": 1}


def test_a_network_leaves_and_comes_as_one_file(dlo: Dlo, tmp_path: Path) -> None:
    service = Service()
    file = tmp_path / "cell7.dlonet"
    assert dlo(service, "models", "export", "cell7", file, "--version", 2).exit_code == 0
    assert file.read_bytes() == b"network"
    assert dlo(service, "models", "import", file, "--name", "copy").exit_code == 0
    assert [(m, p) for m, p, _ in service.asked] == [
        ("GET", "/v1/models/cell7/file?version=2"),
        ("POST", "/v1/models?name=copy"),
    ]
    assert service.asked[1][2] == b"network"


def test_labels_become_a_network(dlo: Dlo, folder: Path) -> None:  # noqa: F811
    service = Service(result())
    done = dlo(service, "adapt", folder, "--name", "cell7", "--minutes", 3)
    assert done.exit_code == 0, done.output
    sent = json.loads(
        next(body for method, path, body in service.asked if (method, path) == ("POST", "/v1/jobs"))
    )
    assert {k: sent[k] for k in ("kind", "name", "minutes", "use", "labels")} == {
        "kind": "adapt",
        "name": "cell7",
        "minutes": 3.0,
        "use": False,
        "labels": {"id": samples.SHA},
    }
    assert "5 labelled pictures" in done.stdout
    assert "70.0 before, 82.0 after" in done.stdout
    assert "put it into service with: dlo models use cell7 2" in done.stdout


def test_a_network_that_is_not_accepted_ends_with_its_reason(dlo: Dlo, folder: Path) -> None:  # noqa: F811
    done = dlo(Service(result(accepted=False)), "adapt", folder, "--name", "cell7")
    assert done.exit_code == 1
    assert "not accepted: Dice on the pictures kept aside falls" in done.stdout


def test_a_file_of_a_tool_needs_its_pictures(dlo: Dlo, tmp_path: Path) -> None:
    done = dlo(Service(), "adapt", tmp_path / "x.json", "--name", "cell7", "--format", "coco")
    assert done.exit_code == 1
    assert "--format needs --pictures" in done.stderr


def test_the_details_of_a_network_are_read(dlo: Dlo) -> None:
    assert NetworkInfo.model_validate_json(CELL.model_dump_json()).versions[1].metrics == {
        "dice_after": 82.0
    }
