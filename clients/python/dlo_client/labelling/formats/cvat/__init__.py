"""CVAT's XML: see ``writing``, ``reading`` and ``tracks``."""

from dlo_client.labelling.formats.cvat.reading import read
from dlo_client.labelling.formats.cvat.writing import write

__all__ = ["read", "write"]
