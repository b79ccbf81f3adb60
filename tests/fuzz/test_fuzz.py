"""A few generated requests and pictures in each run, and all that ever broke; ``make fuzz`` tries
more."""

from __future__ import annotations

import json
import random
from collections import Counter

import pytest

from tests.fuzz.__main__ import PARTS, Run, kept, note
from tests.fuzz.bench import whole
from tests.fuzz.mutations import damaged_bytes

pytestmark = pytest.mark.slow

COUNTS = {"requests": 11, "damaged": 33, "pictures": 30}
"""Without ``schema``, which takes its time; tests/services/test_documents.py tries a few of its
cases."""


@pytest.fixture(scope="module")
def there(tmp_path_factory):
    with whole(tmp_path_factory.mktemp("fuzz")) as there:
        yield there


@pytest.mark.parametrize("part", COUNTS)
def test_whatever_is_sent_is_answered_or_refused_with_a_reason(there, tmp_path, part):
    run = Run(there, tmp_path)
    PARTS[part](run, COUNTS[part], 7)
    assert run.ended["broken"] == 0, [file.read_bytes()[:2000] for file in tmp_path.iterdir()]
    assert sum(run.ended.values()) >= COUNTS[part] // 2


@pytest.mark.parametrize("file", kept(), ids=lambda file: file.name)
def test_what_broke_once_does_not_again(there, file):
    (there.submit if file.suffix == ".json" else there.upload)(file.read_bytes())


def test_what_breaks_is_kept(there, tmp_path):
    def broken(_: bytes) -> str:
        raise AssertionError("internal")

    run = Run(there, tmp_path)
    for body in (b"first", b"second"):
        run.try_one(body, broken, "json")
    assert run.ended["broken"] == 2
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"first"], "of each kind one"


def test_the_same_numbers_give_the_same_damage():
    first, second = (damaged_bytes(bytes(range(256)), random.Random(3), b"other") for _ in range(2))
    assert first == second != bytes(range(256))


def test_counts_of_several_seeds_add_up(tmp_path):
    out = tmp_path / "fuzz.json"
    for start in (3, 1, 3):
        note(out, "pictures", start, Counter({"succeeded": 5, "broken": 1}), add=True)
    assert json.loads(out.read_text()) == {
        "parts": {"pictures": {"succeeded": 15, "broken": 3}},
        "seeds": [1, 3],
    }
    note(out, "pictures", 9, Counter(succeeded=2), add=False)
    assert json.loads(out.read_text()) == {"parts": {"pictures": {"succeeded": 2}}, "seeds": [9]}
