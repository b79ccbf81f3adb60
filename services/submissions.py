"""A body of ``POST /v1/jobs`` to an entry of the queue, or to a problem.

Strategy: the pictures of a multipart body are staged as they stream in; then the parts fill the
image fields that the ``request`` part leaves out, by id, and the whole is validated
(:mod:`services.validation`). Last, every picture that is named has to be staged here or uploaded
before. The staged pictures are kept only when the queue takes the request; whatever happens before
that drops them.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from anyio import CapacityLimiter, to_thread
from dlo_client.contracts import ImageInfo
from dlo_client.contracts.recipes import FlangePose, RunInput
from fastapi import Request

from services.bodies import JSON, parsed
from services.multipart import Allowed, Part, media_type, parts, whole
from services.problems import ProblemError, field_error
from services.settings import ServiceSettings
from services.uploads import Uploads
from services.validation import Checked, Given, checked
from workers.blobs import Staged
from workers.networks.store import NetworkStore, NetworkUnknownError
from workers.record import Entry

MULTIPART = "multipart/form-data"
Compose = Callable[[int, Sequence[FlangePose]], bytes]
"""A number of pictures, and the poses of the flange, to the JSON of a request."""


@dataclass
class Submission:
    """A request that the queue may take, and the pictures to be kept with it."""

    entry: Entry
    staged: list[Staged]

    def sizes(self) -> dict[str, int]:
        """Bytes of its pictures, by id."""
        return {staged.blob_id: staged.bytes for staged in self.staged}

    def keep(self) -> None:
        """Keep its pictures; may be called again."""
        for staged in self.staged:
            staged.keep()


@dataclass
class _Form:
    """What a body brought: its JSON, and the pictures staged from its parts."""

    text: bytes | None
    whole: str
    """What the JSON as a whole is called in a problem."""
    images: list[ImageInfo] = field(default_factory=list)
    mask: ImageInfo | None = None
    depth: ImageInfo | None = None
    staged: list[Staged] = field(default_factory=list)


@dataclass(frozen=True)
class ForegroundNames:
    """The networks that a request may name: ``announced`` by workers, and those of users."""

    announced: Callable[[], Sequence[str]]
    store: NetworkStore

    def refusal(self, model: str) -> str | None:
        """Why ``model`` cannot be named; None if it can, or as long as no worker has announced
        any."""
        shipped = self.announced()
        if not shipped or model in shipped:
            return None
        try:
            self.store.find(model)
        except NetworkUnknownError:
            known = ", ".join([*shipped, *self.store.names()])
            return f"there is no foreground network {model!r}; there are: {known}"
        return None


class Submissions:
    """Reads submissions; large ones are checked one or two at a time."""

    def __init__(
        self,
        settings: ServiceSettings,
        uploads: Uploads,
        limiter: CapacityLimiter,
        networks: ForegroundNames,
    ) -> None:
        self._settings = settings
        self._networks = networks
        self._uploads = uploads
        self._limiter = limiter

    @asynccontextmanager
    async def read(
        self, request: Request, defaults: Mapping[str, Any] | None = None
    ) -> AsyncIterator[Submission]:
        """The submission in the body of ``request``; at the end its pictures that were not kept are
        dropped.

        ``defaults``: fields of a request that leaves them out, where its kind has them.

        Raises:
            ProblemError: naming the field at fault.
            NoRoomError: the disk is too full for its pictures.
        """
        form = _Form(text=None, whole="request")
        try:
            await self._read(request, form)
            yield Submission(await self._check(form, defaults or {}), form.staged)
        finally:
            await _drop(form.staged)

    @asynccontextmanager
    async def read_run(
        self, request: Request, compose: Compose, defaults: Mapping[str, Any]
    ) -> AsyncIterator[Submission]:
        """As :meth:`read`, of a body without a request, which ``compose`` makes of the number of
        pictures and the poses of the flange."""
        form = _Form(text=None, whole="recipe")
        try:
            flange = await self._read_run(request, form)
            form.text = await to_thread.run_sync(compose, len(form.images), flange)
            yield Submission(await self._check(form, defaults), form.staged)
        finally:
            await _drop(form.staged)

    async def _read_run(self, request: Request, form: _Form) -> list[FlangePose]:
        kind, most = media_type(request), self._settings.max_request_bytes
        if kind == "multipart/form-data":
            await self._read_parts(request, form, "flange")
            return _flange(form.text) if form.text else []
        if kind.startswith("image/") or kind == "application/octet-stream":
            data = await whole(request, field="image", max_bytes=self._settings.max_image_bytes)
            await self._stage(Part("image", data), form)
            return []
        if kind not in ("", JSON):
            detail = f"send a picture, {JSON} or {MULTIPART}, not {kind}"
            raise ProblemError(415, "unsupported_media_type", detail)
        text = await whole(request, field="body", max_bytes=most)
        given = parsed(text or b"{}", RunInput)
        await self._name(given, form)
        return given.flange

    async def named(
        self, given: RunInput, compose: Compose, defaults: Mapping[str, Any]
    ) -> Submission:
        """The submission of a run with uploaded pictures."""
        form = _Form(text=None, whole="recipe")
        await self._name(given, form)
        form.text = await to_thread.run_sync(compose, len(form.images), given.flange)
        return Submission(await self._check(form, defaults), form.staged)

    async def _name(self, given: RunInput, form: _Form) -> None:
        """Fill ``form`` with uploaded pictures."""
        for index, image in enumerate(given.images):
            form.images.append(await self._uploads.find(image.id, field=f"images.{index}"))
        if given.mask is not None:
            form.mask = await self._uploads.find(given.mask.id, field="mask")
        if given.depth is not None:
            form.depth = await self._uploads.find(given.depth.id, field="depth")

    async def _read(self, request: Request, form: _Form) -> None:
        match media_type(request):
            case "application/json":
                form.whole = "body"
                form.text = await whole(
                    request, field="body", max_bytes=self._settings.max_request_bytes
                )
            case "multipart/form-data":
                await self._read_parts(request, form)
            case other:
                detail = (
                    f"send {JSON} or {MULTIPART}, not {other or 'a body without a content type'}"
                )
                raise ProblemError(415, "unsupported_media_type", detail)

    async def _read_parts(self, request: Request, form: _Form, text: str = "request") -> None:
        """``text`` is the part that holds JSON; the others are pictures."""
        settings = self._settings
        allowed = {
            text: Allowed(parts=1, bytes=settings.max_request_bytes),
            "image": Allowed(parts=settings.max_images_per_job, bytes=settings.max_image_bytes),
            "mask": Allowed(parts=1, bytes=settings.max_image_bytes),
            "depth": Allowed(parts=1, bytes=settings.max_image_bytes),
        }
        async with aclosing(parts(request, allowed)) as stream:
            async for part in stream:
                if part.name == text:
                    form.text = part.data
                else:
                    await self._stage(part, form)

    async def _stage(self, part: Part, form: _Form) -> None:
        info, staged = await self._uploads.stage(part.data, field=part.name)
        form.staged.append(staged)
        if part.name == "mask":
            form.mask = info
        elif part.name == "depth":
            form.depth = info
        else:
            form.images.append(info)

    async def _check(self, form: _Form, defaults: Mapping[str, Any]) -> Entry:
        if form.text is None:
            raise field_error("request", "this part is missing: it holds the request as JSON")
        mask, depth = (info.id if info else None for info in (form.mask, form.depth))
        given = Given(
            form.text, form.whole, tuple(image.id for image in form.images), mask, defaults, depth
        )
        found = await checked(given, self._limiter)
        _check_webhook(found.entry, self._settings)
        await self._check_model(found.model)
        if found.uploads:
            await to_thread.run_sync(self._check_uploads, found)
        _check_sizes(found, await self._infos(found, form))
        return found.entry

    async def _check_model(self, model: str | None) -> None:
        refusal = await to_thread.run_sync(self._networks.refusal, model) if model else None
        if refusal:
            raise field_error("model", refusal, code="invalid_model")

    def _check_uploads(self, found: Checked) -> None:
        """What is no picture: it has to be there; its lifetime begins anew."""
        for name, upload_id in found.uploads.items():
            if not self._uploads.keep(upload_id):
                message = "nothing that was uploaded has this id (any longer); upload it first"
                raise field_error(name, message, code="unknown_upload")

    async def _infos(self, found: Checked, form: _Form) -> dict[str, ImageInfo]:
        """What is known of each picture, by the field that names it."""
        known = {
            info.id: info for info in (*form.images, form.mask, form.depth) if info is not None
        }
        infos = {}
        for name, image_id in found.pictures.items():
            infos[name] = known.get(image_id) or await self._uploads.find(image_id, field=name)
        return infos


def _flange(text: bytes) -> list[FlangePose]:
    """The part of that name."""
    return parsed(b'{"flange": %s}' % text, RunInput, "flange").flange


async def _drop(staged: list[Staged]) -> None:
    for one in staged:
        await to_thread.run_sync(one.drop)


def _check_webhook(entry: Entry, settings: ServiceSettings) -> None:
    """Only hosts that the operator named: else a request could make the service talk to its own
    network."""
    if entry.webhook_url is None:
        return
    try:
        address = urlsplit(entry.webhook_url)
    except ValueError as error:
        raise field_error("webhook_url", f"is no address: {error}") from error
    if not {address.netloc, address.hostname} & set(settings.webhook_hosts):
        raise field_error(
            "webhook_url", f"{address.netloc} is not among the hosts that this service may call"
        )


def _check_sizes(found: Checked, infos: Mapping[str, ImageInfo]) -> None:
    """The intrinsics of a view are of a picture of its size; a mask is as large as the image beside
    it."""
    for view, (width, height) in found.cameras.items():
        image = infos[f"{view}.image"]
        if (image.width, image.height) != (width, height):
            sizes = f"{width} x {height} pixels, but this one has {image.width} x {image.height}"
            raise field_error(
                f"{view}.intrinsics", f"are of a picture of {sizes}", code="size_mismatch"
            )
    for name, info in infos.items():
        number = name.removeprefix("reference.")
        beside = infos.get(f"views.{number}.image") or infos.get("image")
        if beside is None or (name not in ("mask", "depth") and number == name):
            continue
        if (beside.width, beside.height) != (info.width, info.height):
            sizes = (
                f"{info.width} x {info.height} pixels, the image {beside.width} x {beside.height}"
            )
            raise field_error(
                name, f"has another size than the image: {sizes}", code="size_mismatch"
            )
