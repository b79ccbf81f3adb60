"""The version of this package, as it was installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("dlo-client")
except PackageNotFoundError:  # run from its folder without an installation
    __version__ = "0+unknown"
