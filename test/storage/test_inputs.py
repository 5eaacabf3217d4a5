"""Inputs by what they are, and files that are replaced as a whole."""

import os
import stat
import threading
import zipfile
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Figures, LearnedTree, Provenance, Root
from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import DocumentError, InputError, OptionError
from rebt_ros.storage import atomic
from rebt_ros.storage.atomic import StorageError, write_text_atomically
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import load
from rebt_ros.storage.recording import RecordingWriter
from rebt_ros.storage.tree_file import find_tree, read_tree, write_tree

STATE = "std_msgs/msg/Float64MultiArray"
ACTION = "std_msgs/msg/String"


def write_table(path: Path) -> Path:
    path.write_text("x,action,y\n1,go,2\n3,turn,4\n5,,6\n")
    return path


def write_recording(directory: Path) -> Path:
    with RecordingWriter(directory, (Feature("x", topic="/s", index=0),), ["/a"]) as writer:
        writer.write(Row(1, "/a", "go", None, (1.0,)))
    return writer.path


def write_bag(path: Path) -> Path:
    types = get_typestore(Stores.ROS2_JAZZY)
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    state = types.types[STATE](layout=layout, data=np.array([1.0]))
    with Writer(path, version=9) as writer:
        states = writer.add_connection("/s", STATE, typestore=types)
        actions = writer.add_connection("/a", ACTION, typestore=types)
        go = types.serialize_cdr(types.types[ACTION](data="go"), ACTION)
        writer.write(states, 1, types.serialize_cdr(state, STATE))
        writer.write(actions, 2, go)
        writer.write(states, 3, types.serialize_cdr(state, STATE))
    return path


def names(loaded):
    return [one.name for one in loaded.demonstrations]


def test_every_input_is_read_as_what_it_is(tmp_path):
    table = write_table(tmp_path / "table.csv")
    single = write_recording(tmp_path / "single")
    several = [write_recording(tmp_path / "several") for _ in range(3)]
    bag = write_bag(tmp_path / "bag")
    other = write_bag(tmp_path / "other")
    loaded = load(
        [table, tmp_path / "several", bag, single, other / "other.db3"],
        InputOptions(labels=("action",), state_topics=(StateTopic("s", ("front",)),)),
    )
    assert names(loaded) == [
        "table.csv",
        *(path.name for path in several),
        "bag",
        single.name,
        "other.db3",
    ]
    assert [len(one) for one in loaded.demonstrations] == [2, 1, 1, 1, 1, 1, 1]
    assert [one.name for one in loaded.demonstrations[0].features] == ["x", "y"]
    assert [one.name for one in loaded.demonstrations[4].features] == ["front"]


def test_notes_say_which_demonstration_they_are_about(tmp_path):
    table = write_table(tmp_path / "table.csv")
    loaded = load([table], InputOptions(labels=("action",)))
    assert loaded.notes == ("table.csv: 1 of 3 rows have no action and are left out",)


def test_a_bag_is_told_by_its_files_even_without_metadata(tmp_path):
    bag = write_bag(tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    assert names(load([bag])) == ["bag"]


def test_a_directory_of_bags_is_each_of_them_and_so_is_one_of_tables(tmp_path):
    for name in ("b", "a"):
        write_bag(tmp_path / "bags" / name)
    loaded = load([tmp_path / "bags"])
    assert names(loaded) == ["a", "b"]
    assert {name: account.missing for name, account in loaded.accounts.items()} == {"a": 0, "b": 0}
    assert names(load([tmp_path / "bags" / "a" / "metadata.yaml"])) == ["a"]
    (tmp_path / "tables").mkdir()
    for name in ("2.CSV", "1.csv"):
        (tmp_path / "tables" / name).write_text("x,a\n1,go\n2,turn\n")
    assert names(load([tmp_path / "tables"])) == ["1.csv", "2.CSV"]


@pytest.mark.parametrize(
    ("begin", "why"),
    [
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        (b"#ROSBAG V2.0\n\xff", "rosbags-convert --src"),
        (b"PAR1\x15\0", "Parquet"),
        (b"\x89HDF\r\n", "HDF5"),
        (b"% of 2024\n\n@RELATION arm\n@attribute x numeric\n", "ARFF file of Weka"),
        (b"\xd0\xcf\x11\xe0\xa1", "old Excel"),
        (b"BZh91AY", "bunzip2"),
        (b"\x28\xb5\x2f\xfd\x04", "unzstd"),
        (b"7z\xbc\xaf\x27", "7z x"),
        (b"run/".ljust(257, b"\0") + b"ustar\0", "is a tar archive: unpack it with `tar -xf`"),
    ],
)
@pytest.mark.parametrize("name", ["one.mcap", "one.db3", "one.bag", "one.csv"])
def test_what_is_something_else_is_named_with_what_helps(tmp_path, begin, why, name):
    (tmp_path / name).write_bytes(begin)
    with pytest.raises(InputError, match=why):
        load([tmp_path / name])


@pytest.mark.parametrize(
    ("inside", "why"),
    [
        ("xl/workbook.xml", "is a spreadsheet: save the table as CSV"),
        ("content.xml", "is a spreadsheet"),
        ("x.npy", "is an archive of NumPy arrays"),
        ("run.csv", "unzip"),
    ],
)
def test_what_a_zip_archive_of_another_name_is_its_files_say(
    tmp_path: Path, inside: str, why: str
) -> None:
    with zipfile.ZipFile(tmp_path / "one.csv", "w") as archive:
        archive.writestr(inside, "")
    with pytest.raises(InputError, match=why):
        load([tmp_path / "one.csv"])


@pytest.mark.parametrize("name", ["run.tar.gz", "run.TGZ"])
def test_a_packed_archive_is_unpacked_in_one_go(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"\x1f\x8b\x08")
    with pytest.raises(InputError, match="is a packed tar archive: unpack it with `tar -xf`"):
        load([tmp_path / name])


@pytest.mark.parametrize("name", ["bag_0.sqlite3", "bag_0", "bag_0.csv"])
def test_a_file_of_messages_is_read_whatever_it_is_called(tmp_path: Path, name: str) -> None:
    bag = write_bag(tmp_path / "bag")
    (file,) = (one for one in bag.iterdir() if one.name != "metadata.yaml")
    file.rename(tmp_path / name)
    assert len(load([tmp_path / name]).demonstrations) == 1


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("a.xlsx", "is a spreadsheet: save the table as CSV"),
        ("a.ODS", "is a spreadsheet"),
        ("a.npz", "is an archive of NumPy arrays"),
        ("a.zip", "unzip"),
    ],
)
def test_what_a_zip_archive_is_its_name_says(tmp_path: Path, name: str, why: str) -> None:
    (tmp_path / name).write_bytes(b"PK\x03\x04\x14\0")
    with pytest.raises(InputError, match=why):
        load([tmp_path / name])


