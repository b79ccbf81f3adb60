"""The version of the installed library; SDK, service and tag have the same one."""

from importlib.metadata import PackageNotFoundError, version

DISTRIBUTION = "dlo-perception"

try:
    __version__ = version(DISTRIBUTION)
except PackageNotFoundError:  # in a clone, where the package is `models`
    __version__ = "0+clone"
