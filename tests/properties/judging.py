"""Runs one generated request as a worker would, and says what is wrong with what comes of it."""

from __future__ import annotations

import json
import math
import resource
import time
from collections.abc import Container
from pathlib import Path
from typing import Any

import cv2
from dlo_client.contracts import AnyResult
from pydantic import TypeAdapter, ValidationError

from models.weights.inference import Runtime
from tests.properties.pictures import pool
from tests.properties.requests import Request
from workers import stages
from workers.blobs import FolderBlobs
from workers.record import REQUEST
from workers.settings import Settings
from workers.stages.outcome import InvalidInput, Tools

RESULT: TypeAdapter[AnyResult] = TypeAdapter(AnyResult)
_LONGEST_S = 60.0
_MOST_GROWTH_MB = 1200.0


class Bench:
    """Tools of a worker, with the pictures of the pool in its blobs."""

    def __init__(self, folder: Path) -> None:
        settings = Settings(data_dir=folder)
        cv2.setNumThreads(1)
        self.tools = Tools(
            blobs=FolderBlobs(settings.blobs_dir, settings.blob_ttl_s),
            max_image_pixels=settings.max_image_pixels,
            runtime=Runtime(settings.onnx_providers, 1, spinning=False),
            networks=[],
        )
        self._ids = {name: self.tools.blobs.put(data) for name, (data, _) in pool().items()}

    def outcome(self, kind: str, given: Request) -> str:
        """``answered``, ``refused`` (by the contract) or ``failed`` (by the stage); raises
        AssertionError, or what the stage raised, for anything else."""
        text = json.dumps(self._with_pictures({"kind": kind} | given))
        try:
            request = REQUEST.validate_json(text)
        except ValidationError:
            return "refused"
        before, started = _peak_mb(), time.process_time()
        try:
            outcome = stages.run(request, self.tools)
        except InvalidInput as error:
            _check_reason(error, type(request).model_fields)
            return "failed"
        finally:
            assert time.process_time() - started < _LONGEST_S, "takes too long"
            assert _peak_mb() - before < _MOST_GROWTH_MB, "takes too much memory"
        check_finite(json.loads(outcome.result.model_dump_json()), "result")
        RESULT.validate_json(outcome.result.model_dump_json())
        return "answered"

    def _with_pictures(self, value: Any) -> Any:
        if isinstance(value, dict):
            if set(value) == {"picture"}:
                return {"id": self._ids[value["picture"]]}
            return {name: self._with_pictures(inner) for name, inner in value.items()}
        return [self._with_pictures(inner) for inner in value] if isinstance(value, list) else value


def _check_reason(error: InvalidInput, fields: Container[str]) -> None:
    if error.code == "invalid_numbers":
        raise AssertionError("refused only because arithmetic failed") from error.__cause__
    assert error.code.startswith(("invalid_", "none_found", "unknown_", "too_", "size_")), (
        error.code
    )
    assert error.field.split(".")[0] in fields, f"no field {error.field}"
    assert "nan" not in error.message.lower().split(), error.message


def check_finite(value: Any, path: str) -> None:
    """Raises AssertionError for NaN and infinity anywhere; JSON of pydantic writes them as null, so
    null where a number belongs is found by validating the result again."""
    if isinstance(value, float):
        assert math.isfinite(value), f"{path} is {value}"
    elif isinstance(value, dict | list):
        for name, inner in value.items() if isinstance(value, dict) else enumerate(value):
            check_finite(inner, f"{path}.{name}")


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
