"""Bags: the same rows as the live recorder's, topics by name or by themselves, damage named."""

import contextlib
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from rebt_ros.demonstration.builder import DemonstrationBuilder, StateTopic
from rebt_ros.demonstration.demonstration import Demonstration
from rebt_ros.demonstration.fields import Dimension, fields_of
from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.bag import STATE_TYPE, UndecodableError, _States, read_bag
from rebt_ros.storage.bag_metadata import NAME, BagMetadata, read_metadata

TYPES = get_typestore(Stores.ROS2_JAZZY)
STATE = "std_msgs/msg/Float64MultiArray"
ACTION = "std_msgs/msg/String"
SECOND = 1_000_000_000


@dataclass(frozen=True)
class Message:
    """One message of a bag; the value's type says which kind it is."""

    stamp: int
    topic: str
    value: str | tuple[float, ...] | bytes
    labels: tuple[str, ...] = ()

    @property
    def msgtype(self) -> str:
        return ACTION if isinstance(self.value, str) else STATE

    def serialized(self) -> bytes:
        if isinstance(self.value, bytes):
            return self.value
        if isinstance(self.value, str):
            return bytes(TYPES.serialize_cdr(TYPES.types[ACTION](data=self.value), ACTION))
        layout = TYPES.types["std_msgs/msg/MultiArrayLayout"]
        dimension = TYPES.types["std_msgs/msg/MultiArrayDimension"]
        message = TYPES.types[STATE](
            layout=layout(
                dim=[dimension(label=one, size=1, stride=1) for one in self.labels], data_offset=0
            ),
            data=np.array(self.value, dtype=np.float64),
        )
        return bytes(TYPES.serialize_cdr(message, STATE))


def write_bag(path: Path, messages, storage=StoragePlugin.MCAP, silent=()) -> Path:
    """Writes a bag; `silent` are (topic, type) pairs without messages."""
    with Writer(path, version=9, storage_plugin=storage) as writer:
        topics = {(one.topic, one.msgtype) for one in messages} | set(silent)
        connections = {
            topic: writer.add_connection(topic, msgtype, typestore=TYPES)
            for topic, msgtype in sorted(topics)
        }
        for one in messages:
            writer.write(connections[one.topic], one.stamp, one.serialized())
    return path


MESSAGES = (
    Message(1, "/state", (0.1, 1.0)),
    Message(2, "/action", "go"),
    Message(3, "/state", (0.2, 2.0)),
    Message(4, "/action", "turn"),
    Message(5, "/action", "go"),
)


def rows_of(demonstration):
    return [
        (int(stamp), demonstration.actions[code], tuple(state))
        for stamp, code, state in zip(
            demonstration.stamps, demonstration.chosen, demonstration.states.tolist(), strict=True
        )
    ]


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("single_file", [False, True])
def test_a_bag_is_read_as_a_directory_and_as_a_single_file(tmp_path, storage, single_file):
    path = write_bag(tmp_path / "run", MESSAGES, storage)
    if single_file:
        (path,) = (one for one in path.iterdir() if one.suffix in (".mcap", ".db3"))
        path = path.rename(tmp_path / path.name)
    read = read_bag(path)
    assert rows_of(read.demonstration) == [
        (2, "go", (0.1, 1.0)),
        (4, "turn", (0.2, 2.0)),
        (5, "go", (0.2, 2.0)),
    ]
    assert [(one.name, one.topic, one.index) for one in read.demonstration.features] == [
        ("state[0]", "/state", 0),
        ("state[1]", "/state", 1),
    ]
    assert read.demonstration.channels == ("/action",)
    assert read.demonstration.name == path.name
    assert read.notes == ()


