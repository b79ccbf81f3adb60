"""Labelling many pictures against a stand-in for the service: nothing is lost, nothing is done
twice."""

from __future__ import annotations

import errno
import json
import os
import sqlite3
import zipfile
from collections import Counter
from pathlib import Path

import httpx
import pytest
from dlo_client.contracts import JobState
from dlo_client.labelling import (
    BatchStopped,
    LabelOptions,
    LabelStore,
    SourceError,
    StoreError,
    find_pictures,
    label_pictures,
    store,
)
from dlo_client.labelling import report as report_of_run
from dlo_client.labelling.sources import PictureUnreadable, read_still
from dlo_client.retry import RetryPolicy

from tests.clients import samples

NAMES = ["a.png", "b c.jpg", "näh/ü 3.png", "näh/d.tif"]
AT_ONCE = RetryPolicy(attempts=2, first_pause_s=0.0)


class Service:
    """Counts what it is asked for; a picture's bytes say how its job ends."""

    def __init__(self) -> None:
        self.asked: Counter[bytes] = Counter()
        self.jobs: dict[str, bytes] = {}
        self.requests: list[dict[str, object]] = []
        self.down_after: int | None = None

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if self.down_after is not None and len(self.jobs) >= self.down_after:
            raise httpx.ConnectError("down", request=request)
        parts = request.content.split(b"\r\n\r\n")
        self.requests.append(json.loads(parts[1].split(b"\r\n--")[0]))
        picture = parts[2].split(b"\r\n--")[0]
        if self.jobs.setdefault(request.headers["Idempotency-Key"], picture) == picture:
            self.asked[picture] += 1
        if picture.startswith(b"refused"):
            return _problem(422)
        if picture.startswith(b"broken"):
            job = samples.failed(samples.refused(422, "invalid_image"))
        elif picture.startswith(b"flaky") and self.asked[picture] < 3:
            job = samples.failed(samples.refused(500, "internal"))
        elif picture.startswith(b"cancelled"):
            job = samples.job(JobState.CANCELLED, kind="instances")
        else:
            job = samples.instances_job()
        return httpx.Response(200, text=job.model_dump_json())


def _problem(status: int) -> httpx.Response:
    return httpx.Response(status, text=samples.refused(status, "invalid_image").model_dump_json())


@pytest.fixture
def service() -> Service:
    return Service()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return fill(tmp_path / "my pictures", {name: f"picture {name}".encode() for name in NAMES})


def fill(folder: Path, contents: dict[str, bytes]) -> Path:
    for name, content in contents.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def run(service: Service, source: object, out: Path, **options: object):
    chosen = LabelOptions(pause_s=0.0, retry=AT_ONCE, **options)
    transport = httpx.MockTransport(service)
    return label_pictures(
        find_pictures(source, skip=out), out, chosen, url="http://service", transport=transport
    )


