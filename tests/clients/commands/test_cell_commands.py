"""``dlo calibrate``, ``dlo bridge`` and ``dlo label-studio``: what they print, and what they refuse
in one line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import dlo_client
import httpx
import numpy as np
import pytest
from dlo_client.calibration import HandEye, board_pictures
from dlo_client.commands import (  # noqa: F401  they register their commands
    bridge_commands,
    calibration_commands,
    label_studio_commands,
    recipe_commands,
)
from dlo_client.commands.app import app
from dlo_client.contracts.frames import RobotPoses
from dlo_client.contracts.recipes import CameraBody, Recipe, RecipeUsed, StoredCamera
from typer.testing import CliRunner

from tests.clients import samples
from tests.clients.bridge.recipe_service import POSES

LENS = {"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240}


def dlo(*arguments, network=None):
    transport = httpx.MockTransport(network or (lambda _: httpx.Response(500)))
    return CliRunner().invoke(app, [str(argument) for argument in arguments], obj=transport)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "lens.json").write_text(json.dumps(LENS))
    (tmp_path / "flange.csv").write_text("picture,x,y,z\na.png,1,2,3,0,0,0,1\n")
    (tmp_path / "pictures").mkdir()
    return tmp_path


def arguments(files, *more):
    options = [
        "--flange",
        files / "flange.csv",
        "--intrinsics",
        files / "lens.json",
        "--board",
        "9x6x0.03",
    ]
    return ["calibrate", files / "pictures", *options, *more]


def test_calibrate_prints_the_pose_with_its_uncertainty_and_stores_it(files, monkeypatch):
    sent = []

    def network(request: httpx.Request) -> httpx.Response:
        sent.append((request.method, request.url.path, json.loads(request.content)))
        camera = CameraBody.model_validate(sent[-1][2])
        stored = StoredCamera(
            name="wrist", version=4, created_at=samples.job().created_at, camera=camera
        )
        return httpx.Response(200, text=stored.model_dump_json())

    found = HandEye(np.eye(4), np.eye(4), 0.0002, 0.001, np.zeros((6, 6)), [0.2, 0.3])
    monkeypatch.setattr(board_pictures, "hand_eye", lambda *_: (found, 11, ["b.png"]))
    done = dlo(*arguments(files, "--store", "wrist"), network=network)
    assert done.exit_code == 0, done.output
    assert "0.200 mm, 0.0573 degrees" in done.stdout
    assert "from 11 pictures, without 1: b.png" in done.stdout
    assert "stored as wrist, version 4" in done.stdout
    method, path, body = sent[0]
    assert (method, path) == ("PUT", "/v1/cameras/wrist")
    assert body["T_flange_camera"] == np.eye(4).tolist()
    assert body["sigma_m"] == 0.0002


def test_calibrate_names_what_is_missing(files):
    done = dlo(*arguments(files))
    assert done.exit_code == 1
    assert "4 pictures that show the board are needed, 0 do" in done.stderr
    (files / "pictures" / "other.png").write_bytes(b"x")
    assert "no pose of other.png" in dlo(*arguments(files)).stderr
    (files / "flange.csv").write_text("a.png,1,2,3\n")
    assert "row 1: 7 numbers" in dlo(*arguments(files)).stderr


def recipe_service(request: httpx.Request) -> httpx.Response:
    """Stores, lists and runs recipe 7."""
    made = samples.job().created_at
    if request.url.path.startswith("/v1/cameras"):
        yaml = "yaml" in request.headers["content-type"]
        camera = CameraBody.model_validate(
            {"intrinsics": LENS} if yaml else json.loads(request.content)
        )
        return httpx.Response(
            200,
            text=StoredCamera(
                name="wrist", version=2, created_at=made, camera=camera
            ).model_dump_json(),
        )
    if request.url.path.endswith("/run"):
        poses = RobotPoses(
            frame="world",
            unit="mm",
            rotation="kuka_abc",
            of="tool",
            poses=POSES,
            warnings=["3: is not on the plane"],
        )
        job = samples.job(poses=poses, recipe=RecipeUsed(number=7, version=2))
        return httpx.Response(200, text=job.model_dump_json())
    if request.url.path.endswith("/recipe"):
        return httpx.Response(
            200, text=json.dumps({"name": "shelf", "request": {"kind": "segment"}})
        )
    body = (
        json.loads(request.content)
        if request.method == "PUT"
        else {"name": "cables", "request": {"kind": "noop"}}
    )
    recipe = Recipe(number=7, version=2, created_at=made, **body)
    listed = f"[{recipe.model_dump_json()}]"
    return httpx.Response(200, text=listed if request.method == "GET" else recipe.model_dump_json())


def test_recipes_are_stored_listed_and_run(files):
    (files / "recipe.json").write_text(
        json.dumps({"name": "cables", "request": {"kind": "instances"}})
    )
    (files / "a.png").write_bytes(b"picture")
    (files / "lens.yaml").write_text("image_width: 640")
    stored = dlo("recipe-store", 7, files / "recipe.json", network=recipe_service)
    assert "recipe 7, version 2: cables" in stored.stdout, stored.output
    of_job = dlo("recipe-store", 7, "--job", "0" * 32, network=recipe_service)
    assert "recipe 7, version 2: shelf" in of_job.stdout, of_job.output
    neither = dlo("recipe-store", 7, network=recipe_service)
    assert (neither.exit_code, "--job" in neither.stderr) == (2, True)
    assert "7  version   2  cables  (noop)" in dlo("recipes", network=recipe_service).stdout
    done = dlo("recipe-run", 7, files / "a.png", network=recipe_service)
    assert "recipe 7, version 2: 3 poses of the tool in world, mm, kuka_abc" in done.stdout
    assert "0.25, -0.125, 0.05" in done.stdout
    assert "left out: 3: is not on the plane" in done.stdout
    assert (
        dlo("camera-store", "wrist", files / "lens.yaml", network=recipe_service).stdout
        == "camera wrist, version 2\n"
    )
    (files / "camera.json").write_text(json.dumps({"intrinsics": LENS}))
    assert (
        "version 2"
        in dlo("camera-store", "wrist", files / "camera.json", network=recipe_service).stdout
    )
    wrong = dlo("recipe-store", 7, files / "lens.json", network=recipe_service)
    assert (wrong.exit_code, "name: Field required" in wrong.stderr) == (1, True)


def test_a_bridge_without_a_camera_does_not_start(tmp_path):
    file = tmp_path / "bridge.toml"
    file.write_text("[ascii]\nport = 4711\n")
    done = dlo("bridge", file)
    assert done.exit_code == 1
    assert "picture: Field required" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("missing", "extra"), [("asyncua", "opcua"), ("defusedxml", "label"), ("scipy", "calibrate")]
)
def test_a_missing_extra_is_named(files, missing, extra):
    """In a process of its own: here all of them are installed, and loaded."""
    (files / "bridge.toml").write_text('[opcua]\nport = 4840\n[picture]\nfile = "a"\n')
    commands = {
        "opcua": ["bridge", files / "bridge.toml"],
        "label": ["label-studio"],
        "calibrate": arguments(files),
    }
    program = f"import sys; sys.modules[{missing!r}] = None; from dlo_client.commands.cli import main; main()"
    command = [sys.executable, "-c", program, *map(str, commands[extra])]
    root = Path(dlo_client.__file__).parents[1]
    done = subprocess.run(
        command, cwd=root, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 1
    assert f'pip install "dlo-client[{extra}]"' in done.stderr
    assert "Traceback" not in done.stderr


def test_a_backend_for_a_network_needs_a_password():
    done = dlo("label-studio", "--listen", "0.0.0.0", "--port", "0")
    assert done.exit_code == 1
    assert "password: is needed" in done.stderr
