"""Many inputs: each is read once, and what comes out does not depend on who reads it when."""

from __future__ import annotations

import os
import shutil
import socket
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from mcap_files import demonstration, write
from test_column_file import assert_same

from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage import gathering, inputs, read_cache
from rebt_ros.storage.gathering import time_left
from rebt_ros.storage.input_options import Aside, InputKind, InputOptions, ReadingPlan, Source
from rebt_ros.storage.inputs import Loaded, load
from rebt_ros.storage.read import Read
from rebt_ros.storage.read_cache import default_cache
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.workers import WorkerError

COUNT = 6


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """Bags, the fourth of which is broken."""
    directory = tmp_path / "fleet"
    for number in range(COUNT):
        bag = directory / f"run_{number}"
        bag.mkdir(parents=True)
        write(bag / "run_0.mcap", demonstration(10 + number))
    (directory / "run_3" / "run_0.mcap").write_bytes(b"no bag at all" * 9)
    return directory


@pytest.fixture
def readings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the inputs that are read in this process."""
    names: list[str] = []

    def read(source: Source, options: InputOptions) -> Read:
        names.append(source.path.name)
        return inputs._read_source(source, options)

    monkeypatch.setattr(inputs, "_READING", gathering.Reading(read, inputs._deciding_options))
    return names


def loaded(fleet: Path, **plan: object) -> Loaded:
    """All bags of a fleet."""
    told: list[tuple[Aside, ...]] = []
    options = InputOptions(plan=ReadingPlan(strict=False, tell=told.append, **plan))  # type: ignore[arg-type]
    found = load([fleet], options)
    assert told == [found.aside]
    return found


def assert_equal(one: Loaded, other: Loaded) -> None:
    """All that was read is the same, to the bit."""
    assert (one.notes, one.accounts, one.aside) == (other.notes, other.accounts, other.aside)
    for mine, its in zip(one.demonstrations, other.demonstrations, strict=True):
        assert_same(Read(mine), Read(its))


def test_a_broken_input_is_set_aside_with_its_reason(fleet: Path) -> None:
    found = loaded(fleet)
    assert [one.name for one in found.demonstrations] == [
        f"run_{number}" for number in range(COUNT) if number != 3
    ]
    (aside,) = found.aside
    assert aside.path == fleet / "run_3"
    assert "is damaged or not a bag" in aside.reason


def test_a_broken_input_is_an_error_where_it_is_asked_for_or_nothing_else_is_read(
    fleet: Path,
) -> None:
    with pytest.raises(InputError, match="run_3 is damaged"):
        load([fleet])
    alone = InputOptions(plan=ReadingPlan(strict=False))
    with pytest.raises(InputError, match=r"^[^;]*run_3 is damaged"):
        load([fleet / "run_3"], alone)
    shutil.copytree(fleet / "run_3", fleet / "run_9")
    with pytest.raises(InputError, match=r"none of 2 .*; the first: .*run_3"):
        load([fleet / "run_3", fleet / "run_9"], alone)


def test_a_strange_file_is_set_aside_like_a_broken_one(fleet: Path) -> None:
    strange = fleet / "strange.bag"
    strange.write_bytes(b"#ROSBAG V2.0\n\xff")
    options = InputOptions(plan=ReadingPlan(strict=False))
    found = load([strange, fleet / "run_1"], options)
    assert [aside.path for aside in found.aside] == [strange]
    with pytest.raises(InputError, match="rosbags-convert"):
        load([strange, fleet / "run_1"])


def test_what_is_not_there_is_never_set_aside(fleet: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        load([fleet / "nothing", fleet / "run_1"], InputOptions(plan=ReadingPlan(strict=False)))


def test_options_that_make_no_sense_are_never_set_aside(fleet: Path) -> None:
    plan = ReadingPlan(strict=False)
    topics = (StateTopic("/state"), StateTopic("/state"))
    with pytest.raises(OptionError):
        load([fleet], InputOptions(state_topics=topics, plan=plan))


def test_an_input_is_read_once(fleet: Path, tmp_path: Path, readings: list[str]) -> None:
    cache = tmp_path / "cache"
    first = loaded(fleet, cache=cache)
    assert len(readings) == COUNT
    readings.clear()
    assert_equal(loaded(fleet, cache=cache), first)
    # Why one cannot be read may not last.
    assert readings == ["run_3"]
    assert_equal(loaded(fleet), first)


def test_what_decides_about_rows_is_asked_once_for_all_inputs_of_a_kind(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    def deciding(kind: InputKind, options: InputOptions) -> tuple[object, ...]:
        asked.append(kind)
        return inputs._deciding_options(kind, options)

    reading = gathering.Reading(inputs._read_source, deciding)
    monkeypatch.setattr(inputs, "_READING", reading)
    loaded(fleet, cache=tmp_path / "cache")
    assert asked == [InputKind.BAG]


def test_the_state_of_a_directory_is_that_of_its_files_in_their_order(fleet: Path) -> None:
    bag = fleet / "run_0"
    for name in ("b", "B", "a.txt", "run_0.mcap-", "ä", "run_0"):
        (bag / name).write_text(name)
    (bag / "link").symlink_to(bag / "a.txt")
    (bag / "nowhere").symlink_to(bag / "none")
    found = read_cache.state_of(Source(bag, InputKind.BAG))
    assert [one.name for one in found] == [file.name for file in sorted(bag.iterdir())]
    assert [one.number for one in found] == [file.lstat().st_ino for file in sorted(bag.iterdir())]
    assert {one.name for one in found if not one.is_plain} == {"link", "nowhere"}


def test_only_what_is_new_or_different_is_read_again(
    fleet: Path, tmp_path: Path, readings: list[str]
) -> None:
    cache = tmp_path / "cache"
    shutil.rmtree(fleet / "run_3")
    options = InputOptions(plan=ReadingPlan(cache=cache))
    load([fleet], options)
    readings.clear()
    # Times say nothing, content does; so do names, of which notes and reports speak.
    os.utime(fleet / "run_0" / "run_0.mcap", (1, 1))
    write(fleet / "run_1" / "run_0.mcap", demonstration(50))
    (fleet / "run_2").rename(fleet / "run_8")
    shutil.move(fleet, tmp_path / "moved")
    found = load([tmp_path / "moved"], options)
    assert readings == ["run_1", "run_8"]
    assert [len(one) for one in found.demonstrations] == [10, 50, 14, 15, 12]
    readings.clear()
    load([tmp_path / "moved"], InputOptions(sample_rate=1e6, plan=options.plan))
    assert len(readings) == COUNT - 1


@pytest.fixture
def hashed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the inputs whose content is read for their keys, also of those written just now."""
    names: list[str] = []
    by_content = read_cache.key_of

    def key_of(source: Source, deciding: tuple[object, ...]) -> str:
        names.append(source.path.name)
        return by_content(source, deciding)

    monkeypatch.setattr(read_cache, "key_of", key_of)
    monkeypatch.setattr(read_cache, "_SETTLED", -(1 << 62))
    return names


