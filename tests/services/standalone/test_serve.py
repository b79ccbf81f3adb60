"""``python -m services`` as a person starts it."""

import fcntl
import os
import signal
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import httpx
import pytest

from tests.processes import ROOT, wait_until

pytestmark = pytest.mark.system


def command(data_dir: Path, *arguments: str) -> list[str]:
    return [
        sys.executable,
        "-m",
        "services",
        "--port",
        "0",
        "--data-dir",
        str(data_dir),
        *arguments,
    ]


def environment(**given: str) -> dict[str, str]:
    """Without what would point the service elsewhere."""
    return {
        name: value for name, value in os.environ.items() if not name.startswith("DLO_")
    } | given


def run(data_dir: Path, *arguments: str, **given: str) -> subprocess.CompletedProcess[str]:
    started = command(data_dir, *arguments)
    return subprocess.run(
        started, cwd=ROOT, env=environment(**given), capture_output=True, text=True, timeout=150
    )


def descendants(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found += [child, *descendants(child)]
    return found


def program(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def service(tmp_path):
    """A running service: its process and its address."""
    process = subprocess.Popen(
        command(tmp_path / "data"),
        cwd=ROOT,
        env=environment(DLO_SPARE_CHILD="false"),  # which takes seconds to load
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        line = process.stdout.readline()
        assert line.startswith("ready at http://127.0.0.1:"), line
        yield process, line.split()[-1]
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_then_runs_a_command_against_the_ready_service_and_passes_its_code_on(tmp_path):
    script = textwrap.dedent("""
        import json, os, sys, urllib.request
        url, body = os.environ["DLO_URL"] + "/v1/jobs?wait=60", b'{"kind": "noop"}'
        call = urllib.request.Request(url, body, {"Content-Type": "application/json"})
        with urllib.request.urlopen(call, timeout=90) as answer:
            sys.exit(7 if json.load(answer)["state"] == "succeeded" else 1)
    """)
    ended = run(tmp_path / "data", "--then", sys.executable, "-c", script)
    assert ended.returncode == 7, ended.stderr
    assert (tmp_path / "data" / "queue").is_dir()


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_with_all_its_processes(service, sent):
    process, _ = service
    family = descendants(process.pid)
    assert any("workers" in program(pid) for pid in family)
    assert any("valkey" in program(pid) or "redis" in program(pid) for pid in family)
    process.send_signal(sent)
    assert process.wait(120) == 0
    wait_until(lambda: not any(map(alive, family)))


def test_kill_leaves_no_process_behind(service):
    process, _ = service
    family = descendants(process.pid)
    process.kill()
    process.wait()
    wait_until(lambda: not any(map(alive, family)))


def test_worker_that_dies_is_replaced(service):
    process, address = service
    worker = next(pid for pid in descendants(process.pid) if "-m workers " in program(pid))
    os.kill(worker, signal.SIGKILL)
    answer = httpx.post(f"{address}/v1/jobs?wait=60", json={"kind": "noop"}, timeout=70)
    assert answer.json()["state"] == "succeeded"


def test_queue_server_that_dies_is_replaced_and_no_job_is_lost(service):
    process, address = service
    with httpx.Client(base_url=address, timeout=70) as client:
        first, *others = (
            client.post("/v1/jobs", json={"kind": "noop", "hold_s": 0.3}).json() for _ in range(5)
        )
        client.get(f"/v1/jobs/{first['id']}?wait=30")
        queue = next(pid for pid in descendants(process.pid) if "-server" in program(pid))
        os.kill(queue, signal.SIGKILL)
        wait_until(lambda: client.get("/readyz").status_code == 200)
        states = [client.get(f"/v1/jobs/{job['id']}?wait=60").json()["state"] for job in others]
    assert states == ["succeeded"] * 4


def test_port_that_is_taken(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        ended = run(tmp_path, "--port", str(port))
    assert ended.returncode == 2
    assert f"127.0.0.1:{port}" in ended.stderr


def test_data_folder_of_another_service(tmp_path):
    with (tmp_path / "serve.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        ended = run(tmp_path)
    assert ended.returncode == 2
    assert str(tmp_path) in ended.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--host", "0.0.0.0"], "DLO_API_KEY_HASHES"),
        (["--port", "65536"], "port"),
        (["--workers", "0"], "workers"),
        (["--then", "no-such-command"], "no-such-command"),
    ],
)
def test_arguments_that_are_refused(tmp_path, arguments, complaint):
    ended = run(tmp_path, *arguments)
    assert ended.returncode == 2
    assert complaint in ended.stderr
    assert "Traceback" not in ended.stderr


def test_says_why_it_does_not_get_ready(tmp_path):
    script = (
        "from services import __main__\n"
        "from services.standalone import serve\n"
        "serve._READY_WITHIN_S = 2\n"
        "raise SystemExit(__main__.main())"
    )
    ended = subprocess.run(
        [
            sys.executable,
            "-c",
            script,
            "--port",
            "0",
            "--data-dir",
            str(tmp_path),
            "--then",
            "true",
        ],
        cwd=ROOT,
        env=environment(DLO_REDIS_URL="redis://127.0.0.1:1/0"),
        capture_output=True,
        text=True,
        timeout=150,
    )
    assert ended.returncode == 1
    assert "the queue cannot be reached" in ended.stderr