@pytest.mark.parametrize("rate", [None, 7.0])
def test_the_rows_are_those_that_the_builder_makes_of_the_same_messages(tmp_path, rate):
    rng = np.random.default_rng(3)
    messages = []
    for count in range(200):
        stamp = count * SECOND // 20
        messages.append(Message(stamp, "/state", tuple(rng.normal(size=3)), ("a,b,c",)))
        if rng.random() < 0.2:
            messages.append(Message(stamp + 1, "/action", str(rng.choice(["go", "turn", ""]))))
    builder = DemonstrationBuilder([StateTopic("/state")], ["/action"], rate)
    rows = []
    for one in messages:
        if isinstance(one.value, str):
            rows += builder.act(one.stamp, one.topic, one.value)
        else:
            labels = fields_of([Dimension(label) for label in one.labels], len(one.value))
            rows += builder.observe(one.stamp, one.topic, one.value, labels)
    expected = Demonstration.from_rows("run", builder.features, rows)
    shown = read_bag(write_bag(tmp_path / "run", messages), sample_rate=rate).demonstration
    assert len(shown) > 20
    assert [one.name for one in shown.features] == ["a", "b", "c"]
    assert shown.features == expected.features
    assert shown.states.tobytes() == expected.states.tobytes()
    assert rows_of(shown) == rows_of(expected)


def test_messages_are_taken_in_the_order_of_their_recorded_times(tmp_path):
    late_state = [MESSAGES[0], MESSAGES[3], MESSAGES[2], MESSAGES[1], MESSAGES[4]]
    shown = read_bag(write_bag(tmp_path / "run", late_state)).demonstration
    assert rows_of(shown) == rows_of(read_bag(write_bag(tmp_path / "b", MESSAGES)).demonstration)


def test_the_files_of_a_split_bag_are_read_together_by_time(tmp_path):
    whole = write_bag(tmp_path / "whole", MESSAGES)
    split = write_bag(tmp_path / "split", [MESSAGES[0], MESSAGES[3], MESSAGES[4]])
    other = write_bag(tmp_path / "other", [MESSAGES[2], MESSAGES[1]])
    shutil.copy(other / "other.mcap", split / "other.mcap")
    metadata = split / "metadata.yaml"
    text = metadata.read_text()
    assert "- split.mcap" in text
    metadata.write_text(text.replace("- split.mcap", "- split.mcap\n  - other.mcap", 1))
    assert rows_of(read_bag(split).demonstration) == rows_of(read_bag(whole).demonstration)


@pytest.mark.parametrize("slash", ["", "/"])
def test_topics_are_chosen_with_and_without_their_slash(tmp_path, slash):
    messages = [*MESSAGES, Message(1, "/other", (7.0,)), Message(6, "/command", "never")]
    read = read_bag(
        write_bag(tmp_path / "run", messages),
        state_topics=[StateTopic(f"{slash}other"), StateTopic(f"{slash}state", ("p", "q"))],
        action_topics=[f"{slash}action"],
    )
    assert [(one.name, one.topic) for one in read.demonstration.features] == [
        ("other[0]", "/other"),
        ("p", "/state"),
        ("q", "/state"),
    ]
    assert rows_of(read.demonstration)[0] == (2, "go", (7.0, 0.1, 1.0))


def test_topics_without_messages_do_not_make_the_choice_harder(tmp_path):
    silent = [("/command", ACTION), ("/other", STATE)]
    assert len(read_bag(write_bag(tmp_path / "run", MESSAGES, silent=silent)).demonstration) == 3


@pytest.mark.parametrize(
    ("messages", "options", "message"),
    [
        (
            [*MESSAGES, Message(1, "/other", (7.0,))],
            {},
            r"2 topics of type .*MultiArray \(/other, /state\): say which",
        ),
        ([*MESSAGES, Message(6, "/command", "x")], {}, r"\(/action, /command\): say which"),
        (MESSAGES[1:2], {}, "has no state topic of type .*--robot.*, what to take of /action"),
        (MESSAGES[:1], {}, "has no action topic of type .*--robot.*, what to take of /state"),
        (MESSAGES, {"state_topics": [StateTopic("/odom")]}, "no messages on state topic '/odom'"),
        (MESSAGES, {"action_topics": ["cmd"]}, "no messages on action topic 'cmd': there is /act"),
        (MESSAGES, {"action_topics": ["/state"]}, "'/state' must be of type std_msgs/msg/String"),
        ([], {}, "holds no messages"),
        ([MESSAGES[1], Message(9, "/state", (1.0,))], {}, "all actions came before the first"),
        ([MESSAGES[0], Message(2, "/action", "")], {}, "no action has a label"),
    ],
)
def test_a_bag_that_lacks_something_is_refused_with_one_sentence(
    tmp_path, messages, options, message
):
    path = write_bag(tmp_path / "run", messages)
    with pytest.raises(InputError, match=message) as caught:
        read_bag(path, **options)
    assert str(path) in str(caught.value)
    assert str(caught.value).endswith(".")


