"""The log of a training: JSON lines on the screen and in a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


class Log:
    """``file``: lines are added to it; None: they are only printed."""

    def __init__(self, file: Path | None = None) -> None:
        self.file = file

    def __call__(self, **fields: Any) -> None:
        """Numbers with a fraction are rounded to four digits after the point."""
        line = json.dumps(
            {k: round(v, 4) if isinstance(v, float) else v for k, v in fields.items()}
        )
        print(line, flush=True)
        if self.file is not None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with self.file.open("a") as lines:
                lines.write(line + "\n")
