"""Label a folder, put a person's corrections over it, and make a training set of what they made
right. With ``--adapt NAME`` the service learns from it, some minutes.

The corrections stand for an export of CVAT, COCO or Label Studio (``--tool``); docs/labelling.md
has the commands.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

SAMPLES = Path(__file__).parent.parent / "tests" / "samples"


def main(arguments: list[str] | None = None) -> list[str]:
    """Files of the training set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", help="default: DLO_URL, or port 8000 of this machine")
    parser.add_argument("--pictures", type=Path, default=SAMPLES)
    parser.add_argument(
        "--adapt",
        metavar="NAME",
        help="also adapt the default network to the labels, under this name",
    )
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        labels, dataset = Path(folder, "labels"), Path(folder, "dataset")
        dlo(options.url, "label", str(options.pictures), "--out", str(labels), "--format", "coco")
        export = labels / "exports" / "coco.json"
        if not export.exists():
            export = next(labels.rglob("*coco*.json"))
        dlo(options.url, "label-import", str(labels), str(export), "--tool", "coco")
        dlo(options.url, "label-dataset", str(labels), str(options.pictures), str(dataset))
        if options.adapt:
            dlo(options.url, "adapt", str(labels), "--name", options.adapt, "--all")
        return sorted(
            str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file()
        )


def dlo(url: str | None, *arguments: str) -> None:
    """The command of that name; a failure ends the script."""
    where = ["--url", url] if url else []
    command = [
        sys.executable,
        "-c",
        "from dlo_client.commands.cli import main; main()",
        *where,
        *arguments,
    ]
    if subprocess.run(command, check=False).returncode:
        sys.exit(f"dlo {arguments[0]} did not work")


if __name__ == "__main__":
    main()
