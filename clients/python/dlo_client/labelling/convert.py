"""Labels of our own format as those of another tool: ``python -m dlo_client.labelling.convert cvat
labels.jsonl OUT``.

The service runs it as a process of its own, so that pixels are never drawn where requests are
answered. Needs the extra ``dlo-client[label]``; ends with status 3 where it is not installed, with
1 and a reason for what cannot be written.
"""

from __future__ import annotations

import sys
from pathlib import Path

NOT_INSTALLED = 3


def main(name: str, source: Path, out: Path) -> int:
    """The exit status; the files are in ``out``."""
    try:
        from dlo_client.labelling.formats import READERS, WRITERS, FormatError
    except ImportError as error:
        print(f"formats need dlo-client[label]: {error.name} is not installed", file=sys.stderr)
        return NOT_INSTALLED
    try:
        imported = READERS["json"](source)
        if imported.problems:
            raise FormatError(
                "; ".join(f"{name}: {why}" for name, why in list(imported.problems.items())[:3])
            )
        WRITERS[name](lambda: iter(imported.labels), out)
    except (FormatError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])))
