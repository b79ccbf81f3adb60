"""The formats of labels as choices of a command line."""

from __future__ import annotations

from enum import StrEnum


class Format(StrEnum):
    """What labels can be written as."""

    COCO = "coco"
    COCO_POLYGONS = "coco-polygons"
    YOLO = "yolo"
    CVAT = "cvat"
    LABEL_STUDIO = "label-studio"
    PNG = "png"
    JSON = "json"


class Tool(StrEnum):
    """Where corrections can come from."""

    COCO = "coco"
    CVAT = "cvat"
    LABEL_STUDIO = "label-studio"
    JSON = "json"
