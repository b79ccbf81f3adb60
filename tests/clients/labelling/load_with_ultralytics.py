"""Opens a YOLO export as Ultralytics' training does and prints what it found:
``load_with_ultralytics.py YAML``.

A process of its own: importing Ultralytics replaces functions of OpenCV and Pillow for everybody.
"""

from __future__ import annotations

import importlib.metadata
import json
import sys
from pathlib import Path


def main(yaml: str) -> None:
    version = importlib.metadata.version
    # Ultralytics asks for the version of torchvision, which it needs for networks, not for data.
    importlib.metadata.version = lambda name: "0.28.0" if name == "torchvision" else version(name)
    from ultralytics.data import utils
    from ultralytics.data.dataset import YOLODataset

    utils.check_font = lambda *_: None  # it would fetch a font to draw with
    data = utils.check_det_dataset(yaml, autodownload=False)
    found = {"names": list(data["names"].items())}
    for side in ("train", "val"):
        dataset = YOLODataset(
            img_path=data[side], data=data, task="segment", imgsz=96, augment=False, rect=False
        )
        found[side] = [
            {
                "file": Path(label["im_file"]).name,
                "segments": len(label["segments"]),
                "shape": label["shape"],
            }
            for label in dataset.labels
        ]
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])
