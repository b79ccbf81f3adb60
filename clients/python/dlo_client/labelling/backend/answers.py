"""What Label Studio's calls are answered with: ``/health``, ``/setup``, ``/predict``, ``/webhook``.

Strategy: a project's labelling configuration names the tags that predictions go to; regions whose
sort of tag it lacks are left out. A picture that cannot be had leaves its task without a
prediction, and the others are answered.
"""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any, Protocol
from xml.etree.ElementTree import ParseError

from defusedxml.ElementTree import fromstring

from dlo_client.contracts import InstancesRequest, InstancesResult
from dlo_client.errors import DLOError
from dlo_client.labelling.backend.pictures import TaskPictures
from dlo_client.labelling.formats.exchange import Refused
from dlo_client.labelling.formats.label_studio.writing import CONFIG, prediction
from dlo_client.labelling.labels import label_of
from dlo_client.version import __version__

VERSION = f"dlo-{__version__}"
_TAGS = {
    "brushlabels": "BrushLabels",
    "vectorlabels": "VectorLabels",
    "keypointlabels": "KeyPointLabels",
}
_KEPT_EVENTS = ("ANNOTATION_CREATED", "ANNOTATION_UPDATED", "ANNOTATIONS_CREATED")

log = logging.getLogger(__name__)


class Predictor(Protocol):
    """The part of Client that is used."""

    def run(self, request: InstancesRequest, image: bytes, /) -> InstancesResult: ...


class Answers:
    """``corrections``: folder for annotations that people finish, as ``dlo label-import --tool
    label-studio`` reads."""

    def __init__(
        self,
        client: Predictor,
        pictures: TaskPictures,
        request: InstancesRequest,
        corrections: Path | None = None,
    ) -> None:
        self._client = client
        self._pictures = pictures
        self._request = request
        self._corrections = corrections

    def answer(self, method: str, path: str, body: bytes) -> tuple[int, dict[str, Any]]:
        """Status and JSON of a call."""
        if method == "GET" and path in ("/", "/health"):
            return 200, {"status": "UP", "model_class": "DLO", "v2": True}
        if method != "POST" or path not in ("/setup", "/predict", "/webhook"):
            return 404, {"detail": f"there is no {method} {path}"}
        try:
            given = json.loads(body or b"{}")
            if not isinstance(given, dict):
                raise ValueError("a JSON object is expected")
            return 200, getattr(self, f"_{path[1:]}")(given)
        except (ValueError, ParseError) as error:
            return 400, {"detail": str(error)}

    def _setup(self, given: dict[str, Any]) -> dict[str, Any]:
        """Where Label Studio is, if it was not stated before; a configuration that fits nothing is
        refused."""
        if given.get("hostname") and not self._pictures.host:
            self._pictures.host = str(given["hostname"]).rstrip("/")
        if given.get("access_token") and not self._pictures.token:
            self._pictures.token = str(given["access_token"])
        if given.get("schema") and not Controls.of(str(given["schema"])).tags:
            raise ValueError(
                f"the configuration has none of {', '.join(_TAGS.values())}; this one fits:\n{CONFIG}"
            )
        return {"model_version": VERSION}

    def _predict(self, given: dict[str, Any]) -> dict[str, Any]:
        controls = Controls.of(str(given.get("label_config") or CONFIG))
        tasks = given.get("tasks")
        if not isinstance(tasks, list):
            raise ValueError("tasks: a list is expected")
        return {
            "model_version": VERSION,
            "results": [self._predicted(task, controls) for task in tasks],
        }

    def _predicted(self, task: Any, controls: Controls) -> dict[str, Any]:
        empty = {"result": [], "score": 0.0, "model_version": VERSION}
        try:
            address = str(task["data"][controls.value])
            label = label_of(self._client.run(self._request, self._pictures.read(address)), address)
        except (KeyError, TypeError):
            return empty | {"error": f"the task has no data.{controls.value}"}
        except (Refused, DLOError) as error:
            log.warning("no prediction: %s", error)
            return empty | {"error": str(error)}
        made = prediction(label)
        regions = [
            controls.named(region) for region in made["result"] if region["type"] in controls.tags
        ]
        return {"result": regions, "score": made["score"], "model_version": VERSION}

    def _webhook(self, given: dict[str, Any]) -> dict[str, Any]:
        """Keep what a person has annotated, one file a task; the latest annotation counts."""
        task, annotation = given.get("task"), given.get("annotation")
        if given.get("action") not in _KEPT_EVENTS or not isinstance(task, dict) or not annotation:
            return {"status": "ignored"}
        if self._corrections is None:
            return {"status": "ignored", "detail": "no folder for corrections: --out"}
        self._corrections.mkdir(parents=True, exist_ok=True)
        annotations = annotation if isinstance(annotation, list) else [annotation]
        number = int(task.get("id", 0))
        text = json.dumps([task | {"annotations": annotations}])
        beside = self._corrections / f"task-{number}.json.part"
        beside.write_text(text, encoding="utf-8")
        beside.replace(self._corrections / f"task-{number}.json")
        return {"status": "kept"}


class Controls:
    """Where predictions go: ``tags`` by the type of a region, (name, to_name, first label);
    ``value``: the field of a task's data that names the picture."""

    def __init__(self, tags: dict[str, tuple[str, str, str]], value: str) -> None:
        self.tags = tags
        self.value = value

    @classmethod
    def of(cls, config: str) -> Controls:
        """Raises ParseError for what is no XML, ValueError for what forbidden XML holds."""
        root = fromstring(config)
        tags = {}
        for kind, tag in _TAGS.items():
            control = root.find(f".//{tag}")
            label = None if control is None else control.find("Label")
            if control is not None and label is not None:
                tags[kind] = (
                    control.get("name", ""),
                    control.get("toName", ""),
                    label.get("value", ""),
                )
        image = root.find(".//Image")
        return cls(
            tags, (image.get("value", "") if image is not None else "").lstrip("$") or "image"
        )

    def named(self, region: dict[str, Any]) -> dict[str, Any]:
        """The region with the project's own names."""
        kind = region["type"]
        name, to_name, label = self.tags[kind]
        value = region["value"] | {kind: [label]}
        return region | {"from_name": name, "to_name": to_name, "value": value}
