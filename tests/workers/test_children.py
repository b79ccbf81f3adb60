"""The next child is warm before the old one goes."""

import pytest

from workers import children as children_module
from workers.child_process import ChildDied
from workers.children import Children


class Child:
    """Warm once it has been asked ``asked`` times; never a process."""

    made: list["Child"] = []
    asked = 1
    deaths = 0
    """How many of the next calls of :meth:`warm` find that it was killed."""

    def __init__(self, settings) -> None:
        self.alive = self.ready = self.worn = self.spent = self.dies = False
        self.left = self.asked
        self.made.append(self)

    def begin(self) -> None:
        self.alive = True

    def warm(self, wait_s: float = 0.0) -> bool:
        if Child.deaths:
            Child.deaths -= 1
            self.alive = False
        if self.dies or not self.alive:
            raise ChildDied("unlucky")
        self.left -= 1
        self.ready = self.left <= 0
        return self.ready

    def kill(self) -> None:
        self.alive = self.ready = False


@pytest.fixture
def turns():
    return []


@pytest.fixture
def children(settings, monkeypatch, turns):
    monkeypatch.setattr(children_module, "ChildProcess", Child)
    monkeypatch.setattr(Child, "made", [])
    monkeypatch.setattr(Child, "asked", 3)
    monkeypatch.setattr(Child, "deaths", 0)
    return Children(settings.model_copy(update={"spare_child": True}), lambda: turns.append(1))


@pytest.fixture
def pair(children):
    """Both warm."""
    children.ready()
    for _ in range(4):
        children.tend()
    return children


def test_while_a_child_is_waited_for_it_takes_turns(children, turns):
    children.ready()
    assert children.current.ready
    assert len(turns) == 2


def test_a_child_that_was_killed_is_followed_without_a_wait(pair, turns):
    """Every cancel stopped the worker for the 6 to 13 seconds that loading the networks takes."""
    first, second = Child.made
    del turns[:]
    first.kill()
    pair.ready()
    assert pair.current is second
    assert turns == []
    pair.tend()
    assert Child.made[2].alive


def test_a_child_that_is_killed_while_it_warms_up_is_started_again(children, monkeypatch):
    """It ended the worker: whoever supervises it had to start the whole process again."""
    monkeypatch.setattr(Child, "deaths", 1)
    children.ready()
    assert children.current.ready


def test_a_child_that_cannot_load_ends_the_worker(children, monkeypatch):
    monkeypatch.setattr(Child, "deaths", 100)
    with pytest.raises(ChildDied):
        children.ready()


def test_a_worn_child_goes_on_until_the_next_is_warm(children):
    children.ready()
    first = children.current
    first.worn = True
    children.tend()
    assert (children.current, first.alive) == (first, True)
    for _ in range(3):
        children.tend()
    assert children.current is Child.made[1]
    assert children.current.ready
    assert not first.alive


def test_a_child_without_memory_does_not_go_on_until_the_next_is_warm(children):
    """Jobs that leaked faster than a child loads: those of others failed as too large meanwhile."""
    children.ready()
    first = children.current
    first.worn = first.spent = True
    children.tend()
    assert not first.alive
    children.ready()
    assert children.current.ready
    assert children.current is not first


def test_a_next_child_that_dies_is_started_again(pair):
    pair.tend()
    second = Child.made[1]
    second.dies = True
    pair.tend()
    assert not second.alive
    pair.tend()
    assert Child.made[2].alive
    assert pair.current is Child.made[0]


def test_without_a_next_child_a_worn_one_is_replaced_all_the_same(children, settings):
    children._settings = settings
    children.ready()
    children.current.worn = True
    children.tend()
    assert not children.current.alive
    children.ready()
    assert children.current.ready


def test_the_next_child_does_a_job_while_the_current_one_is_at_work(pair):
    second = Child.made[1]
    assert pair.standby() is second
    second.alive = False  # killed by the system meanwhile
    assert pair.standby() is None
    assert pair.current is Child.made[0]


@pytest.mark.parametrize("why", ["worn", "spent"])
def test_a_next_child_that_has_done_enough_such_jobs_is_replaced(pair, why):
    """Nobody else looks at it while the current one is at work, which may be for an hour."""
    second = Child.made[1]
    setattr(second, why, True)
    assert pair.standby() is None
    assert not second.alive
    for _ in range(3):
        found = pair.standby()
    assert found is Child.made[2]


def test_without_a_next_child_nobody_does(children, settings):
    children._settings = settings
    children.ready()
    assert children.standby() is None
    assert len(Child.made) == 1


def test_the_end_of_the_worker_ends_both(pair):
    pair.kill()
    assert not any(child.alive for child in Child.made)
