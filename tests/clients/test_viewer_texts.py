"""The pages' texts in English and German, their size, and what their styles promise to people who
see less."""

from __future__ import annotations

import ast
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import get_args

import pytest
from dlo_client.contracts import Reason
from dlo_client.contracts.submission import Queue

from services.page_frame import PAGES, document

VIEWER = Path(__file__).parents[2] / "services" / "viewer"
NAMED = {"placeholder", "title", "aria-label", "alt"}
SAME = {
    "API",
    "RT-DLO",
    "FASTDLO",
    "Ariadne+",
    "DLO3DS",
    "curl",
    "Python",
    "COCO",
    "1",
    "5",
    "10",
    "50",
    "id",
    "–",
    "◀",
    "▶",
    "×",
}
"""What is written the same in both languages."""
MOST_BYTES = 190_000
"""Of script that a page ships. German texts come on top, for who reads German alone."""
MOST_GERMAN_BYTES = 25_000


class Texts(HTMLParser):
    """All that a page says: its text, and the attributes that are read out."""

    def __init__(self) -> None:
        super().__init__()
        self.found: set[str] = set()
        self._silent = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._silent = tag in {"title", "kbd", "code", "script"}
        self.found |= {value for name, value in attrs if name in NAMED and value}

    def handle_endtag(self, tag: str) -> None:
        self._silent = False

    def handle_data(self, data: str) -> None:
        text = " ".join(data.split())
        if text and not self._silent:
            self.found.add(text)


def german() -> dict[str, str]:
    text = (VIEWER / "german.js").read_text()
    return json.loads(text.partition("GERMAN = ")[2].rstrip().rstrip(";"))


def texts_of(page: str) -> set[str]:
    parser = Texts()
    parser.feed(document(page))
    return parser.found - SAME


@pytest.mark.parametrize("page", PAGES)
def test_all_that_a_page_says_is_there_in_german(page: str) -> None:
    assert texts_of(page) - german().keys() == set()


def test_all_that_scripts_say_is_there_in_german() -> None:
    said = {
        text
        for script in VIEWER.glob("*.js")
        for text in re.findall(r'\bt\(\s*"((?:[^"\\]|\\.)*)"', script.read_text())
    }
    assert len(said) > 50
    assert said - SAME - german().keys() == set()


COMMENT = re.compile(r"^\s*//.*$|/\*\*[\s\S]*?\*/|\s//\s.*$", re.MULTILINE)
LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"|`([^`]*)`')
NO_SENTENCE = re.compile(r"[{};=#\[\]$()]|px|sans|rgb|viewer/|^\.|dlo-|DLO")


def sentences(script: Path) -> set[str]:
    """Literals of two words and more that are no code, style or selector."""
    found = {one or other for one, other in LITERAL.findall(COMMENT.sub("", script.read_text()))}
    plain = {text for text in found if not NO_SENTENCE.search(re.sub(r"\$?\{[^}]*\}", "", text))}
    return {
        text
        for text in plain
        if len(re.findall(r"[A-Za-z]{2,}", re.sub(r"\$?\{[^}]*\}", "", text))) > 1
    }


def test_no_script_has_a_sentence_of_its_own() -> None:
    """Problems of archives and of cameras came in English to everybody: they were not given to
    ``t``."""
    scripts = [script for script in VIEWER.glob("*.js") if script.name != "german.js"]
    assert "not opened yet" in sentences(VIEWER / "bench_lists.js")
    untold = {
        (script.name, text) for script in scripts for text in sentences(script) - german().keys()
    }
    assert {(name, text) for name, text in untold if " " in text.strip()} == set()


def test_every_reason_of_the_contract_has_words() -> None:
    """A reason that the page does not know is shown as its code."""
    _, _, rest = (VIEWER / "panels.js").read_text().partition("const REASONS = {")
    words = dict(re.findall(r'(\w+): "([^"]+)"', rest.partition("}")[0]))
    assert words.keys() == set(get_args(Reason))
    assert set(words.values()) <= german().keys()


