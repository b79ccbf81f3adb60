"""How Sphinx builds the documentation: `make docs`. A warning is an error there."""

import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "clients" / "python")]

from dlo_client.version import __version__  # noqa: E402

project = "DLO perception"
author = "the DLO perception authors"
release = version = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["examples"]
html_theme = "furo"
html_title = f"DLO perception {release}"
nitpicky = False

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
myst_url_schemes = ["http", "https", "mailto"]

autodoc_typehints = "description"
autodoc_member_order = "bysource"
add_module_names = False
