"""Labels in the formats of other tools, and back. Needs the extra ``dlo-client[label]``.

Every format is a module with ``write(labels, out)``; those that people correct labels in have
``read(path, wanted)`` too. What other tools drew becomes instances in ``formats.gate`` alone.
``labels`` is a function that goes through all labels anew each time it is called: there may be a
hundred thousand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from dlo_client.labelling.formats import coco, cvat, indexed_png, label_studio, own_json, yolo
from dlo_client.labelling.formats.exchange import FormatError, Imported, Labels
from dlo_client.labelling.formats.gate import Wanted

WRITERS: Mapping[str, Callable[..., Path]] = {
    "coco": coco.write,
    "coco-polygons": coco.write_polygons,
    "yolo": yolo.write,
    "cvat": cvat.write,
    "label-studio": label_studio.write,
    "png": indexed_png.write,
    "json": own_json.write,
}
READERS: Mapping[str, Callable[..., Imported]] = {
    "coco": coco.read,
    "cvat": cvat.read,
    "label-studio": label_studio.read,
    "json": own_json.read,
}

__all__ = ["READERS", "WRITERS", "FormatError", "Imported", "Labels", "Wanted"]
