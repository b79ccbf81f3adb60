"""One version everywhere, and packages that install as the README tells."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import dlo_client
import pytest

ROOT = Path(__file__).parent.parent
CLIENT = ROOT / "clients" / "python"

# Modules that neither the library nor what it imports may need.
USE = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name in ("torch", "fastapi", "redis", "rq", "pydantic", "models", "dlo_client"):
            raise ModuleNotFoundError(f"{name} is not installed")

sys.meta_path.insert(0, Absent())
sys.path.insert(0, sys.argv[1])
import numpy as np
import dlo

assert dlo.__file__.startswith(sys.argv[1]), dlo.__file__
picture = np.zeros((120, 160, 3), np.uint8)
picture[55:65] = 200
picture[:, 75:85] = (90, 90, 200)
scene = dlo.instances(picture, picture.any(axis=2))
print(dlo.__version__, len(scene.instances), len(scene.crossings), dlo.segment(picture).probability.shape)
"""


def run(*arguments: str, cwd: Path = ROOT) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_changelog_begins_with_the_version():
    released = re.findall(
        r"^## \[(\d\S*)\] - \d{4}-\d\d-\d\d$", (ROOT / "CHANGELOG.md").read_text(), re.M
    )
    assert released[0] == dlo_client.__version__
    assert len(set(released)) == len(released)


def test_a_tagged_commit_has_the_tag_of_its_version():
    tags = subprocess.run(
        ["git", "tag", "--points-at", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.split()
    versions = [tag for tag in tags if re.fullmatch(r"v\d.*", tag)]
    assert versions in ([], [f"v{dlo_client.__version__}"])


@pytest.mark.slow
def test_the_library_installs_and_works_elsewhere(tmp_path):
    """Built from a copy of the sources, so that tests at the same time do not share a build
    folder."""
    clone = tmp_path / "clone"
    names = ["pyproject.toml", "setup.py", "README.md", "LICENSE", "NOTICE", "models", "clients"]
    clone.mkdir()
    for name in names:
        (clone / name).symlink_to(ROOT / name)
    target = tmp_path / "site"
    pip = [
        "-m",
        "pip",
        "--disable-pip-version-check",
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
    ]
    run(*pip, "--no-build-isolation", "--no-compile", "--target", str(target), ".", cwd=clone)
    assert sorted(p.name for p in target.iterdir() if p.suffix != ".dist-info") == ["dlo"]
    assert not list(target.rglob("training")) + list(target.rglob("synthesis"))
    assert (target / "dlo" / "py.typed").exists()
    said = run("-c", USE, str(target), cwd=tmp_path)
    assert said.split() == [dlo_client.__version__, "2", "1", "(120,", "160)"]


@pytest.mark.slow
def test_no_import_of_the_sources_is_missed_by_the_renaming():
    """What setup.py cannot rename ends the build; here without building."""
    program = (
        "import sys, setuptools; setuptools.setup = lambda **k: None; import setup\n"
        "for path in setup.SOURCE.rglob('*.py'):\n"
        "    inner = path.relative_to(setup.SOURCE)\n"
        "    inner.parts[0] in setup.LEFT_OUT or setup.renamed(path.read_text(), str(path))\n"
        "print(setup.version())"
    )
    assert run("-c", program).strip() == dlo_client.__version__


def test_the_documented_command_installs_extras_that_exist():
    """The README named a package of the index, and there was none."""
    project = tomllib.loads((CLIENT / "pyproject.toml").read_text())["project"]
    pages = [ROOT / "README.md", CLIENT / "README.md", *(ROOT / "docs").rglob("*.md")]
    named = [
        m for page in pages for m in re.findall(r"pip install \"?(\S+?)\[(.+?)\]", page.read_text())
    ]
    assert named
    for place, extras in named:
        assert (ROOT / place).resolve() == CLIENT, f"{place} is not the client's folder"
        assert set(extras.split(",")) <= set(project["optional-dependencies"])


@pytest.mark.parametrize("folder", [ROOT, CLIENT])
def test_metadata_is_complete(folder):
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    assert project["dynamic"] == ["version"]
    assert {"description", "readme", "license", "license-files", "classifiers", "keywords"} <= set(
        project
    )
    assert (folder / project["readme"]).exists()
    assert all((folder / name).exists() for name in project["license-files"])
