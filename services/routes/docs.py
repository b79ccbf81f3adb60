"""``/docs`` and ``/redoc``: the documentation for a browser, with nothing fetched from
elsewhere."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import fastapi_offline
from fastapi import APIRouter, FastAPI, Request
from fastapi.openapi.docs import get_redoc_html, get_swagger_ui_html
from fastapi.responses import HTMLResponse, Response
from fastapi.staticfiles import StaticFiles

_FILES = Path(fastapi_offline.__file__).parent / "static"
_PREFIX = "/static-offline-docs"
_REDOC = "redoc.standalone.js"
_FOREIGN_LOGO = "https://cdn.redoc.ly/redoc/logo-mini.svg"
_NO_PICTURE = "data:,"
"""The page leaves a logo out that does not load."""

router = APIRouter(include_in_schema=False)


@router.get("/docs")
async def swagger(request: Request) -> HTMLResponse:
    root = request.scope.get("root_path", "")
    return get_swagger_ui_html(
        openapi_url=f"{root}{request.app.openapi_url}",
        title=request.app.title,
        swagger_js_url=f"{root}{_PREFIX}/swagger-ui-bundle.js",
        swagger_css_url=f"{root}{_PREFIX}/swagger-ui.css",
        swagger_favicon_url=f"{root}/viewer/icon.svg",
        swagger_ui_parameters={
            "validatorUrl": None,
            "defaultModelsExpandDepth": 0,
            "displayRequestDuration": True,
        },
    )


@router.get("/redoc")
async def redoc(request: Request) -> HTMLResponse:
    root = request.scope.get("root_path", "")
    return get_redoc_html(
        openapi_url=f"{root}{request.app.openapi_url}",
        title=request.app.title,
        redoc_js_url=f"{root}{_PREFIX}/{_REDOC}",
        redoc_favicon_url=f"{root}/viewer/icon.svg",
        with_google_fonts=False,
    )


@router.get(f"{_PREFIX}/{_REDOC}")
def redoc_script() -> Response:
    return Response(_redoc_script(), media_type="text/javascript")


@cache
def _redoc_script() -> str:
    """The packaged script fetches a logo from its maker's server."""
    return (_FILES / _REDOC).read_text(encoding="utf-8").replace(_FOREIGN_LOGO, _NO_PICTURE)


def mount(app: FastAPI) -> None:
    """Serve the pages, and their scripts below a path of their own."""
    app.include_router(router)
    app.mount(_PREFIX, StaticFiles(directory=_FILES), name="static-offline-docs")
