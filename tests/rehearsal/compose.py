"""What a compose file gives to the environment of a service."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import yaml

_VARIABLE = re.compile(r"\$\{(\w+)(?::([-?])([^}]*))?\}")


def environment(
    file: Path, service: str, values: Mapping[str, str], folder: Path
) -> dict[str, str]:
    """With ``values`` as the variables of ``.env``, and secrets in ``folder`` under the names that
    the file gives.

    Raises KeyError for a variable that has to be set.
    """
    text = yaml.safe_load(file.read_text())
    secrets = {f"/run/secrets/{name}": part["file"] for name, part in text["secrets"].items()}

    def value(match: re.Match[str]) -> str:
        name, how, default = match.groups()
        if how == "?" and not values.get(name):
            raise KeyError(f"{name}: {default}")
        return values.get(name) or (default if how == "-" else "")

    found = {}
    for name, given in text["services"][service]["environment"].items():
        if given is None and name not in values:
            continue  # passed on where it is set
        filled = _VARIABLE.sub(value, str(given)) if given is not None else values[name]
        if filled in secrets:
            filled = str(folder / Path(_VARIABLE.sub(value, secrets[filled])).name)
        found[name] = filled
    return found
