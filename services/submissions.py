"""A body of ``POST /v1/jobs`` to a request that names its pictures by blob id, or to a problem.

Strategy: a JSON body is parsed as it stands. In a multipart body the pictures are kept as they stream in;
then the parts fill the image fields that the ``request`` part leaves out, by id, and the whole is validated.
Last, every image field is resolved: it has to name a part of this body or a picture uploaded before.
"""

from __future__ import annotations

from contextlib import aclosing
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from dlo_client.contracts import AnyRequest, CameraView, Contract, ImageInfo, ImagePart, ImageRef
from fastapi import Request
from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

from services.fields import body_problems
from services.multipart import Allowed, media_type, parts, whole
from services.problems import ProblemError, field_error, fields_error
from services.settings import ServiceSettings
from services.uploads import Uploads

REQUEST: TypeAdapter[AnyRequest] = TypeAdapter(AnyRequest)
JSON = "application/json"
MULTIPART = "multipart/form-data"
_MISSING = "is missing: send an `image` part, or name an uploaded picture"


@dataclass
class _Form:
    """What a body brought: its JSON, and the pictures kept from its parts."""

    text: bytes | None
    whole: str
    """What the JSON as a whole is called in a problem."""
    images: list[ImageInfo] = field(default_factory=list)
    mask: ImageInfo | None = None


async def read_submission(request: Request, settings: ServiceSettings, uploads: Uploads) -> AnyRequest:
    """The validated request, holding only :class:`ImageRef` where it names pictures.

    Raises:
        ProblemError: naming the field at fault.
    """
    form = await _read_form(request, settings, uploads)
    given = _parse(form)
    _fill(given, form)
    try:
        submitted = REQUEST.validate_python(given)
    except ValidationError as error:
        raise fields_error(body_problems(error.errors(), given, whole=form.whole)) from error
    _check_webhook(submitted, settings)
    return await _Pictures(form, uploads).resolve(submitted)


async def _read_form(request: Request, settings: ServiceSettings, uploads: Uploads) -> _Form:
    match media_type(request):
        case "application/json":
            text = await whole(request, field="body", max_bytes=settings.max_request_bytes)
            return _Form(text, whole="body")
        case "multipart/form-data":
            return await _read_parts(request, settings, uploads)
        case other:
            detail = f"send {JSON} or {MULTIPART}, not {other or 'a body without a content type'}"
            raise ProblemError(415, "unsupported_media_type", detail)


async def _read_parts(request: Request, settings: ServiceSettings, uploads: Uploads) -> _Form:
    allowed = {
        "request": Allowed(parts=1, bytes=settings.max_request_bytes),
        "image": Allowed(parts=settings.max_images_per_job, bytes=settings.max_image_bytes),
        "mask": Allowed(parts=1, bytes=settings.max_image_bytes),
    }
    form = _Form(text=None, whole="request")
    async with aclosing(parts(request, allowed)) as stream:
        async for part in stream:
            if part.name == "request":
                form.text = part.data
            elif part.name == "mask":
                form.mask = await uploads.keep(part.data, field="mask")
            else:
                form.images.append(await uploads.keep(part.data, field="image"))
    return form


def _parse(form: _Form) -> dict[str, Any]:
    if form.text is None:
        raise field_error("request", "this part is missing: it holds the request as JSON")
    try:
        given = from_json(form.text)
    except ValueError as error:
        raise field_error(form.whole, f"is not JSON: {error}", code="invalid_json") from error
    if not isinstance(given, dict):
        raise field_error(form.whole, "should be a JSON object")
    return given


def _check_webhook(request: AnyRequest, settings: ServiceSettings) -> None:
    """Only hosts that the operator named: else a request could make the service talk to its own network."""
    if request.webhook_url is None:
        return
    try:
        address = urlsplit(request.webhook_url)
    except ValueError as error:
        raise field_error("webhook_url", f"is no address: {error}") from error
    if not {address.netloc, address.hostname} & set(settings.webhook_hosts):
        raise field_error("webhook_url", f"{address.netloc} is not among the hosts that this service may call")


