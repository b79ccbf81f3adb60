"""Train, measure and export a network by its name: ``python -m models.training NAME [--help]``."""

from __future__ import annotations

import sys

from models.training.command import command
from models.training.families import FAMILIES


def main(arguments: list[str]) -> int:
    """The exit status."""
    if not arguments or arguments[0] not in FAMILIES:
        print(
            f"usage: python -m models.training NAME …, where NAME is one of: {', '.join(FAMILIES)}",
            file=sys.stderr,
        )
        return 2
    command(FAMILIES[arguments[0]], arguments[1:])
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
