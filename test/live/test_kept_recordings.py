"""What the learning process reads when it is asked again: only what is new."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import InputError
from rebt_ros.live import learning_worker
from rebt_ros.live.kept_recordings import KeptRecordings
from rebt_ros.live.learning_process import Request
from rebt_ros.storage.read import Read
from rebt_ros.storage.recording import RecordingWriter, read_recording


class Reader:
    """Reads recordings, and notes which."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def __call__(self, path: Path) -> Read:
        self.asked.append(path.name)
        return read_recording(path)

    def names(self) -> list[str]:
        """What was read since the last call."""
        asked, self.asked = self.asked, []
        return asked


@pytest.fixture
def reader() -> Reader:
    return Reader()


def _record(directory: Path, name: str, rows: int) -> Path:
    """A recording of a robot that turns round in every third row."""
    with RecordingWriter(directory, (Feature("x"),), ["action"]) as writer:
        for step in range(rows):
            label = "go" if step % 3 else "turn"
            writer.write(Row(step * 10**8, "action", label, None, (step % 3 + 0.01 * step,)))
    return writer.path.rename(directory / name)


def test_only_a_new_recording_is_read(tmp_path: Path, reader: Reader) -> None:
    kept = KeptRecordings(reader)
    paths = [_record(tmp_path, f"{number}.rec", 5 + number) for number in range(3)]
    assert list(map(len, (one.demonstration for one in kept.read(paths)))) == [5, 6, 7]
    assert reader.names() == ["0.rec", "1.rec", "2.rec"]
    paths.insert(1, _record(tmp_path, "new.rec", 4))
    shares: list[float] = []
    assert [len(one.demonstration) for one in kept.read(paths, shares.append)] == [5, 4, 6, 7]
    assert reader.names() == ["new.rec"]
    assert shares == [0.0, 1.0]
    kept.read(paths)
    assert reader.names() == []


def test_a_recording_that_has_grown_is_read_again(tmp_path: Path, reader: Reader) -> None:
    kept = KeptRecordings(reader)
    path, whole = _record(tmp_path, "0.rec", 9), (tmp_path / "0.rec").read_bytes()
    path.write_bytes(whole[: -2 * (24 + 8)])
    assert [len(one.demonstration) for one in kept.read([path])] == [7]
    path.write_bytes(whole)
    assert [len(one.demonstration) for one in kept.read([path])] == [9]
    assert reader.names() == ["0.rec", "0.rec"]


def test_another_recording_in_the_place_of_one_is_read(tmp_path: Path, reader: Reader) -> None:
    kept = KeptRecordings(reader)
    path = _record(tmp_path, "0.rec", 5)
    kept.read([path])
    _record(tmp_path, "new", 5).replace(path)
    kept.read([path])
    assert reader.names() == ["0.rec", "0.rec"]


def test_what_is_not_asked_for_any_more_is_forgotten(tmp_path: Path, reader: Reader) -> None:
    kept = KeptRecordings(reader)
    paths = [_record(tmp_path, f"{number}.rec", 5) for number in range(2)]
    kept.read(paths)
    kept.read(paths[:1])
    assert len(kept.read(paths)) == 2
    assert reader.names() == ["0.rec", "1.rec", "1.rec"]


def test_one_that_cannot_be_read_does_not_cost_the_others(tmp_path: Path, reader: Reader) -> None:
    kept = KeptRecordings(reader)
    paths = [_record(tmp_path, "0.rec", 5), tmp_path / "1.rec"]
    paths[1].write_bytes(b"no recording")
    with pytest.raises(InputError, match="not a recording"):
        kept.read(paths)
    _record(tmp_path, "new", 6).replace(paths[1])
    assert [len(one.demonstration) for one in kept.read(paths)] == [5, 6]
    assert reader.names() == ["0.rec", "1.rec", "1.rec"]
    paths[0].unlink()
    with pytest.raises(InputError, match="does not exist"):
        kept.read(paths)


def test_learning_again_with_one_more_reads_that_and_gives_what_learning_anew_gives(
    tmp_path: Path, reader: Reader
) -> None:
    request = Request(str(tmp_path), {})
    known = learning_worker.Known(KeptRecordings(reader))
    for number in range(2):
        _record(tmp_path, f"{number}.rec", 40)

    def ask() -> dict[str, object]:
        line = json.dumps(asdict(request)).encode()
        return learning_worker._reply(line, known, lambda progress: None)

    ask()
    _record(tmp_path, "2.rec", 31)
    reader.names()
    again = ask()
    assert reader.names() == ["2.rec"]
    assert "111 rows" in str(again["sentence"])
    assert again == asdict(learning_worker.learn(request).lesson)
