"""``python -m services``: start everything; ``--help`` states how."""

from __future__ import annotations

import argparse
import logging
import os
import sys
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from services.settings import ServiceSettings
from services.standalone.serve import CannotServeError, serve
from workers import logs


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m services",
        description="Start the queue server, the workers and the HTTP service, until Ctrl-C. "
        "Whatever is not given here is read from the environment (DLO_*).",
    )
    parser.add_argument("--host", help="address to listen on; only loopback without API keys")
    parser.add_argument("--port", type=int, help="0 takes a free one")
    parser.add_argument("--workers", type=int, help="worker processes")
    parser.add_argument("--training-workers", type=int, help="worker processes that adapt networks")
    parser.add_argument("--data-dir", type=Path, help="pictures, results and the queue's data")
    parser.add_argument(
        "--then",
        nargs=argparse.REMAINDER,
        default=[],
        metavar="CMD",
        help="once ready run this command with DLO_URL set, then stop and exit with its code",
    )
    return parser.parse_args()


def main() -> int:
    """Exit code of the service, or of the command that it ran."""
    os.umask(0o077)  # pictures and results are nobody else's
    arguments = vars(_arguments())
    then: list[str] = arguments.pop("then")
    given: dict[str, Any] = {name: value for name, value in arguments.items() if value is not None}
    try:
        settings = ServiceSettings(**given)
        logs.configure(settings.log_level)
        logging.getLogger("uvicorn").setLevel(logging.WARNING)
        return serve(settings, then)
    except ValidationError as error:
        for problem in error.errors():
            print(
                f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}".lstrip(": "),
                file=sys.stderr,
            )
    except CannotServeError as error:
        print(error, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
