"""Watch a folder: whatever picture arrives is answered by a JSON file and an overlay beside it.

python examples/watch_folder.py incoming --once      # what is there now
python examples/watch_folder.py incoming             # and what comes
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from dlo_client import Client, DLOError, InstancesRequest

SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp")
PAUSE_S = 1.0


def main(arguments: list[str] | None = None) -> int:
    """How many pictures were answered."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--url")
    parser.add_argument("--once", action="store_true")
    options = parser.parse_args(arguments)
    answered = 0
    with Client(options.url) as client:
        while True:
            for picture in waiting(options.folder):
                answered += answer(client, picture)
            if options.once:
                return answered
            time.sleep(PAUSE_S)


def waiting(folder: Path) -> list[Path]:
    """Pictures without an answer; one that is still being written has changed within the last half
    second."""
    now = time.time()
    pictures = (path for path in sorted(folder.iterdir()) if path.suffix.lower() in SUFFIXES)
    found = (path for path in pictures if ".overlay" not in path.name)
    return [
        path
        for path in found
        if not beside(path, ".json").exists() and now - path.stat().st_mtime > 0.5
    ]


def answer(client: Client, picture: Path) -> int:
    """1 if it was answered; a picture that is none gets its problem as an answer, so that it is not
    tried again."""
    try:
        job = client.run_job(InstancesRequest(files=["overlay"]), picture)
    except DLOError as error:
        beside(picture, ".json").write_text(f'{{"problem": "{type(error).__name__}"}}\n')
        print(f"{picture.name}: {error}")
        return 0
    beside(picture, ".overlay.png").write_bytes(client.file(job, "overlay.png"))
    assert job.result is not None
    beside(picture, ".json").write_text(job.result.model_dump_json(indent=2))
    print(f"{picture.name}: {len(job.result.instances)} cables")
    return 1


def beside(picture: Path, suffix: str) -> Path:
    return picture.with_name(picture.stem + suffix)


if __name__ == "__main__":
    main()