def _fill(given: dict[str, Any], form: _Form) -> None:
    """Let the parts fill the image fields that ``given`` leaves out; a kind without them refuses these.

    The fields are the ``image`` of every view in order where there are ``views``, else the one at the top.
    """
    views = given.get("views")
    holders = [view for view in views if isinstance(view, dict)] if isinstance(views, list) else [given]
    named = [field.get("part") for holder in (given, *holders) for field in holder.values() if isinstance(field, dict)]
    free = [part for part in range(len(form.images)) if part not in named]
    empty = [holder for holder in holders if holder.get("image") is None]
    for holder, part in zip(empty, free, strict=False):
        holder["image"] = {"part": part}
    if form.mask and given.get("mask") is not None:
        raise field_error("mask", "is both in the request and a part of its own")
    if form.mask:
        given["mask"] = {"id": form.mask.id}


class _Pictures:
    """Finds the picture behind every image field of one request."""

    def __init__(self, form: _Form, uploads: Uploads) -> None:
        self._parts = form.images
        self._mask = form.mask
        self._uploads = uploads
        self._unused = set(range(len(form.images)))
        self._found: dict[str, ImageInfo] = {}
        """By the field that names it, as in ``views.0.image``."""

    async def resolve(self, request: AnyRequest) -> AnyRequest:
        """``request`` with an :class:`ImageRef` for every picture; each is there, and they fit together."""
        resolved: AnyRequest = await self._walk(request, ())
        if self._unused:
            raise field_error("image", f"part {min(self._unused)} is not used by the request")
        image, mask = self._found.get("image"), self._found.get("mask")
        if "image" in type(request).model_fields and request.needs_picture and not (image or mask):
            raise field_error("image", _MISSING)
        for index, view in enumerate(getattr(request, "views", None) or []):
            self._check_view(view, f"views.{index}")
        if image and mask and (image.width, image.height) != (mask.width, mask.height):
            sizes = f"{mask.width} x {mask.height} pixels, the image {image.width} x {image.height}"
            raise field_error("mask", f"has another size than the image: {sizes}", code="size_mismatch")
        return resolved

    async def _walk(self, value: Any, path: tuple[str, ...]) -> Any:
        match value:
            case ImagePart() | ImageRef():
                return await self._reference(value, ".".join(path))
            case Contract():
                given = [name for name in type(value).model_fields if name in value.model_fields_set]
                walked = {name: await self._walk(getattr(value, name), (*path, name)) for name in given}
                return value.model_copy(update=walked)
            case list():
                return [await self._walk(inner, (*path, str(index))) for index, inner in enumerate(value)]
            case _:
                return value

    async def _reference(self, source: ImagePart | ImageRef, field_name: str) -> ImageRef:
        if isinstance(source, ImagePart):
            info = self._part(source.part, field_name)
        elif self._mask and source.id == self._mask.id:
            info = self._mask
        else:
            info = await self._uploads.find(source.id, field=field_name)
        self._found[field_name] = info
        return ImageRef(id=info.id)

    def _check_view(self, view: Any, field_name: str) -> None:
        """A view has a picture, and its intrinsics are of a picture of that size; a planned pose has none."""
        if not isinstance(view, CameraView):
            return
        image = self._found.get(f"{field_name}.image")
        if image is None:
            raise field_error(f"{field_name}.image", _MISSING)
        camera = view.intrinsics
        if (image.width, image.height) != (camera.width, camera.height):
            sizes = f"{camera.width} x {camera.height} pixels, but this one has {image.width} x {image.height}"
            raise field_error(f"{field_name}.intrinsics", f"are of a picture of {sizes}", code="size_mismatch")

    def _part(self, part: int, field_name: str) -> ImageInfo:
        if part >= len(self._parts):
            raise field_error(field_name, f"this body has no `image` part {part} (counted from 0)")
        self._unused.discard(part)
        return self._parts[part]
