"""Security headers of every answer: what a browser may do with it."""

from __future__ import annotations

from starlette.datastructures import MutableHeaders

_OWN = (
    "default-src 'none'; connect-src 'self' blob:; img-src 'self' blob: data:; media-src blob:; font-src 'self'; "
    "form-action 'self'"
)
_ALWAYS = "base-uri 'self'; frame-ancestors 'none'"
_VIEWER = f"{_OWN}; script-src 'self'; style-src 'self'; {_ALWAYS}"
_DOCUMENTATION = (
    f"{_OWN}; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; "
    f"worker-src blob:; {_ALWAYS}"
)
"""Its pages, which FastAPI writes, hold a script."""

_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}


def secure(headers: MutableHeaders, path: str) -> None:
    """Add them to the answer for ``path``."""
    for name, value in _HEADERS.items():
        headers.setdefault(name, value)
    documentation = path.startswith(("/docs", "/redoc"))
    headers.setdefault("Content-Security-Policy", _DOCUMENTATION if documentation else _VIEWER)
