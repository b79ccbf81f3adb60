"""``python -m tests.rehearsal [--extras s3]``: what the images do, without Docker; needs the
package index.

A fresh environment from the exact versions; the files that the Dockerfile copies; the entry points;
one job with a picture. Where we are root as in the compose file: another user without capabilities,
a root that is read-only but for the data and an empty ``/tmp``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import httpx

from tests.processes import ROOT, wait_until
from tests.rehearsal.dockerfile import Image, copy_into, images
from workers.embedded import EmbeddedQueue, free_port

_CONFINED = """
set -e
mount --bind "$DATA" "$DATA"
if [ -n "$HIDDEN" ]; then
  mkdir -p "$PYTHON_BESIDE"
  mount --bind "$PYTHON_HOME" "$PYTHON_BESIDE"
  mount -t tmpfs -o mode=755 tmpfs "$HIDDEN"
  mkdir -p "$PYTHON_HOME"
  mount --bind "$PYTHON_BESIDE" "$PYTHON_HOME"
fi
case "$FOLDER" in
  /tmp/*)
    mount --rbind "$FOLDER" /mnt
    mount -t tmpfs tmpfs /tmp
    mkdir -p "$FOLDER"
    mount --rbind /mnt "$FOLDER"
    mount -o remount,bind,ro "$FOLDER"
    cd "$APP" ;;
  *) mount -t tmpfs tmpfs /tmp ;;
esac
mount -o remount,bind,ro /
if touch /read-only 2>/dev/null; then echo "the root can be written to"; exit 1; fi
unset DATA FOLDER APP HIDDEN PYTHON_HOME PYTHON_BESIDE
exec setpriv --reuid $USER_ID --regid $USER_ID --clear-groups --no-new-privs --bounding-set -all --inh-caps -all "$@"
"""
"""An interpreter below a folder that only root may enter (``HIDDEN``) is put where everybody can
reach it; a checkout below ``/tmp`` is put into the empty one, read-only but for the data."""

_KEY = "rehearsal"
_TRAINING = ("torch", "onnx", "pytest")


def build(image: Image, folder: Path, python: Path | None) -> Path:
    """Copy, install into a fresh environment unless one is given, make read-only; the environment's
    python."""
    app = folder / "app"
    copy_into(ROOT, image, app)
    if python is None:
        subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
        python = folder / "venv" / "bin" / "python"
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "-r", "requirements/service.txt"], cwd=app, check=True)
        subprocess.run([*pip, "--no-deps", "./clients/python"], cwd=app, check=True)
        shutil.rmtree(app / "clients" / "python" / "build", ignore_errors=True)
        check_alone(python, app)
    subprocess.run([python, "-m", "compileall", "-q", "."], cwd=app, check=True)
    for path in (app, *app.rglob("*")):
        path.chmod(path.stat().st_mode & ~(stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH))
    return python


def check_alone(python: Path, app: Path) -> None:
    """Nothing of training is installed, and no two versions contradict each other."""
    program = (
        "import importlib.util, sys; sys.exit(any(map(importlib.util.find_spec, sys.argv[1:])))"
    )
    assert (
        subprocess.run([python, "-c", program, *_TRAINING], cwd=app, check=False).returncode == 0
    ), _TRAINING
    subprocess.run([python, "-m", "pip", "check", "--quiet"], cwd=app, check=True)


def run(image: Image, folder: Path, python: Path, **environment: str) -> subprocess.Popen[bytes]:
    """Its entry point, as nobody."""
    command = [part.replace("0.0.0.0", "127.0.0.1") for part in image.command]
    command = [environment.pop("PORT", part) if part == "8000" else part for part in command]
    program = [str(python), *(["-m", "uvicorn"] if command[0] == "uvicorn" else []), *command[1:]]
    env = {"PATH": os.environ["PATH"], "HOME": "/nonexistent", **image.environment, **environment}
    if os.getuid() == 0:
        program = ["unshare", "--mount", "sh", "-c", _CONFINED, "sh", *program]
        home = Path(sys.base_prefix)
        hidden = [parent for parent in home.parents if not parent.stat().st_mode & stat.S_IXOTH]
        env |= {
            "DATA": environment["DLO_DATA_DIR"],
            "FOLDER": str(folder.parent),
            "APP": str(folder / "app"),
            "HIDDEN": str(hidden[-1]) if hidden else "",
            "PYTHON_HOME": str(home),
            "PYTHON_BESIDE": str(folder / "python"),
            "USER_ID": image.user,
        }
    return subprocess.Popen(program, cwd=folder / "app", env=env)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--python", type=Path, help="of an environment that is there already")
    asked = parser.parse_args()
    found = images((ROOT / "Dockerfile").read_text())
    Path("build").mkdir(exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix="rehearsal-", dir="build")).absolute()
    folder.chmod(0o755)
    started: list[subprocess.Popen[bytes]] = []
    try:
        data = folder / "data"
        data.mkdir(mode=0o777)
        data.chmod(0o777)
        python = asked.python
        for name in ("service", "worker"):
            python = build(found[name], folder / name, python)
        with EmbeddedQueue(folder / "queue") as server:
            port = free_port()
            common = {
                "DLO_REDIS_URL": server.url,
                "DLO_DATA_DIR": str(data),
                "DLO_SPARE_CHILD": "false",
            }
            common |= {"DLO_API_KEY_HASHES": hashlib.sha256(_KEY.encode()).hexdigest()}
            both = (
                run(found[name], folder / name, python, PORT=str(port), **common)
                for name in found
                if name != "base"
            )
            started.extend(both)
            print(json.dumps(try_out(f"http://127.0.0.1:{port}", started)))
            for process in started:
                process.terminate()
                assert process.wait(30) in (0, -15), "does not end when asked"
    finally:
        for process in started:
            process.kill()
        subprocess.run(["chmod", "-R", "u+w", str(folder)], check=False)
        shutil.rmtree(folder, ignore_errors=True)


def try_out(url: str, processes: Sequence[subprocess.Popen[bytes]]) -> dict[str, Any]:
    """One job through HTTP; seconds until ready, and what was found. Raises AssertionError when a
    process ends."""
    begin = time.monotonic()
    with httpx.Client(
        base_url=url, headers={"Authorization": f"Bearer {_KEY}"}, timeout=90
    ) as client:

        def ready() -> bool:
            assert all(process.poll() is None for process in processes), (
                "a process ended before it was ready"
            )
            try:
                return client.get("/readyz").status_code == 200
            except httpx.HTTPError:
                return False

        wait_until(ready, 240)
        ready_s = round(time.monotonic() - begin, 1)
        files = [("image", ("plain.jpg", (ROOT / "tests/samples/plain.jpg").read_bytes()))]
        parts = [*files, ("request", (None, json.dumps({"kind": "instances"})))]
        job = client.post("/v1/jobs?wait=60", files=parts).json()
        assert job["state"] == "succeeded", job
        overlay = client.get(f"/v1/jobs/{job['id']}/files/overlay.png")
        assert overlay.status_code == 200
        return {
            "ready_s": ready_s,
            "cables": len(job["result"]["instances"]),
            "overlay_bytes": len(overlay.content),
        }


if __name__ == "__main__":
    main()
