"""The file for several hosts, on several hosts."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import yaml

from services.settings import ServiceSettings
from tests.processes import ROOT, wait_until
from tests.rehearsal.compose import environment
from workers.embedded import free_port

FILE = ROOT / "deploy" / "three-hosts.yaml"


def test_a_compose_file_fills_in_values_defaults_and_secrets(tmp_path):
    values = {
        "DLO_BLOBS_URL": "s3://dlo",
        "AWS_DEFAULT_REGION": "eu-1",
        "DLO_KEYS": "/etc/dlo/keys.toml",
    }
    found = environment(FILE, "service", values, tmp_path)
    assert found["DLO_REDIS_URL"] == "rediss://queue:6379/0"
    assert found["DLO_REDIS_PASSWORD_FILE"] == str(tmp_path / "queue.password")
    assert found["DLO_API_KEYS_FILE"] == str(tmp_path / "keys.toml")
    assert found["AWS_DEFAULT_REGION"] == "eu-1"
    assert "AWS_ENDPOINT_URL_S3" not in found, "passed on only where it is set"


def test_what_has_to_be_set_is_asked_for(tmp_path):
    with pytest.raises(KeyError, match="DLO_BLOBS_URL"):
        environment(FILE, "worker", {}, tmp_path)


def test_every_variable_of_the_parts_is_a_setting_or_the_bucket_s():
    for name in ("service", "worker"):
        given = yaml.safe_load(FILE.read_text())["services"][name]["environment"]
        ours = {
            variable.removeprefix("DLO_").lower()
            for variable in given
            if variable.startswith("DLO_")
        }
        assert ours <= set(ServiceSettings.model_fields)


@contextmanager
def answering(text: bytes) -> Iterator[int]:
    """A port that answers each connection with ``text``."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            for _ in range(4):
                try:
                    connection, _ = listener.accept()
                except OSError:
                    return
                connection.sendall(text)
                connection.close()

        threading.Thread(target=serve, daemon=True).start()
        yield listener.getsockname()[1]
        listener.shutdown(socket.SHUT_RDWR)


def test_the_proxy_takes_turns_and_passes_over_who_does_not_answer():
    port, gone = free_port(), free_port()
    with answering(b"north") as north, answering(b"south") as south:
        to = ",".join(f"127.0.0.1:{one}" for one in (north, gone, south))
        command = [
            sys.executable,
            "-m",
            "tests.rehearsal.relay",
            "--listen",
            f"127.0.0.1:{port}",
            "--to",
            to,
        ]
        relay = subprocess.Popen(command, cwd=ROOT)
        try:

            def ask() -> bytes:
                try:
                    with socket.create_connection(("127.0.0.1", port), 60) as connection:
                        return connection.recv(100)
                except OSError:
                    return b""

            wait_until(lambda: ask() == b"north")
            assert [ask() for _ in range(3)] == [b"south", b"north", b"south"]
        finally:
            relay.kill()
            relay.wait()


@pytest.mark.system
@pytest.mark.slow
def test_pictures_reach_every_host_and_a_stranger_does_not_join(tmp_path):
    out = tmp_path / "hosts.json"
    command = [
        sys.executable,
        "-m",
        "tests.rehearsal.hosts",
        "--only",
        "spread,stranger",
        "--out",
        str(out),
    ]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False
    )
    if done.stdout.startswith("skipped"):
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    assert min(json.loads(out.read_text())["spread"]["by host"]) > 0
