"""``dlo topology`` and ``dlo disentangle`` against a mocked network: what they send, what they
print."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from dlo_client.commands import harness_commands  # noqa: F401  it registers the commands
from dlo_client.commands.app import app
from dlo_client.contracts import AnyJob, JobState
from dlo_client.outcomes import result_of
from typer.testing import CliRunner, Result

from tests.clients import harness_samples, samples
from tests.clients.replies import ok


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "harness.png"
    path.write_bytes(b"picture")
    return path


def run(answer: AnyJob, sent: list[bytes], *arguments: object) -> Result:
    def network(request: httpx.Request) -> httpx.Response:
        sent.append(request.content)
        made: Callable[[], httpx.Response] = ok(answer)
        return made()

    return CliRunner().invoke(app, [str(a) for a in arguments], obj=httpx.MockTransport(network))


def rows(done: Result) -> list[list[str]]:
    return [line.split() for line in done.stdout.splitlines() if line.strip()]


def test_disentangle_prints_the_actions_and_why_the_best_one(picture: Path) -> None:
    sent: list[bytes] = []
    done = run(
        harness_samples.job(),
        sent,
        "disentangle",
        picture,
        "--arm",
        "left:0,50",
        "--arm",
        "right:160,50",
    )
    assert done.exit_code == 0, done.output
    assert ["1", "1", "2", "29", "0", "0.80", "left", "left"] in rows(done)
    assert "best: the free end swings clear" in done.stdout
    assert b'"arms":[{"name":"left"' in sent[0]


def test_topology_prints_sections(picture: Path) -> None:
    answer = samples.job(JobState.SUCCEEDED, kind="topology", result=harness_samples.topology())
    done = run(answer, [], "topology", picture)
    assert done.exit_code == 0, done.output
    assert "3 sections, 1 branch-points, 1 crossings" in done.stdout
    assert ["1", "6.0", "80", "branch", "-", "free"] in rows(done)


def test_a_place_of_an_arm_that_is_none_is_named(picture: Path) -> None:
    done = run(harness_samples.job(), [], "disentangle", picture, "--arm", "left:here")
    assert done.exit_code == 2
    assert "expected NAME:X,Y" in done.output


def test_the_answer_before_goes_along(picture: Path, tmp_path: Path) -> None:
    before = tmp_path / "harness.result.json"
    before.write_text(result_of(harness_samples.job()).model_dump_json())
    sent: list[bytes] = []
    done = run(harness_samples.job(), sent, "disentangle", picture, "--earlier", before)
    assert done.exit_code == 0, done.output
    assert b'"earlier":{"topology":{"width":160' in sent[0]
    assert b'"turn_rad":0.5' in sent[0]


@pytest.mark.parametrize(
    ("change", "named"), [({"actions": []}, "no action"), ({"kind": 1}, "kind")]
)
def test_an_answer_before_that_leads_nowhere_is_named(
    picture: Path, tmp_path: Path, change: dict[str, object], named: str
) -> None:
    before = tmp_path / "harness.result.json"
    result = json.loads(result_of(harness_samples.job()).model_dump_json())
    before.write_text(json.dumps(result | change))
    done = run(harness_samples.job(), [], "disentangle", picture, "--earlier", before)
    assert done.exit_code == 2
    assert named in done.output
