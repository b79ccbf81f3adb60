"""``dlo track`` against a mocked network: videos, folders, what is written, what is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
from dlo_client.commands import tracking_commands  # noqa: F401  it registers the command
from dlo_client.commands.app import app
from dlo_client.contracts import FrameResult, StreamedFrame
from typer.testing import CliRunner, Result

from tests.clients import track_samples
from tests.clients.replies import ok, reply
from tests.clients.test_track_stream import Service, serving

SIZE = (160, 120)


def network(sent: list[httpx.Request]) -> httpx.MockTransport:
    def answer(request: httpx.Request) -> httpx.Response:
        sent.append(request)
        if request.url.path.endswith("/frames"):
            number = sum(r.url.path.endswith("/frames") for r in sent)
            return ok(track_samples.frame(number))()
        return reply(204)() if request.method == "DELETE" else ok(track_samples.info(), 201)()

    return httpx.MockTransport(answer)


def run(sent: list[httpx.Request], *arguments: object) -> Result:
    return CliRunner().invoke(app, ["track", *map(str, arguments)], obj=network(sent))


@pytest.fixture
def film(tmp_path: Path) -> Path:
    path = tmp_path / "film.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, SIZE)
    for k in range(6):
        writer.write(np.full((SIZE[1], SIZE[0], 3), 40 * k, np.uint8))
    writer.release()
    return path


def lines(out: Path) -> list[FrameResult]:
    return [
        FrameResult.model_validate_json(line)
        for line in (out / "track.jsonl").read_text().splitlines()
    ]


def test_a_video(film: Path, tmp_path: Path) -> None:
    sent: list[httpx.Request] = []
    out = tmp_path / "out"
    done = run(sent, film, "--out", out, "--every", 2)
    assert done.exit_code == 0, done.output
    assert [frame.frame for frame in lines(out)] == [1, 2, 3]
    frames = [request for request in sent if request.url.path.endswith("/frames")]
    assert [float(request.url.params["time_s"]) for request in frames] == pytest.approx(
        [0.0, 0.2, 0.4]
    )
    assert (
        "3 frames, 3 cables in all; cables by state: lost 3, partly_covered 3, seen 3"
        in done.stdout
    )
    made = cv2.VideoCapture(str(out / "overlay.mp4"))
    assert made.get(cv2.CAP_PROP_FRAME_COUNT) == 3
    there, picture = made.read()
    assert there
    # The first cable is drawn, the one that is lost is not.
    assert np.ptp(picture[20, 60:100].astype(int)) + int(picture[20, 80].max()) > 60
    assert int(picture[60, 20:140].max()) < 60


def test_a_folder_of_masks_without_a_film(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for k in range(2):
        cv2.imwrite(str(folder / f"{k}.png"), np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    sent: list[httpx.Request] = []
    done = run(sent, folder, "--out", tmp_path / "out", "--masks", "--no-video")
    assert done.exit_code == 0, done.output
    assert len(lines(tmp_path / "out")) == 2
    assert not (tmp_path / "out" / "overlay.mp4").exists()
    assert all(b'name="mask"' in r.content for r in sent if r.url.path.endswith("/frames"))


def test_what_is_neither_a_video_nor_pictures(tmp_path: Path) -> None:
    done = run([], tmp_path / "nothing", "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert "neither a video nor pictures" in done.output


def test_live_shows_pictures_as_a_camera_would(film: Path, tmp_path: Path) -> None:
    """What the service is too slow for is left out, and every answer is drawn on its own
    picture."""
    service = Service()
    service.free.release(100)
    with serving(service) as address:
        arguments = ["--url", address, "track", str(film), "--out", str(tmp_path / "out"), "--live"]
        done = CliRunner().invoke(app, arguments, obj=network([]))
    assert done.exit_code == 0, done.output
    found = lines(tmp_path / "out")
    assert [frame.frame for frame in found] == list(range(1, len(service.got) + 1))
    assert [about["time_s"] for about, _ in service.got] == pytest.approx(
        sorted(a["time_s"] for a, _ in service.got)
    )
    assert (
        len(found)
        + sum(StreamedFrame.model_validate_json(x).dropped for x in raw(tmp_path / "out"))
        == 6
    )


def raw(out: Path) -> list[str]:
    return (out / "track.jsonl").read_text().splitlines()


def test_a_stream_takes_no_masks(film: Path, tmp_path: Path) -> None:
    done = run([], film, "--out", tmp_path / "out", "--live", "--masks")
    assert done.exit_code == 2
    assert "--masks" in done.output
