"""A JSON body as a contract, read with a limit, its errors in the names that the user wrote."""

from __future__ import annotations

import json
from typing import TypeVar

from fastapi import Request
from pydantic import BaseModel, ValidationError

from services.fields import body_problems
from services.multipart import media_type, whole
from services.problems import ProblemError, field_error, fields_error

JSON = "application/json"
ModelT = TypeVar("ModelT", bound=BaseModel)


async def read(
    request: Request, model: type[ModelT], max_bytes: int, field: str = "body"
) -> ModelT:
    """The body as ``model``. Raises ProblemError."""
    if (kind := media_type(request)) != JSON:
        detail = f"send {JSON}, not {kind or 'a body without a content type'}"
        raise ProblemError(415, "unsupported_media_type", detail)
    return parsed(await whole(request, field=field, max_bytes=max_bytes), model, field)


def parsed(text: bytes, model: type[ModelT], field: str = "body") -> ModelT:
    """``text`` as ``model``; what is no JSON is called ``field``. Raises ProblemError."""
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise field_error(field, f"is not JSON: {error}", code="invalid_json") from None
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        problems = body_problems(found, fields, whole=field)
        raise fields_error(problems, len(problems)) from None