def test_every_picture_gets_its_label_at_batch_priority(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    report = run(service, folder, tmp_path / "out")
    assert (report.pictures, report.labelled, report.already, report.missing) == (4, 4, 0, 0)
    assert {r["priority"] for r in service.requests} == {"batch"}
    with LabelStore(tmp_path / "out") as kept:
        assert sorted(label.name for label in kept.labels()) == sorted(NAMES)
        assert (
            kept.label("näh/ü 3.png").instances[0].mask_rle
            == samples.two_cables().instances[0].mask_rle
        )
    assert json.loads((tmp_path / "out" / "report.json").read_text())["labelled"] == 4


def test_a_second_run_asks_for_nothing(service: Service, folder: Path, tmp_path: Path) -> None:
    run(service, folder, tmp_path / "out")
    report = run(service, folder, tmp_path / "out")
    assert (report.labelled, report.already) == (0, 4)
    assert set(service.asked.values()) == {1}


def test_output_inside_the_source_is_not_taken_for_pictures(service: Service, folder: Path) -> None:
    run(service, folder, folder / "out")
    fill(folder / "out", {"masks/a.png": b"mask"})
    assert run(service, folder, folder / "out").pictures == 4


def test_the_same_bytes_are_labelled_once(service: Service, folder: Path, tmp_path: Path) -> None:
    fill(folder, {f"copy {k}.png": b"picture a.png" for k in range(5)})
    report = run(service, folder, tmp_path / "out")
    assert (report.labelled, len(report.duplicates)) == (9, 5)
    assert service.asked[b"picture a.png"] == 1
    with LabelStore(tmp_path / "out") as kept:
        assert kept.label("copy 3.png").name == "copy 3.png"


def test_what_fails_is_named_and_nothing_else_is_lost(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    fill(
        folder, {"x.png": b"refused", "y.png": b"broken", "z.png": b"cancelled", "f.png": b"flaky"}
    )
    (folder / "link.png").symlink_to(folder / "nowhere")
    report = run(service, folder, tmp_path / "out")
    assert sorted(report.failed) == ["link.png", "x.png", "y.png", "z.png"]
    assert "No such file" in report.failed["link.png"]
    assert report.labelled == 5
    assert (service.asked[b"refused"], service.asked[b"broken"], service.asked[b"flaky"]) == (
        1,
        1,
        3,
    )
    assert run(service, folder, tmp_path / "out").failed.keys() == report.failed.keys()
    assert service.asked[b"broken"] == 1, "what was refused is not asked again"
    run(service, folder, tmp_path / "out", retry_failed=True)
    assert service.asked[b"broken"] == 2


def test_a_service_that_goes_away_stops_the_run_and_the_next_one_goes_on(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    service.down_after = 2
    with pytest.raises(BatchStopped, match="cannot reach") as stopped:
        run(service, folder, tmp_path / "out", at_once=1)
    assert (stopped.value.report.labelled, stopped.value.report.missing) == (2, 2)
    assert stopped.value.report.failed == {}
    service.down_after = None
    report = run(service, folder, tmp_path / "out")
    assert (report.labelled, report.already) == (2, 2)
    assert set(service.asked.values()) == {1}


def test_a_file_that_changed_since_is_labelled_again(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    run(service, folder, tmp_path / "out")
    (folder / "a.png").write_bytes(b"another picture")
    report = run(service, folder, tmp_path / "out")
    assert (report.labelled, report.already) == (1, 3)


def test_a_file_that_changes_after_it_was_read_is_named(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    class Meddling(Service):
        def __call__(self, request: httpx.Request) -> httpx.Response:
            (folder / "a.png").write_bytes(b"other and longer bytes")
            return super().__call__(request)

    assert run(Meddling(), folder, tmp_path / "out", at_once=1).changed == ["a.png"]


def test_a_file_that_never_holds_still_is_refused(folder: Path) -> None:
    picture = find_pictures(folder)[0]
    stamps = iter(range(100))
    with pytest.raises(PictureUnreadable, match="changes"):
        read_still(type(picture)(picture.name, picture.read, lambda: str(next(stamps))))


def test_a_full_disk_stops_the_run_and_keeps_what_is_there(
    service: Service, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = store.write_whole

    def full(file: Path, content: bytes) -> None:
        if file.name.startswith("b c"):
            raise OSError(errno.ENOSPC, "No space left on device")
        whole(file, content)

    monkeypatch.setattr(store, "write_whole", full)
    with pytest.raises(BatchStopped, match="No space left") as stopped:
        run(service, folder, tmp_path / "out", at_once=1)
    assert stopped.value.report.labelled == 1
    monkeypatch.setattr(store, "write_whole", whole)
    assert run(service, folder, tmp_path / "out").labelled == 3
    assert set(service.asked.values()) == {1} | (
        {2} if service.asked[b"picture b c.jpg"] == 2 else set()
    )


def test_a_ledger_that_takes_nothing_more_stops_the_run(
    service: Service, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite itself finds the disk full: its file may not grow."""
    connect = sqlite3.connect

    def tight(*arguments: object, **more: object) -> sqlite3.Connection:
        ledger = connect(*arguments, **more)
        ledger.execute("PRAGMA max_page_count = 6")
        return ledger

    fill(folder, {f"{'long name ' * 15}{k}.png": str(k).encode() for k in range(60)})
    monkeypatch.setattr(store.sqlite3, "connect", tight)
    with pytest.raises(BatchStopped, match="full") as stopped:
        run(service, folder, tmp_path / "out", at_once=1)
    assert 0 < stopped.value.report.labelled < 60
    monkeypatch.undo()
    report = run(service, folder, tmp_path / "out")
    assert report.labelled + report.already == 64
    assert report.already == stopped.value.report.labelled, "what was noted is not lost"


def test_a_report_that_does_not_fit_stops_the_run_and_is_told(
    service: Service, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(file: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(report_of_run, "write_whole", full)
    with pytest.raises(BatchStopped, match="report cannot be written: No space left") as stopped:
        run(service, folder, tmp_path / "out")
    assert stopped.value.report.labelled == 4


def forbid(path: Path, mode: int, way: int) -> None:
    """Take rights away; the test is skipped for somebody whom that does not stop, such as root."""
    path.chmod(mode)
    if os.access(path, way):
        pytest.skip("whoever runs this may do everything")


def test_a_read_only_output_is_refused_before_anything_is_asked(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "out").mkdir()
    forbid(tmp_path / "out", 0o555, os.W_OK)
    with pytest.raises(StoreError, match="cannot be written: Permission denied"):
        run(service, folder, tmp_path / "out")
    assert service.requests == []


def test_a_picture_that_may_not_be_read_is_named(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    forbid(folder / "a.png", 0, os.R_OK)
    report = run(service, folder, tmp_path / "out")
    assert report.failed == {"a.png": "cannot be read: Permission denied"}
    assert report.labelled == 3


def test_a_damaged_ledger_is_told_and_not_written_over(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    fill(tmp_path / "out", {store.LEDGER: b"this is no database " * 100})
    with pytest.raises(StoreError, match="not a database"):
        run(service, folder, tmp_path / "out")
    with LabelStore(tmp_path / "out") as kept, pytest.raises(StoreError, match="not a database"):
        kept.entries()
    assert (tmp_path / "out" / store.LEDGER).read_bytes().startswith(b"this is no database")


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_asked(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be written"):
        run(service, folder, tmp_path / "file" / "out")
    assert service.requests == []


def test_two_runs_do_not_share_a_folder(folder: Path, tmp_path: Path) -> None:
    with LabelStore(tmp_path / "out", write=True), pytest.raises(StoreError, match="another run"):
        LabelStore(tmp_path / "out", write=True)


def test_labels_made_in_another_way_are_not_mixed(
    service: Service, folder: Path, tmp_path: Path
) -> None:
    run(service, folder, tmp_path / "out")
    request = LabelOptions().request.model_copy(update={"threshold": 0.3})
    with pytest.raises(StoreError, match="take another folder"):
        run(service, folder, tmp_path / "out", request=request)


def test_the_least_certain_come_first(service: Service, folder: Path, tmp_path: Path) -> None:
    report = run(service, folder, tmp_path / "out")
    name, certainty, why = report.uncertain[0]
    assert certainty == samples.two_cables().crossings[0].score
    assert "crossing 1" in why
    assert f"  {name}: {why}" in report.lines()


def test_sources_of_every_kind_give_the_same_names(folder: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        for name in NAMES:
            archive.write(folder / name, name)
    (folder / "list.txt").write_text("# mine\n" + "\n".join([*NAMES, "missing.png", ""]))
    assert [p.name for p in find_pictures(tmp_path / "all.zip")] == NAMES
    assert sorted(p.name for p in find_pictures(f"{folder}/**/*.*")) == sorted(NAMES)
    listed = find_pictures(folder / "list.txt")
    assert [p.name for p in listed] == [*NAMES, "missing.png"]
    with pytest.raises(PictureUnreadable, match="No such file"):
        read_still(listed[-1])
    for picture in find_pictures(tmp_path / "all.zip"):
        assert read_still(picture)[0] == f"picture {picture.name}".encode()


def test_names_stay_in_their_folder_and_apart(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as archive:
        for name in ("../../etc/a.png", "/etc/a.png", "A.png", "a.png", f"{'x' * 300}.png"):
            archive.writestr(name, name)
    names = [p.name for p in find_pictures(tmp_path / "evil.zip")]
    assert names[:4] == ["etc/a.png", "etc/a-2.png", "A.png", "a-2.png"]
    assert len(names[4].encode()) < 200


def test_a_name_that_is_no_text_is_kept_apart_and_read(service: Service, tmp_path: Path) -> None:
    raw = tmp_path / "raw"
    raw.mkdir()
    (raw / b"caf\xe9.png".decode("utf-8", "surrogateescape")).write_bytes(b"picture")
    assert run(service, raw, tmp_path / "out").labelled == 1
    with LabelStore(tmp_path / "out") as kept:
        assert list(kept.entries()) == ["caf\\xe9.png"]


@pytest.mark.parametrize("wrong", ["nowhere", "*.nothing", "."])
def test_a_source_without_pictures_is_refused(
    tmp_path: Path, wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SourceError):
        find_pictures(wrong)


@pytest.mark.slow
def test_a_run_over_twenty_thousand_files_goes_on_where_it_was(
    service: Service, tmp_path: Path
) -> None:
    """The ledger holds all but three of the list's pictures: those three are asked for, and nothing
    else is."""
    fill(tmp_path / "in", {f"new {k}.png": str(k).encode() for k in range(3)})
    known = [f"shelf {k // 1000}/{k}.png" for k in range(20_000)]
    listed = tmp_path / "in" / "list.txt"
    listed.write_text(
        "\n".join([*known[:10_000], "new 0.png", "new 1.png", *known[10_000:], "new 2.png"])
    )
    with LabelStore(tmp_path / "out", write=True) as kept:
        rows = ((name, "failed", "", "", "cannot be read", 0.0, 0.0) for name in known)
        kept._ledger.executemany("INSERT INTO pictures VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
        kept._ledger.commit()
    report = run(service, listed, tmp_path / "out")
    assert (report.pictures, report.labelled, len(report.failed)) == (20_003, 3, 20_000)
    assert sorted(service.asked) == [b"0", b"1", b"2"]
    assert len(report.lines()) < 50, "a person is shown the first ones"
    assert len(json.loads((tmp_path / "out" / "report.json").read_text())["failed"]) == 20_000


@pytest.mark.slow
def test_a_list_that_names_one_picture_again_and_again_is_read_through(tmp_path: Path) -> None:
    """It took as many steps as the square of the lines: a hundred thousand were never done."""
    fill(tmp_path, {"a.png": b"picture"})
    (tmp_path / "list.txt").write_text("a.png\n" * 100_000 + "a-7.png\n")
    names = [p.name for p in find_pictures(tmp_path / "list.txt")]
    assert names[:3] == ["a.png", "a-2.png", "a-3.png"]
    assert names[-2:] == ["a-100000.png", "a-7-2.png"]
    assert len(set(names)) == len(names)
