"""The ``dlo`` command's door. Its commands need typer and rich, which are an extra of this
package."""

from __future__ import annotations

import sys

_MISSING = """The dlo command needs its extra: pip install "dlo-client[cli]"
(not found: {name})"""


def main() -> None:
    try:
        from dlo_client.commands import (  # noqa: F401  they register their commands
            adapt_commands,
            bridge_commands,
            calibration_commands,
            harness_commands,
            label_studio_commands,
            labelling_commands,
            network_commands,
            recipe_commands,
            reconstruction_commands,
            record_commands,
            review_commands,
            shape_commands,
            tracking_commands,
        )
        from dlo_client.commands.app import app
    except ModuleNotFoundError as error:
        if error.name not in ("typer", "rich", "PIL"):
            raise
        sys.exit(_MISSING.format(name=error.name))
    app()
