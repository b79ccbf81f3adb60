"""Scripts for the queue server as templates: names of keys differ from deployment to deployment."""

from __future__ import annotations

from string import Template


class _Lua(Template):
    """``@name@``; braces and dollars are Lua's own."""

    delimiter = "@"
    pattern = r"@(?:(?P<escaped>@)|(?P<named>[a-z_]+)@|(?P<braced>\b\B)|(?P<invalid>\b\B))"  # type: ignore[assignment]


def filled(script: str, **names: str) -> str:
    """``script`` with every ``@name@`` replaced; KeyError for one that is not given."""
    return _Lua(script).substitute(names)