def _damaged(directory: Path) -> str:
    path = write_recording(directory)
    path.write_bytes(b"?" + path.read_bytes()[1:])
    return path.name


def _touched(directory: Path, *files: str) -> str:
    for name in files:
        (directory / name).parent.mkdir(exist_ok=True)
        (directory / name).write_text("x,a\n1,go\n2,turn\n")
    return files[0].split("/")[0]


@pytest.mark.parametrize(
    ("beside", "said"),
    [
        (_damaged, "{} does not begin like a recording and is left out"),
        (lambda one: _touched(one, "empty.REC"), "{} does not begin like a recording"),
        (lambda one: [_damaged(one) for _ in range(9)][-1], "9 files do not begin like recordings"),
        (lambda one: _touched(one, "a.csv"), "may be demonstrations is left out: {}"),
        (lambda one: _touched(one, "a.csv.gz", "b.xlsx"), "is left out: {}, b.xlsx"),
        (lambda one: _touched(one, "more/a.csv"), "in directories in it are left out: {}"),
        (lambda one: _touched(one, "README.txt", ".hidden.csv"), ""),
    ],
)
def test_what_is_passed_over_in_a_directory_is_named(tmp_path, beside, said):
    write_recording(tmp_path)
    name = beside(tmp_path)
    loaded = load([tmp_path])
    assert len(loaded.demonstrations) == 1
    if not said:
        assert loaded.notes == ()
        return
    [note] = loaded.notes
    assert note.startswith(f"{tmp_path}: ")
    assert said.format(name) in note


def test_a_directory_without_recordings_says_what_is_there(tmp_path):
    _touched(tmp_path, "one/a.csv")
    _touched(tmp_path, "two/a.rec")
    with pytest.raises(InputError, match=r"with demonstrations \(one, two\): name those"):
        load([tmp_path])
    with pytest.raises(InputError, match=r"no recordings \(a\.rec does not begin like a recording"):
        load([tmp_path / "two"])


def test_a_recording_may_end_in_capitals(tmp_path):
    path = write_recording(tmp_path)
    path.rename(path.with_suffix(".REC"))
    assert len(load([tmp_path]).demonstrations) == 1


def test_a_recording_is_told_by_its_first_line_not_by_its_name(tmp_path):
    path = write_recording(tmp_path).rename(tmp_path / "mine.txt")
    assert names(load([path])) == ["mine.txt"]


def test_a_recording_that_is_called_like_a_table_is_named_with_what_helps(tmp_path):
    path = write_recording(tmp_path).rename(tmp_path / "mine.CSV")
    for given in (path, tmp_path):
        with pytest.raises(InputError, match="CSV begins like a recording") as caught:
            load([given])
        assert str(caught.value).endswith("its suffix is that of a table: name it mine.rec.")
    assert names(load([path.rename(tmp_path / "mine.rec")])) == ["mine.rec"]


@pytest.mark.parametrize(
    "options",
    [
        InputOptions(state_topics=(StateTopic("/s"),)),
        InputOptions(action_topics=("/a",)),
        InputOptions(sample_rate=10.0),
        InputOptions(skip_bad=True),
    ],
)
def test_an_option_for_bags_needs_a_bag(tmp_path, options):
    table = write_table(tmp_path / "table.csv")
    with pytest.raises(OptionError, match="no input is a bag"):
        load([table], options)
    load([table, write_bag(tmp_path / "bag")], options)


