"""Builds the library `dlo` from `models/`: `pip install .`

The sources import one another as `models.…`, which is too common a name to install. While the wheel
is built, the package is renamed: `models/library` becomes `dlo`, everything else below `models`
becomes `dlo._models`, and the import statements follow. Training and synthesis, which need torch or
draw pictures, are left out.
"""

import ast
import re
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.editable_wheel import editable_wheel

SOURCE = Path("models")
LEFT_OUT = {"training", "synthesis"}
DATA = {".onnx", ".toml"}
VERSION = Path("clients/python/dlo_client/version.py")
IMPORT = re.compile(r"^(\s*(?:from|import) )models(?=[.\s])", re.M)
LIBRARY = re.compile(r"^(\s*(?:from|import) )models\.library(?=[.\s])", re.M)


def version() -> str:
    """The one that the client has."""
    return re.search(r'^__version__ = "(.+)"$', VERSION.read_text(), re.M)[1]


def renamed(text: str, name: str) -> str:
    """The module's text with the installed names; nothing else in it may name the package."""
    text = IMPORT.sub(r"\1dlo._models", LIBRARY.sub(r"\1dlo", text))
    for node in ast.walk(ast.parse(text)):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        if any(n.split(".")[0] == "models" for n in names):
            raise SystemExit(
                f"{name}:{node.lineno} imports `models` in a way that setup.py does not rename"
            )
    return text


class BuildLibrary(build_py):
    """Writes `dlo` to the build folder."""

    def run(self) -> None:
        target = Path(self.build_lib) / "dlo"
        shutil.rmtree(target, ignore_errors=True)  # modules of an earlier build that are gone
        for path in sorted(SOURCE.rglob("*")):
            inner = path.relative_to(SOURCE)
            if inner.parts[0] in LEFT_OUT or path.suffix not in {".py", *DATA}:
                continue
            library = inner.parts[0] == "library"
            made = target.joinpath(*inner.parts[1:]) if library else target / "_models" / inner
            made.parent.mkdir(parents=True, exist_ok=True)
            data = path.read_bytes()
            made.write_bytes(
                renamed(data.decode(), str(path)).encode() if path.suffix == ".py" else data
            )
        (target / "py.typed").touch()


class NoEditable(editable_wheel):
    """In a clone the package is `models`; there is nothing to link."""

    def run(self) -> None:
        raise SystemExit(
            "dlo cannot be installed editable; in a clone use models.library from the clone's folder"
        )


setup(
    version=version(),
    packages=["dlo"],
    package_dir={"dlo": "models/library"},
    cmdclass={"build_py": BuildLibrary, "editable_wheel": NoEditable},
)
