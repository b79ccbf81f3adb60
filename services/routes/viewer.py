"""The pages, and the files that they name."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from fastapi import APIRouter, FastAPI
from fastapi.responses import HTMLResponse
from fastapi.staticfiles import StaticFiles

from services.page_frame import PAGES, document

_FILES = Path(__file__).parent.parent / "viewer"

router = APIRouter(include_in_schema=False)


async def _page(name: str, base: str) -> HTMLResponse:
    return HTMLResponse(document(name, base))


router.get("/")(partial(_page, "index", "./"))
for name in PAGES:
    router.get(f"/viewer/{name}.html")(partial(_page, name, "../"))


def mount(app: FastAPI) -> None:
    """Serve the pages at ``/`` and below ``/viewer``, where their files are too."""
    app.include_router(router)
    app.mount("/viewer", StaticFiles(directory=_FILES), name="viewer")