@pytest.mark.parametrize("options", [InputOptions(labels=("x",)), InputOptions(header=False)])
def test_an_option_for_tables_needs_a_table(tmp_path, options):
    with pytest.raises(OptionError, match="no input is a CSV table"):
        load([write_bag(tmp_path / "bag")], options)


def test_a_demonstration_counts_once_by_whatever_path(tmp_path, monkeypatch):
    path = write_recording(tmp_path / "recordings")
    (tmp_path / "link").symlink_to(path)
    (tmp_path / "directory").symlink_to(tmp_path / "recordings")
    monkeypatch.chdir(tmp_path)
    same = (
        Path("link"),
        Path("directory", path.name),
        Path("recordings", path.name),
        Path("recordings", "..", "recordings", path.name),
    )
    for other in same:
        with pytest.raises(InputError, match="given twice"):
            load([path, other])


def test_a_demonstration_counts_once(tmp_path):
    path = write_recording(tmp_path / "recordings")
    with pytest.raises(InputError, match="given twice"):
        load([tmp_path / "recordings", path])


def test_what_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no input"):
        load([])
    with pytest.raises(InputError, match="does not exist"):
        load([tmp_path / "nothing"])
    with pytest.raises(InputError, match="record a demonstration first"):
        load([tmp_path])
    with pytest.raises(InputError, match="cannot be read"):
        load([tmp_path / ("long" * 100)])


def learned() -> LearnedTree:
    go = nodes.Action("go", "/a")
    figures = Figures(0, None, None, 0)
    origin = Provenance(1, 1, 0.0, None, 0.0, Root.SELECTOR, History.NONE, figures)
    return LearnedTree((Feature("x"),), (go,), nodes.Selector((go,)), origin)


def test_a_tree_reads_back_as_it_was_written(tmp_path):
    write_tree(tmp_path / "new" / "tree.json", learned())
    assert read_tree(tmp_path / "new" / "tree.json") == learned()


def test_a_malformed_tree_file_is_named(tmp_path):
    path = tmp_path / "tree.json"
    path.write_text("{")
    with pytest.raises(DocumentError, match=r"tree\.json: "):
        read_tree(path)
    with pytest.raises(InputError, match="does not exist"):
        read_tree(tmp_path / "nothing.json")
    with pytest.raises(InputError, match="is a directory"):
        read_tree(tmp_path)


def test_a_tree_that_may_be_missing_is_found_or_refused(tmp_path):
    path = tmp_path / "tree.json"
    assert find_tree(path) is None
    assert find_tree(tmp_path / "nowhere" / "tree.json") is None
    write_tree(path, learned())
    assert find_tree(path) == learned()
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DocumentError, match=r"tree\.json: the document is not JSON"):
        find_tree(path)
    with pytest.raises(InputError, match="is a directory"):
        find_tree(tmp_path)
    with pytest.raises(InputError, match="is a file, not a directory"):
        find_tree(path / "tree.json")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is no regular file"):
        find_tree(tmp_path / "pipe")


def test_a_file_too_large_for_a_tree_is_not_read(tmp_path):
    path = tmp_path / "tree.json"
    with path.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(DocumentError, match="has more than"):
        read_tree(path)


def test_a_reader_sees_the_old_text_or_the_new_one(tmp_path):
    path = tmp_path / "file"
    texts = {str(digit) * 200_000 for digit in range(5)}
    write_text_atomically(path, "0" * 200_000)
    done = threading.Event()

    def write():
        for _ in range(5):
            for text in texts:
                write_text_atomically(path, text)
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    seen = set()
    while not done.is_set():
        seen.add(path.read_text())
    writer.join()
    assert seen <= texts
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_leaves_the_old_text_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_text_atomically(path, "old")

    def refuse(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", refuse)
    with pytest.raises(StorageError, match="No space left"):
        write_text_atomically(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_places_that_cannot_be_written_are_refused(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "file" / "below"):
        with pytest.raises(StorageError, match="cannot be written"):
            write_text_atomically(path, "text")
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_link_is_followed_and_others_may_read_the_file(tmp_path):
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "target")
    mask = os.umask(0o022)
    try:
        write_text_atomically(link, "über")
    finally:
        os.umask(mask)
    assert link.is_symlink()
    assert (tmp_path / "target").read_bytes() == "über".encode()
    assert stat.S_IMODE((tmp_path / "target").stat().st_mode) == 0o644


def test_a_table_from_a_pipe_is_read(tmp_path):
    content = write_table(tmp_path / "table.csv").read_bytes()
    reading, writing = os.pipe()
    try:
        os.write(writing, content)
        os.close(writing)
        (read,) = load([Path(f"/dev/fd/{reading}")]).demonstrations
    finally:
        os.close(reading)
    assert read.actions == ("go", "turn")