def test_a_topic_that_is_named_twice_is_refused(tmp_path):
    path = write_bag(tmp_path / "run", MESSAGES)
    with pytest.raises(OptionError, match="must differ"):
        read_bag(path, state_topics=[StateTopic("/state"), StateTopic("state")])


def test_actions_before_the_first_state_are_left_out_with_a_note(tmp_path):
    messages = [Message(0, "/action", "early"), *MESSAGES]
    read = read_bag(write_bag(tmp_path / "run", messages))
    assert len(read.demonstration) == 3
    assert read.notes == ("left out: 1 action before the first message of every state topic",)


@pytest.mark.parametrize(
    "name", ["/robot_description", "/r1/robot_description", "/a/robot_description_semantic"]
)
def test_what_describes_a_robot_is_no_action(tmp_path: Path, name: str) -> None:
    path = write_bag(tmp_path / "run", [Message(0, name, "<robot/>"), *MESSAGES])
    assert rows_of(read_bag(path).demonstration)[0] == (2, "go", (0.1, 1.0))
    asked = read_bag(path, action_topics=["/action", name])
    assert asked.demonstration.channels == ("/action",)


@pytest.mark.parametrize("rate", [None, 5.0])
@pytest.mark.parametrize(
    ("period", "silence", "noted"),
    [
        (0.05, (3.0, 6.0), True),  # a sensor drops out,
        (0.05, (7.0, 10.0), True),  # or dies before the end
        (0.05, (3.0, 3.9), False),  # within the time that a robot may take to think
        (0.4, (3.0, 6.0), False),  # what comes now and then may stay away for longer
        (20.0, (3.0, 6.0), False),  # said once, for those who come late
    ],
)
def test_rows_with_a_state_that_had_grown_old_are_noted(
    tmp_path: Path, period: float, silence: tuple[float, float], noted: bool, rate: float | None
) -> None:
    begin, end = (int(one * SECOND) for one in silence)
    times = [int(place * period * SECOND) for place in range(1 + int(10 / period))]
    states = [Message(one, "/state", (one / SECOND,)) for one in times if not begin < one < end]
    actions = [
        Message(1 + one * SECOND // 5, "/action", "go" if one % 3 else "turn") for one in range(50)
    ]
    other = [Message(one, "/other", (1.0,)) for one in range(0, 10 * SECOND, SECOND // 10)]
    read = read_bag(
        write_bag(tmp_path / "run", [*states, *actions, *other]),
        state_topics=[StateTopic("/state"), StateTopic("/other")],
        sample_rate=rate,
    )
    notes = [note for note in read.notes if "seconds old" in note]
    assert bool(notes) == noted
    if noted:
        [note] = notes
        ages = read.demonstration.stamps - read.demonstration.states[:, 0] * SECOND
        assert note.startswith(f"{int((ages > SECOND).sum())} rows have a state")
        assert "'/state'" in note
        assert read.account is not None
        assert read.account.rows == len(read.demonstration)


BAD = {
    "NaN": (Message(4, "/state", (float("nan"), 1.0)), "nan at index 0"),
    "inf": (Message(4, "/state", (0.0, float("inf"))), "inf at index 1"),
    "length": (Message(4, "/state", (1.0,)), "1 values where 2 were expected"),
    "empty": (Message(4, "/state", ()), "without values"),
    "empty, as ROS 2 writes it": (
        Message(4, "/state", bytes.fromhex("0001000000000000000000000000000079000000")),
        "without values",
    ),
    "bytes": (Message(4, "/state", b"\x00\x01\x00\x00\xff\xff"), "cannot be decoded"),
}


def test_the_only_message_of_a_state_is_noted(tmp_path):
    actions = [Message(10 * place, "/action", "go") for place in range(2, 9)]
    path = write_bag(tmp_path / "run", [Message(1, "/state", (1.0,)), *actions])
    assert read_bag(path).notes == (
        "'/state' has a single message, whose values are the state of all rows",
    )


@pytest.mark.parametrize("bad", BAD)
def test_a_bad_message_is_refused_with_its_number_and_topic(tmp_path, bad):
    message, reason = BAD[bad]
    path = write_bag(tmp_path / "run", [*MESSAGES[:3], message, *MESSAGES[3:]])
    with pytest.raises(InputError, match=f"message 3 on '/state'.*{reason}.*--skip-bad"):
        read_bag(path)


@pytest.mark.parametrize("bad", BAD)
def test_bad_messages_are_skipped_on_request_with_a_note(tmp_path, bad):
    message, reason = BAD[bad]
    good = write_bag(tmp_path / "good", MESSAGES)
    path = write_bag(tmp_path / "run", [*MESSAGES[:3], message, *MESSAGES[3:]])
    read = read_bag(path, skip_bad=True)
    assert rows_of(read.demonstration) == rows_of(read_bag(good).demonstration)
    (note,) = read.notes
    assert note.startswith("left out: 1 unusable message; the first: ")
    assert reason in note


def test_of_a_truncated_mcap_what_is_whole_is_read_wherever_it_ends(tmp_path):
    path = write_bag(tmp_path / "run", MESSAGES) / "run.mcap"
    whole = path.read_bytes()
    rows = rows_of(read_bag(path).demonstration)
    refused, read = [], []
    for size in [0, 1, 8, 20, 40, *range(60, len(whole), 97), len(whole) - 9]:
        path.write_bytes(whole[:size])
        for broken in (path, path.parent):
            try:
                shown = read_bag(broken)
            except InputError as err:
                refused.append((size, str(err)))
            else:
                read.append(size)
                assert rows_of(shown.demonstration) == rows
                assert any("ends before its end" in note for note in shown.notes)
    # All its messages are in one chunk.
    assert max(size for size, _ in refused) < min(read)
    for _, why in refused:
        assert why.endswith(".")
        assert "does not begin like an mcap file" in why or "holds no messages" in why


def test_a_damaged_bag_is_never_a_traceback(tmp_path):
    rng = np.random.default_rng(1)
    for storage, name in [(StoragePlugin.MCAP, "run.mcap"), (StoragePlugin.SQLITE3, "run.db3")]:
        path = write_bag(tmp_path / storage.name / "run", MESSAGES, storage) / name
        whole = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        for _ in range(60):
            damaged = whole.copy()
            start = int(rng.integers(len(whole)))
            damaged[start : start + 40] = rng.integers(0, 256, len(damaged[start : start + 40]))
            path.write_bytes(damaged.tobytes())
            # Where the damage is in the numbers themselves the bag can still be read.
            with contextlib.suppress(InputError):
                read_bag(path)


def test_a_directory_without_metadata_is_a_bag(tmp_path):
    path = write_bag(tmp_path / "run", MESSAGES)
    rows = rows_of(read_bag(path).demonstration)
    (path / "metadata.yaml").unlink()
    read = read_bag(path)
    assert (rows_of(read.demonstration), read.notes) == (rows, ())


@pytest.mark.parametrize("text", ["", "[1, 2]", "a: [", "rosbag2_bagfile_information: 3", "\0"])
def test_malformed_metadata_is_noted_in_one_sentence_and_done_without(tmp_path, text):
    path = write_bag(tmp_path / "run", MESSAGES)
    rows = rows_of(read_bag(path).demonstration)
    (path / "metadata.yaml").write_text(text)
    read = read_bag(path)
    assert rows_of(read.demonstration) == rows
    (note,) = read.notes
    assert "metadata.yaml cannot be read" in note
    assert note.endswith("the bag is read without it")
    assert "\n" not in note


@pytest.mark.parametrize("nothing", ["", "~", "null", "[]"])
def test_metadata_are_read_as_other_writers_of_yaml_have_them(tmp_path, nothing):
    (tmp_path / NAME).write_text(
        """rosbag2_bagfile_information: {
  "version": 9, relative_file_paths: ['a/2026-11-28', "on"],
  topics_with_message_count: [
    {topic_metadata: {name: /1e3, "type": std_msgs/msg/String}, message_count: "12"}]}
"""
    )
    found = read_metadata(tmp_path)
    assert found == BagMetadata(("2026-11-28", "on"), {("/1e3", "std_msgs/msg/String"): 12})
    (tmp_path / NAME).write_text(
        f"rosbag2_bagfile_information:\n  relative_file_paths: {nothing}\n"
        f"  topics_with_message_count: {nothing}\n"
    )
    assert read_metadata(tmp_path) == BagMetadata()


def test_what_is_no_bag_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_bag(tmp_path / "nothing")
    with pytest.raises(InputError, match="is not a bag"):
        read_bag(tmp_path)
    for name in ("x.db3", "x.mcap", "x.txt"):
        (tmp_path / name).write_text("hello")
        with pytest.raises(InputError, match="not a bag"):
            read_bag(tmp_path / name)


@pytest.mark.parametrize(
    ("labels", "count", "fields"),
    [
        (["a", "b"], 2, ("a", "b")),
        (["a, b ,c"], 3, ("a", "b", "c")),
        (["a"], 1, ("a",)),
        ([], 3, ()),
        (["a,b"], 3, ()),
        (["a,a"], 2, ()),
        (["a,"], 2, ()),
        ([""], 1, ()),
        (["rows", "columns"], 6, ()),
    ],
)
def test_field_names_come_from_labels_that_name_every_value(labels, count, fields):
    assert fields_of([Dimension(label) for label in labels], count) == fields


@pytest.mark.parametrize(
    ("labels", "sizes"),
    [
        (("rows", "columns"), (1, 2)),
        (("height", "width", "channel"), (1, 1, 3)),
        (("dim0", "dim1"), (2, 1)),
    ],
)
def test_labels_of_the_dimensions_of_a_matrix_name_no_values(labels, sizes):
    dimensions = [Dimension(*one) for one in zip(labels, sizes, strict=True)]
    assert fields_of(dimensions, len(labels)) == ()
    named = [Dimension(label, 1) for label in labels]
    assert fields_of(named, len(labels)) == labels


@given(
    st.lists(
        st.tuples(
            st.lists(st.text("ab,", max_size=3), max_size=2),
            st.lists(st.floats(), max_size=3),
            st.booleans(),
        ),
        max_size=8,
    )
)
def test_states_are_read_as_rosbags_decodes_them(
    messages: list[tuple[list[str], list[float], bool]],
) -> None:
    types, states = get_typestore(Stores.ROS2_JAZZY), _States()
    for labels, numbers, little_endian in messages:
        dimensions = [
            types.types["std_msgs/msg/MultiArrayDimension"](label=label, size=1, stride=1)
            for label in labels
        ]
        layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=dimensions, data_offset=0)
        message = types.types[STATE_TYPE](layout=layout, data=np.array(numbers))
        data = bytes(types.serialize_cdr(message, STATE_TYPE, little_endian=little_endian))
        decoded = types.deserialize_cdr(data, STATE_TYPE)
        values, names = states.read(data)
        np.testing.assert_array_equal(np.array(values), decoded.data)
        assert names == fields_of([Dimension(label) for label in labels], len(numbers))


def test_a_state_cut_short_is_not_read_as_one_that_was_read_before() -> None:
    types, states = get_typestore(Stores.ROS2_JAZZY), _States()
    layout = types.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    message = types.types[STATE_TYPE](layout=layout, data=np.array([1.0, 2.0]))
    data = bytes(types.serialize_cdr(message, STATE_TYPE))
    assert states.read(data) == states.read(data) == ((1.0, 2.0), ())
    with pytest.raises(UndecodableError):
        states.read(data[:-8])
