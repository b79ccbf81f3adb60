"""Label Studio's tasks: see ``writing``, ``reading`` and ``brush``."""

from dlo_client.labelling.formats.label_studio.reading import read
from dlo_client.labelling.formats.label_studio.writing import CONFIG, write

__all__ = ["CONFIG", "read", "write"]
