"""Every script of examples/ runs against one real service, and every notebook's cells do."""

from __future__ import annotations

import io
import json
import os
import runpy
import shutil
from pathlib import Path

import nbformat
import pytest

from tests.processes import ONE_CHILD, running_service

pytestmark = pytest.mark.system
EXAMPLES = Path(__file__).parents[2] / "examples"
SAMPLES = Path(__file__).parents[1] / "samples"
SECRET = "a secret of the examples"


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    webhooks = {
        "DLO_WEBHOOK_HOSTS": "127.0.0.1",
        "DLO_WEBHOOK_SECRET": SECRET,
    } | ONE_CHILD
    with running_service(tmp_path_factory.mktemp("data"), workers=1, more=webhooks) as address:
        yield address


@pytest.fixture
def run(address):
    """``run(name, …)``: what the script's ``main`` gives."""
    return lambda name, *arguments: runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](
        ["--url", address, *map(str, arguments)]
    )


def test_camera_loop(run):
    assert min(run("camera_loop", "--frames", 2)) >= 4


def test_watch_folder(run, tmp_path):
    shutil.copy(SAMPLES / "plain.jpg", tmp_path / "a.jpg")
    (tmp_path / "b.png").write_bytes(b"none")
    for file in tmp_path.iterdir():
        os.utime(file, (1e9, 1e9))
    assert run("watch_folder", tmp_path, "--once") == 1
    assert run("watch_folder", tmp_path, "--once") == 0
    assert len(json.loads((tmp_path / "a.json").read_text())["instances"]) >= 4
    assert (tmp_path / "a.overlay.png").exists()
    assert "problem" in json.loads((tmp_path / "b.json").read_text())


def test_tracking(run):
    first, *others = run("tracking", "--frames", 2)
    assert len(set(first) & set(others[-1])) >= 4


def test_shape_control(run):
    errors = run("shape_control", "--actions", 3)
    assert errors[-1] < 0.8 * errors[0]


def test_harness_with_drawing(run):
    match = run("harness_with_drawing").match
    assert match.branches
    assert "W-absent" in match.missing


def test_disentangling(run):
    counts = run("disentangling", "--actions", 2)
    assert counts[0] >= 1
    assert counts[-1] < counts[0]


def test_scan(run):
    assert run("scan", "--sections", 1).curve.length_m > 0.2


def test_recipe_from_plc(run):
    heartbeat, accepted, result, pose, cancelled = run("recipe_from_plc")
    assert (heartbeat, accepted, cancelled) == ("H,1,0,0,0,0,0", "T,1,1", "X,1,0")
    status, poses = map(int, result.split(",")[2:4])
    assert status in (0, 11)
    assert poses >= 12
    assert len(pose.split(",")) == 13


def test_webhook_receiver(run, monkeypatch):
    monkeypatch.setenv("DLO_WEBHOOK_SECRET", SECRET)
    assert run("webhook_receiver").state == "succeeded"


def test_label_and_correct(run, tmp_path):
    shutil.copy(SAMPLES / "plain.jpg", tmp_path / "plain.jpg")
    assert run("label_and_correct", "--pictures", tmp_path)


def test_agent_tools(address):
    module = runpy.run_path(str(EXAMPLES / "agent_tools.py"))
    calls = [
        ("initialize", {}),
        ("tools/list", {}),
        ("tools/call", {"name": "find_cables", "arguments": {"path": str(SAMPLES / "plain.jpg")}}),
        ("tools/call", {"name": "find_cables", "arguments": {"path": "nowhere.jpg"}}),
        ("tools/call", {"name": "find_cables", "arguments": {}}),
        ("tools/call", {"name": "find_ropes"}),
        ("nothing", {}),
    ]
    lines = [
        {"jsonrpc": "2.0", "id": k, "method": name, "params": params}
        for k, (name, params) in enumerate(calls)
    ]
    notified = {"jsonrpc": "2.0", "method": "notifications/initialized"}
    texts = [json.dumps(line) for line in [*lines[:1], notified, *lines[1:]]]
    incoming = io.StringIO("".join(f"{text}\n" for text in [*texts, "{"]))
    outgoing = io.StringIO()
    module["main"](["--url", address], incoming, outgoing)
    replies = [json.loads(line) for line in outgoing.getvalue().splitlines()]
    started, tools, found, missing, incomplete, no_tool, unknown, no_json = replies
    assert started["result"]["serverInfo"]["name"] == "dlo-perception"
    for tool in tools["result"]["tools"]:
        assert tool["description"]
        assert tool["inputSchema"]["type"] == "object"
    assert len(json.loads(found["result"]["content"][0]["text"])["cables"]) >= 4
    assert missing["result"]["isError"]
    assert "'path'" in incomplete["result"]["content"][0]["text"]
    assert "find_cables" in no_tool["result"]["content"][0]["text"]
    assert (unknown["error"]["code"], no_json["error"]["code"]) == (-32601, -32700)


@pytest.mark.parametrize(
    "notebook", sorted((EXAMPLES / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem
)
def test_a_notebook_s_cells_run(address, notebook, monkeypatch):
    monkeypatch.setenv("DLO_URL", address)
    monkeypatch.chdir(EXAMPLES.parent)
    book = nbformat.read(notebook, 4)
    nbformat.validate(book)
    names: dict = {"display": lambda *_: None}
    for cell in book.cells:
        if cell.cell_type == "code":
            exec(compile(cell.source, notebook.name, "exec"), names)


def test_every_example_is_run_here():
    """A script without a test would rot."""
    text = Path(__file__).read_text()
    scripts = [path.stem for path in EXAMPLES.glob("*.py")]
    assert len(scripts) >= 11
    assert [
        name for name in scripts if f'"{name}"' not in text and f'"{name}.py"' not in text
    ] == []
    assert len(list((EXAMPLES / "notebooks").glob("*.ipynb"))) == 2


def test_notebooks_show_pictures():
    for path in (EXAMPLES / "notebooks").glob("*.ipynb"):
        outputs = [
            output for cell in nbformat.read(path, 4).cells for output in cell.get("outputs", [])
        ]
        assert any("image/png" in output.get("data", {}) for output in outputs), path