def test_the_content_of_what_nobody_touched_is_not_read_again(
    fleet: Path, tmp_path: Path, readings: list[str], hashed: list[str]
) -> None:
    cache = tmp_path / "cache"
    first = loaded(fleet, cache=cache)
    assert len(hashed) == COUNT
    hashed.clear()
    readings.clear()
    assert_equal(loaded(fleet, cache=cache), first)
    assert (hashed, readings) == ([], ["run_3"])
    # Of other options, other keys.
    load([fleet / "run_1"], InputOptions(sample_rate=1e6, plan=ReadingPlan(cache=cache)))
    assert hashed == ["run_1"]


def test_content_that_was_changed_under_the_same_size_and_time_is_read_again(
    fleet: Path, tmp_path: Path, readings: list[str], hashed: list[str]
) -> None:
    cache = tmp_path / "cache"
    loaded(fleet, cache=cache)
    file = fleet / "run_1" / "run_0.mcap"
    status, shown = file.stat(), demonstration(11)
    # What was done in the first two states, the other way round.
    first, second = shown[1], shown[3]
    shown[1], shown[3] = replace(first, data=second.data), replace(second, data=first.data)
    write(file, shown)
    assert file.stat().st_size == status.st_size
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
    readings.clear()
    hashed.clear()
    found = loaded(fleet, cache=cache)
    assert (hashed, readings) == (["run_1"], ["run_1", "run_3"])
    assert found.demonstrations[1].chosen[:2].tolist() == [1, 0]