def test_every_queue_is_named_in_german() -> None:
    """The operators' page said `interactive` and `training` in German, too."""
    assert set(get_args(Queue)) <= german().keys()


def codes_in(place: Path) -> set[str]:
    """Codes of the problems that a package answers with, as they are written in its calls."""
    found: set[str] = set()
    for file in place.rglob("*.py") if place.is_dir() else [place]:
        calls = [
            node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)
        ]
        for call in calls:
            name = getattr(call.func, "id", "")
            named = [
                one.value
                for one in call.keywords
                if one.arg == "code" and not name.startswith("Plan")
            ]
            at = {"ProblemError": 1, "_retry": 1, "InvalidInput": 2}.get(name)
            given = call.args[at : at + 1] if at else []
            found |= {one.value for one in [*named, *given] if isinstance(one, ast.Constant)}
    return found


def test_every_problem_has_a_title() -> None:
    """Titles came from the service, in English on a German page."""
    _, _, rest = (VIEWER / "problem_titles.js").read_text().partition("const TITLES = {")
    titles = dict(re.findall(r'(\w+): "([^"]+)"', rest.partition("}")[0]))
    root = VIEWER.parents[1]
    codes = codes_in(root / "services") | codes_in(root / "workers" / "problems.py")
    assert {"worker_lost", "queue_full", "invalid_image", "unknown_folder"} <= codes
    assert codes - titles.keys() == set()
    of_jobs = {
        code for code in codes_in(root / "workers" / "stages") if not code.startswith("invalid_")
    }
    assert {"name_taken", "size_mismatch"} <= of_jobs
    assert of_jobs - titles.keys() == set(), "any invalid_… has one title"
    assert {*titles.values(), "The input cannot be used"} - german().keys() == set()


def test_translations_keep_what_is_filled_in() -> None:
    for english, text in german().items():
        assert sorted(re.findall(r"\{\w+\}", english)) == sorted(re.findall(r"\{\w+\}", text)), (
            english
        )


def modules(start: Path) -> set[Path]:
    """A script and all that it imports."""
    found, waiting = set(), [start]
    while waiting:
        script = waiting.pop()
        if script not in found:
            found.add(script)
            waiting += [VIEWER / name for name in re.findall(r'"\./(\w+\.js)"', script.read_text())]
    return found


@pytest.mark.parametrize("page", PAGES)
def test_a_page_ships_little_script(page: str) -> None:
    first, entry = re.findall(r'src="viewer/(\w+\.js)"', document(page))
    texts = VIEWER / "german.js"
    scripts = {VIEWER / first, *modules(VIEWER / entry)}
    assert texts in scripts
    assert sum(script.stat().st_size for script in scripts - {texts}) < MOST_BYTES
    assert texts.stat().st_size < MOST_GERMAN_BYTES


def luminance(color: str) -> float:
    channels = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted([luminance(one), luminance(other)])
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_and_borders_stand_out(theme: str) -> None:
    """WCAG AA: 4.5 for text on every ground that it is written on, 3 for the borders of
    controls."""
    blocks = re.findall(r":root[^{]*\{([^}]*)\}", (VIEWER / "style.css").read_text())
    tokens = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", blocks[0]))
    if theme == "dark":
        tokens |= dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", blocks[1]))
    grounds = ["page", "card", "raised", "tint"]
    pairs = [(ink, ground) for ink in ("ink", "soft") for ground in grounds]
    pairs += [(ink, "card") for ink in ("accent", "good", "warn", "bad")]
    pairs += [
        ("on-accent", "accent"),
        ("ink", "warn-tint"),
        ("ink", "bad-tint"),
        ("bad", "bad-tint"),
        ("warn", "tint"),
    ]
    weak = {pair: contrast(*(tokens[name] for name in pair)) for pair in pairs}
    assert {pair: value for pair, value in weak.items() if value < 4.5} == {}
    assert min(contrast(tokens["edge"], tokens[ground]) for ground in ("card", "page")) >= 3
