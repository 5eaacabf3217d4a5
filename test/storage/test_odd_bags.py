"""Bags as they are met in the field: names, times, encodings and places that are not the usual."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mcap_files as mcap
import numpy as np
import pytest
import test_bag_table as table
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.errors import InputError
from rebt_ros.storage.bag import read_bag
from rebt_ros.storage.inputs import load

MESSAGES = mcap.demonstration()


def write(path: Path, state: str = "/state", action: str = "/action") -> Path:
    """A file whose topics have these names."""
    channels = [mcap.Channel(state, mcap.STATE), mcap.Channel(action, mcap.ACTION)]
    return mcap.write(path, MESSAGES, channels)


@pytest.mark.parametrize(
    ("state", "action"),
    [
        (" /state", "/action "),
        ("state", "action"),
        ("", "/action"),
        ("/größe", "/#1 50% ?"),
        ("/state\n\x1b[31m", "/action"),
        ("/state", "state"),
    ],
)
def test_topics_may_have_any_name(tmp_path: Path, state: str, action: str) -> None:
    read = read_bag(write(tmp_path / "bag.mcap", state, action))
    assert len(read.demonstration) == 20
    assert read.notes == ()


def test_a_topic_of_both_types_is_the_state_alone_unless_it_is_named(tmp_path: Path) -> None:
    channels = [*mcap.CHANNELS, mcap.Channel("/state", mcap.ACTION)]
    path = mcap.write(
        tmp_path / "bag.mcap", [*MESSAGES, mcap.Message(2, 9, MESSAGES[1].data)], channels
    )
    read = read_bag(path)
    assert read.demonstration.channels == ("/action",)
    assert read.notes == ("left out: messages on /state of type std_msgs/msg/String: 1",)


def test_of_names_that_differ_in_their_slash_the_exact_one_is_meant(tmp_path: Path) -> None:
    path = mcap.write(
        tmp_path / "bag.mcap",
        [*MESSAGES, mcap.Message(2, 1, mcap.action("other"))],
        [*mcap.CHANNELS, mcap.Channel("action", mcap.ACTION)],
    )
    assert len(read_bag(path, action_topics=["/action"]).demonstration) == 20
    assert read_bag(path, action_topics=["action"]).demonstration.actions == ("other",)


@pytest.mark.parametrize(
    "name", ["a # b", "50%", "q?x=1", "größe", "%2e%2e", "not\udcffutf8", "it's", "[x]*", "-v"]
)
@pytest.mark.parametrize("reader", ["mcap", "sqlite", "sqlite with a log", "packed sqlite"])
def test_bags_may_have_any_name(tmp_path: Path, reader: str, name: str) -> None:
    bag = table.READERS[reader](tmp_path / name)
    (bag / table.METADATA).unlink()
    for one in list(bag.iterdir()):
        one.rename(bag / f"{name}{one.name}")
    assert len(read_bag(bag).demonstration) == table.COUNT
    file = bag / f"{name}{'bag_0.mcap' if reader == 'mcap' else 'bag_0.db3'}"
    file = file if file.exists() else bag / f"{file.name}.zstd"
    assert len(read_bag(file).demonstration) == table.COUNT


def test_a_log_is_read_in_a_directory_for_reading_only_and_beside_what_a_link_leads_to(
    tmp_path: Path,
) -> None:
    bag = table.READERS["sqlite with a log"](tmp_path / "bag")
    link = tmp_path / "link.db3"
    link.symlink_to(bag / "bag_0.db3")
    bag.chmod(0o555)
    try:
        assert len(read_bag(bag).demonstration) == table.COUNT
        assert len(read_bag(link).demonstration) == table.COUNT
    finally:
        bag.chmod(0o755)


def test_a_link_that_leads_nowhere_is_called_so(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").symlink_to(tmp_path / "nothing.mcap")
    with pytest.raises(InputError, match=r"bag_0.mcap is a link that leads nowhere"):
        read_bag(tmp_path / "bag")


@pytest.mark.parametrize("stamp", [lambda _: 0, lambda _: 7])
def test_messages_without_times_are_taken_as_they_stand_with_a_note(
    tmp_path: Path, stamp: Callable[[int], int]
) -> None:
    messages = [replace(one, stamp=stamp(one.stamp)) for one in MESSAGES]
    path = mcap.write(tmp_path / "bag.mcap", messages)
    read = read_bag(path)
    [note] = read.notes
    assert note.startswith("all messages were recorded at the same time")
    assert read.demonstration.states[:, 1].tolist() == [float(-number) for number in range(20)]
    with pytest.raises(InputError, match="at the same time"):
        read_bag(path, sample_rate=10.0)


def test_states_without_times_beside_actions_with_some_are_noted(tmp_path: Path) -> None:
    messages = [replace(one, stamp=one.stamp * one.channel) for one in MESSAGES]
    [note] = read_bag(mcap.write(tmp_path / "bag.mcap", messages)).notes
    assert note.startswith("all messages on '/state' were recorded at the same time (0 ns)")


def test_actions_by_another_clock_than_the_states_are_called_so(tmp_path: Path) -> None:
    since = 1_700_000_000_000_000_000
    messages = [replace(one, stamp=one.stamp + since * (not one.channel)) for one in MESSAGES]
    with pytest.raises(InputError, match="recorded by another clock"):
        read_bag(mcap.write(tmp_path / "bag.mcap", messages))


def test_times_that_fall_are_sorted(tmp_path: Path) -> None:
    messages = [replace(one, stamp=1000 - one.stamp) for one in MESSAGES]
    path = mcap.write(tmp_path / "bag.mcap", messages, per_chunk=5)
    assert read_bag(path).demonstration.states[:, 1].tolist() == [
        float(-number) for number in range(19, 0, -1)
    ]


@pytest.mark.parametrize(
    "reader", ["mcap", "mcap without chunks", "split mcap", "sqlite", "split sqlite"]
)
def test_where_the_clock_was_set_back_messages_stay_in_their_order(
    tmp_path: Path, reader: str
) -> None:
    second = 1_000_000_000
    half = len(MESSAGES) // 2
    again = [replace(one, stamp=(place % half + 5) * second) for place, one in enumerate(MESSAGES)]
    bag = table.READERS[reader](tmp_path / "bag", table.Content(again))
    read = read_bag(bag)
    assert read.demonstration.states[:, 1].tolist() == [float(-number) for number in range(20)]
    [note] = read.notes
    assert note.startswith("the clock was set back")
    assert read.account is not None
    assert read.account.read == len(MESSAGES)
    # No action is held on into the second run.
    sampled = read_bag(bag, sample_rate=1.0).demonstration
    assert len(sampled) <= len(MESSAGES)


def test_a_bag_of_which_nothing_is_left_is_to_be_recorded_again(tmp_path: Path) -> None:
    path = mcap.write(tmp_path / "bag.mcap", MESSAGES, per_chunk=1000)
    whole = path.read_bytes()
    path.write_bytes(whole[:300] + bytes(len(whole) - 300))
    with pytest.raises(InputError, match=r"no messages that can be read: .*again .*damaged"):
        read_bag(path)


def test_topics_one_behind_the_other_and_single_late_messages_are_put_in_order(
    tmp_path: Path,
) -> None:
    second = 1_000_000_000
    spaced = [replace(one, stamp=one.stamp * second) for one in MESSAGES]
    plain = read_bag(mcap.write(tmp_path / "plain.mcap", spaced))
    apart = sorted(spaced, key=lambda one: one.channel)
    late = [*spaced[:4], *spaced[5:15], spaced[4], *spaced[15:]]
    for name, messages in (("apart", apart), ("late", late)):
        read = read_bag(mcap.write(tmp_path / f"{name}.mcap", messages))
        assert read.notes == ()
        assert np.array_equal(read.demonstration.states, plain.demonstration.states)


def test_text_that_is_not_utf8_and_other_encapsulations_are_unusable_messages(
    tmp_path: Path,
) -> None:
    latin = mcap.Message(1, 98, b"\0\1\0\0\5\0\0\0gr\xf6\xdf\0")
    other = mcap.Message(0, 99, b"\0\7" + MESSAGES[0].data[2:])
    path = mcap.write(tmp_path / "bag.mcap", [*MESSAGES, latin, other])
    with pytest.raises(InputError, match=r"message 21 on '/action' cannot be decoded .*skip-bad"):
        read_bag(path)
    read = read_bag(path, skip_bad=True)
    assert read.account is not None
    assert read.account.left_out == {"cannot be used": 2}
    path = mcap.write(tmp_path / "other.mcap", [*MESSAGES, other])
    with pytest.raises(InputError, match="it begins with 0007"):
        read_bag(path)


@pytest.mark.parametrize("encoding", ["ros1", "json", "protobuf", ""])
def test_messages_in_other_encodings_are_named_where_there_are_no_others(
    tmp_path: Path, encoding: str
) -> None:
    channels = [replace(one, encoding=encoding) for one in mcap.CHANNELS]
    path = mcap.write(tmp_path / "bag.mcap", MESSAGES, channels, profile="")
    with pytest.raises(InputError, match=rf"/state \({encoding or 'unknown'} messages\)"):
        read_bag(path)


def test_what_macos_leaves_beside_files_is_no_file_of_messages(tmp_path: Path) -> None:
    bag = table.READERS["mcap"](tmp_path / "bag")
    (bag / "._bag_0.mcap").write_bytes(b"\0\5\x16\7" + bytes(100))
    assert read_bag(bag).notes == ()


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("x.mcap", b"", "the file is empty"),
        ("x.db3", b"", "the file is empty"),
        ("x.mcap", bytes(5000), "does not begin like an mcap file"),
        ("x.db3", bytes(5000), "is not a database"),
        ("x.mcap", b"<!DOCTYPE html><html>", "page of HTML"),
        ("x.db3", b"PK\3\4" + bytes(50), "zip archive"),
        ("x.mcap.zstd", b"nothing", "does not begin like packed data"),
    ],
)
def test_what_is_no_bag_is_called_what_it_is(
    tmp_path: Path, name: str, content: bytes, why: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=why):
        read_bag(tmp_path / name)


def test_a_bag_of_ros1_is_read_once_it_is_converted_as_was_advised(tmp_path: Path) -> None:
    path = tmp_path / "old.bag"
    types = get_typestore(Stores.ROS1_NOETIC)
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    with Writer(path) as writer:
        state = writer.add_connection("/state", mcap.STATE, typestore=types)
        action = writer.add_connection("/action", mcap.ACTION, typestore=types)
        values = types.types[mcap.STATE](layout=layout, data=np.array([1.0, 2.0]))
        writer.write(state, 1, types.serialize_ros1(values, mcap.STATE))
        label = types.types[mcap.ACTION](data="go")
        writer.write(action, 2, types.serialize_ros1(label, mcap.ACTION))
    with pytest.raises(InputError, match="rosbags-convert --src FILE --dst DIRECTORY"):
        load([path])
    command = Path(sys.executable).with_name("rosbags-convert")
    arguments = [command, "--src", path, "--dst", tmp_path / "new"]
    subprocess.run(arguments, check=True, capture_output=True)
    assert len(read_bag(tmp_path / "new").demonstration) == 1


@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
def test_files_are_told_by_what_is_in_them(tmp_path: Path, suffix: str) -> None:
    for number, reader in enumerate(("mcap", "sqlite")):
        bag = table.READERS[reader](tmp_path / f"bag {number}")
        (file,) = (one for one in bag.iterdir() if one.name != table.METADATA)
        shutil.copyfile(file, tmp_path / f"{number}{suffix}")
        assert len(read_bag(tmp_path / f"{number}{suffix}").demonstration) == table.COUNT


@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
def test_a_bag_may_have_more_files_than_can_be_open_at_once(tmp_path: Path, suffix: str) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    most, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    count = len(os.listdir("/proc/self/fd")) + 40
    if suffix == ".mcap":
        mcap.write(bag / "bag_0.mcap", MESSAGES)
    else:
        table._database(bag / "bag_0.db3", MESSAGES).close()
    for number in range(1, count):
        later = [replace(one, stamp=one.stamp + 1000 * number) for one in MESSAGES]
        if suffix == ".mcap":
            mcap.write(bag / f"bag_{number}.mcap", later)
        else:
            table._database(bag / f"bag_{number}.db3", later).close()
    resource.setrlimit(resource.RLIMIT_NOFILE, (count, hard))
    try:
        read = read_bag(bag)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    assert len(read.demonstration) == 20 * count
    assert len(read.notes) == 1


def test_bags_of_one_name_have_accounts_of_their_own(tmp_path: Path) -> None:
    bags = [table.READERS["unfinished mcap"](tmp_path / run / "bag") for run in ("1", "2")]
    loaded = load(bags)
    assert list(loaded.accounts) == [str(one) for one in bags]
    assert [note.split(":")[0] for note in loaded.notes] == [str(one) for one in bags]


def test_names_in_a_database_may_be_no_utf8(tmp_path: Path) -> None:
    bag = table.READERS["sqlite"](tmp_path / "bag")
    (bag / table.METADATA).unlink()
    with contextlib.closing(sqlite3.connect(bag / "bag_0.db3")) as connection:
        connection.execute("UPDATE topics SET name = CAST(x'2fe4f6' AS TEXT) WHERE id = 1")
        connection.execute("UPDATE messages SET data = CAST(x'e4f6' AS TEXT) WHERE id = 7")
        connection.commit()
    read = read_bag(bag, skip_bad=True)
    assert [one.topic for one in read.demonstration.features] == ["/��"] * 2
    assert read.account is not None
    assert read.account.left_out == {"cannot be used": 1}


def test_a_journal_tells_that_pages_may_not_be_linked(tmp_path: Path) -> None:
    bag = table.READERS["sqlite"](tmp_path / "bag")
    (bag / "bag_0.db3-journal").write_bytes(bytes.fromhex("d9d505f920a163d7") + bytes(500))
    read = read_bag(bag)
    assert len(read.demonstration) == table.COUNT
    [note] = read.notes
    assert "its recorder was killed while it wrote" in note


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read anything")
def test_a_file_that_may_not_be_read_is_called_so(tmp_path: Path) -> None:
    path = write(tmp_path / "bag.mcap")
    path.chmod(0)
    with pytest.raises(InputError, match="check its permissions"):
        read_bag(path)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "it is empty"),
        (b"# nothing\n", "it is empty"),
        (b"- 1\n", "it says nothing of a bag"),
        (b"rosbag2_bagfile_information:\n", "it says nothing of a bag"),
        (bytes(900), "it holds zero bytes, as where a machine lost power"),
    ],
)
def test_metadata_that_a_loss_of_power_left_is_called_what_it_is(
    tmp_path: Path, content: bytes, why: str
) -> None:
    bag = table.READERS["mcap"](tmp_path / "bag")
    rows = len(read_bag(bag).demonstration)
    (bag / "metadata.yaml").write_bytes(content)
    read = read_bag(bag)
    assert len(read.demonstration) == rows
    [note] = read.notes
    assert f"metadata.yaml cannot be read ({why}" in note


def test_a_file_that_is_packed_is_to_be_unpacked_where_it_is_missing(tmp_path: Path) -> None:
    bag = table.READERS["mcap"](tmp_path / "bag")
    (file,) = bag.glob("*.mcap")
    file.rename(bag / f"{file.name}.gz")
    with pytest.raises(InputError, match=f"or unpack {file.name}.gz"):
        read_bag(bag)


@pytest.mark.parametrize("ending", [".part", ".crdownload", ".active"])
def test_a_file_that_is_still_written_is_named_where_it_is_missing(
    tmp_path: Path, ending: str
) -> None:
    bag = table.READERS["mcap"](tmp_path / "bag")
    (file,) = bag.glob("*.mcap")
    file.rename(bag / f"{file.name}{ending}")
    with pytest.raises(InputError, match=f"or wait for what writes {file.name}{ending}"):
        read_bag(bag)