def test_what_was_written_just_now_is_not_taken_for_known(fleet: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    late = (time.time() + 3600) * 1e9
    os.utime(fleet / "run_1" / "run_0.mcap", ns=(int(late), int(late)))
    load([fleet / "run_1"], InputOptions(plan=ReadingPlan(cache=cache)))
    assert not (cache / "states").exists()


def test_what_is_said_of_states_and_makes_no_sense_is_not_believed(
    fleet: Path, tmp_path: Path, hashed: list[str]
) -> None:
    cache = tmp_path / "cache"
    options = InputOptions(plan=ReadingPlan(cache=cache))
    load([fleet / "run_1"], options)
    (link,) = (one for one in (cache / "states").rglob("*") if one.is_symlink())
    for junk in ("../../etc/passwd", "f" * 64):
        link.unlink()
        link.symlink_to(junk)
        assert [len(one) for one in load([fleet / "run_1"], options).demonstrations] == [11]


def test_what_is_in_the_cache_and_damaged_is_read_again(
    fleet: Path, tmp_path: Path, readings: list[str]
) -> None:
    cache = tmp_path / "cache"
    first = loaded(fleet, cache=cache)
    kept = sorted(cache.rglob("*.columns"))
    assert len(kept) == COUNT - 1
    kept[0].write_bytes(kept[0].read_bytes()[:-1])
    kept[1].unlink()
    readings.clear()
    assert_equal(loaded(fleet, cache=cache), first)
    assert len(readings) == 3
    readings.clear()
    loaded(fleet, cache=cache)
    assert readings == ["run_3"]


def test_notes_that_name_the_path_are_not_taken_for_another_path(tmp_path: Path) -> None:
    one, other = tmp_path / "one" / "run", tmp_path / "other" / "run"
    for bag in (one, other):
        bag.mkdir(parents=True)
        write(bag / "run_0.mcap", demonstration(9))
        (bag / "metadata.yaml").write_text("no: metadata\n")
    options = InputOptions(plan=ReadingPlan(cache=tmp_path / "cache"))
    for bag in (one, other, one):
        assert any(str(bag) in note for note in load([bag], options).notes)


def test_a_cache_that_cannot_be_written_is_noted_and_nothing_more(
    fleet: Path, tmp_path: Path
) -> None:
    taken = tmp_path / "file"
    taken.write_text("not a directory")
    found = loaded(fleet, cache=taken / "cache")
    assert found.notes[0].startswith(f"what was read cannot be kept in {taken / 'cache'} (Not a")
    assert_equal(
        Loaded(found.demonstrations, found.notes[1:], found.accounts, None, found.aside),
        loaded(fleet),
    )


def test_processes_give_the_same_with_a_cache_and_without(fleet: Path, tmp_path: Path) -> None:
    alone = loaded(fleet)
    cache = tmp_path / "cache"
    assert_equal(loaded(fleet, jobs=2), alone)
    # What an earlier run left is not read again, nor what it did not come to lost.
    loaded(fleet, cache=cache)
    next(cache.rglob("*.columns")).unlink()
    assert_equal(loaded(fleet, jobs=2, cache=cache), alone)
    shutil.rmtree(fleet / "run_0")
    write_again = fleet / "run_7"
    write_again.mkdir()
    write(write_again / "run_0.mcap", demonstration(7))
    assert_equal(loaded(fleet, jobs=2, cache=cache), loaded(fleet))


def test_processes_of_an_earlier_call_follow_into_another_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [Path("0.csv"), Path("1.csv")]
    for action in ("go", "stop"):
        directory = tmp_path / action
        directory.mkdir()
        monkeypatch.chdir(directory)
        for path in paths:
            path.write_text(f"x,action\n1,{action}\n2,{action}\n")
        read = load(paths, InputOptions(plan=ReadingPlan(jobs=2, strict=True)))
        assert [one.actions for one in read.demonstrations] == [(action,), (action,)]


def test_the_order_in_which_answers_come_does_not_matter(
    fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = loaded(fleet)
    by_workers = gathering._by_workers
    monkeypatch.setattr(
        gathering, "_by_workers", lambda *given: iter(list(by_workers(*given))[::-1])
    )
    monkeypatch.setattr(
        "rebt_ros.workers.run_all", lambda work, tasks, *_, **__: (work(*task) for task in tasks)
    )
    assert_equal(loaded(fleet, jobs=2), alone)


def test_a_dask_cluster_gives_the_same(fleet: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    alone = loaded(fleet)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        assert_equal(loaded(fleet, scheduler=address, cache=tmp_path / "cache"), alone)
        assert len(list((tmp_path / "cache").rglob("*.columns"))) == COUNT - 1
        assert_equal(loaded(fleet, scheduler=address), alone)


def test_a_web_server_is_not_taken_for_a_dask_scheduler(fleet: Path) -> None:
    pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                connection.recv(1)

        threading.Thread(target=answer, daemon=True).start()
        with pytest.raises(WorkerError, match="is not a Dask scheduler"):
            loaded(fleet, scheduler=f"tcp://127.0.0.1:{server.getsockname()[1]}")


@pytest.mark.parametrize("jobs", [0])
def test_jobs_that_make_no_sense_are_refused(fleet: Path, jobs: int) -> None:
    with pytest.raises(OptionError, match="jobs is 0"):
        load([fleet / "run_1"], InputOptions(plan=ReadingPlan(jobs=jobs)))


def test_progress_tells_rate_and_time_left(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(0, 1000, 2))
    monkeypatch.setattr(gathering.time, "monotonic", lambda: float(next(ticks)))
    told: list[tuple[str, float]] = []
    loaded(fleet, progress=lambda stage, share: told.append((stage, share)))
    assert told[0] == ("reading 1 of 6, 0.5/s, 10 s left", 1 / 6)
    assert told[-2:] == [("reading 6 of 6, 0.5/s, 0 s left", 0.999), ("reading", 1.0)]
    assert (time_left(61), time_left(3600)) == ("1 min 1 s", "1 h 0 min")


def test_patterns_and_lists_stand_for_what_they_match_and_list(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.rmtree(fleet / "run_3")
    monkeypatch.chdir(tmp_path)

    def names(*given: str) -> list[str]:
        return [one.name for one in load([Path(one) for one in given]).demonstrations]

    assert names("fleet/run_[02]") == ["run_0", "run_2"]
    # Two files with one name are told apart by their paths.
    twice = [f"fleet/run_{number}/run_0.mcap" for number in (4, 5)]
    assert names("**/run_[45]/*.mcap") == twice
    Path("list.txt").write_text("# good ones\n\n fleet/run_5 \nfleet/run_[01]\n")
    assert names("@list.txt", "fleet/run_4") == ["run_5", "run_0", "run_1", "run_4"]
    Path("@odd").mkdir()
    write(Path("@odd/x.mcap"), demonstration(9))
    assert names("@odd") == ["@odd"]
    Path("fleet[1]").mkdir()
    write(Path("fleet[1]/x.mcap"), demonstration(9))
    assert names("fleet[1]") == ["fleet[1]"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"# nothing\n", "lists no inputs"),
        (b"\xff\xfe\xfd", "is no list of inputs"),
        (b"fleet\0/run_1\n", "is no list of inputs"),
        (b"@another.txt\n", "lists the list @another.txt"),
        (b"fleet/run_1\nfleet/run_7\n", "run_7 does not exist"),
        (b"fleet/run_1\nfleet/run_[1]\n", "is given twice"),
        (b"fleet/nothing*\n", "nothing matches fleet/nothing"),
        (None, "list.txt"),
    ],
)
def test_a_list_that_cannot_be_used_gets_one_sentence(
    fleet: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    content: bytes | None,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path("list.txt").write_bytes(content)
    with pytest.raises(InputError, match=message):
        load([Path("@list.txt")])


def test_the_cache_is_where_xdg_has_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_cache() == tmp_path / "rebt_ros"
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert default_cache() == tmp_path / ".cache" / "rebt_ros"


def test_recordings_are_not_kept_a_second_time(tmp_path: Path) -> None:
    with RecordingWriter(tmp_path, (Feature("x"),), ["action"]) as writer:
        writer.write(Row(1, "action", "go", None, (0.5,)))
    cache = tmp_path / "cache"
    found = load([writer.path], InputOptions(plan=ReadingPlan(cache=cache)))
    assert [len(one) for one in found.demonstrations] == [1]
    assert not cache.exists()
