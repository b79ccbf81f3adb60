"""The web page."""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter, FastAPI
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles

_FILES = Path(__file__).parent.parent / "viewer"

router = APIRouter()


@router.get("/", include_in_schema=False)
async def page() -> FileResponse:
    return FileResponse(_FILES / "index.html")


def mount(app: FastAPI) -> None:
    """Serve the page at ``/`` and its files below ``/viewer``."""
    app.include_router(router)
    app.mount("/viewer", StaticFiles(directory=_FILES), name="viewer")
