"""Types that a bag defines: they are read as those of ROS are, and never run as code."""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mcap_files as mcap
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.errors import InputError, MessagePathError
from rebt_ros.robot_file.errors import RobotFileError
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.bag_survey import survey_bag
from rebt_ros.storage.idl import parse_idl
from rebt_ros.storage.message_definitions import parse_definitions
from rebt_ros.storage.message_types import BagTypes, _shapes, _whole
from rebt_ros.storage.robot_bag import read_robot_bag

OWN = """\
# An arm.
uint8 MODE_IDLE=0
uint8 MODE_BUSY=1   # working
string TITLE="arm # 1"
std_msgs/Header header
uint8 mode
float32[3] place
Joint[<=5] joints
string<=10 name "none"
"""
JOINT = "float64 angle 0.5\nbool locked\n"

TEXT = """
topics: {/arm: my_msgs/msg/Own}
state:
  mode: /arm.mode
  z: /arm.place[2]
  elbow: /arm.joints[1].angle
  locked: /arm.joints[:].angle.@max
actions:
  action: /arm.name
"""


def _write(path: Path, plugin: StoragePlugin, defined: Mapping[str, str] | None = None) -> Path:
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(JOINT, "my_msgs/msg/Joint"))
    types.register(get_types_from_msg(OWN, "my_msgs/msg/Own"))
    kinds: dict[str, Any] = types.types
    stamp = kinds["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        about: Mapping[str, Any] = defined or {"typestore": types}
        to = writer.add_connection("/arm", "my_msgs/msg/Own", **about)
        for number in range(6):
            joints = [
                kinds["my_msgs/msg/Joint"](angle=angle, locked=False)
                for angle in (0.25, float(number))
            ]
            message = kinds["my_msgs/msg/Own"](
                header=header,
                mode=number % 2,
                place=_floats(0.0, 0.0, number + 0.5),
                joints=joints,
                name="go" if number % 2 else "rest",
            )
            writer.write(to, number, types.serialize_cdr(message, "my_msgs/msg/Own"))
    return path


def _floats(*values: float) -> Any:
    import numpy as np

    return np.array(values, dtype=np.float32)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_type_that_the_bag_defines_is_read(tmp_path: Path, plugin: StoragePlugin) -> None:
    bag = _write(tmp_path / "bag", plugin)
    shown = read_robot_bag(bag, parse_robot_file(TEXT)).demonstration
    # An action has the state before its message.
    assert shown.states[:, 1:].tolist() == [
        [number + 0.5, float(number), max(0.25, number)] for number in range(5)
    ]
    mode = shown.features[0]
    assert (mode.kind, mode.categories) == (FeatureKind.CATEGORICAL, ("IDLE", "BUSY"))
    assert [shown.actions[one] for one in shown.chosen] == ["go", "rest", "go", "rest", "go"]
    [survey], notes = survey_bag(bag)
    assert notes == ()
    assert survey.field(".place[2]") is not None


def test_a_definition_is_its_fields_and_whole_constants() -> None:
    text = f"{OWN}{'=' * 80}\nMSG: my_msgs/Joint\n{JOINT}"
    found = parse_definitions("my_msgs/msg/Own", text)
    assert list(found) == ["my_msgs/msg/Own", "my_msgs/msg/Joint"]
    constants, fields = found["my_msgs/msg/Own"]
    assert constants == [("MODE_IDLE", "uint8", 0), ("MODE_BUSY", "uint8", 1)]
    assert [name for name, _ in fields] == ["header", "mode", "place", "joints", "name"]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "does not define it: record it where its package is sourced"),
        ("my_msgs/Missing one", "does not define my_msgs/msg/Missing, which is within it: record"),
        ("Own itself", "defines it as no type of ROS 2 can be"),
        (f"Other other\n{'=' * 80}\nMSG: my_msgs/Other\nOwn own", "defines it as no type"),
    ],
)
def test_a_type_that_is_empty_not_whole_or_holds_itself_is_unknown(text: str, why: str) -> None:
    types = BagTypes({"my_msgs/msg/Own": text})
    with pytest.raises(MessagePathError, match=f"the bag {why}"):
        types("my_msgs/msg/Own")


POINT = "geometry_msgs/msg/Point"
HALVES = ("float64 z\nfloat64 x\nfloat64 y\n", "float64 x\nfloat64 y\nfloat64 z\n")


def _points(path: Path, definitions: Sequence[str], defined_in: str = "ros2msg") -> Path:
    """A topic of three numbers, with as many channels as definitions of its type, and actions."""
    channels = [
        mcap.Channel("/own", "my_msgs/msg/Own" if defined_in != "ros2msg" else POINT, "cdr", *about)
        for about in ((one, defined_in) for one in definitions)
    ]
    channels.append(mcap.Channel("/action", mcap.ACTION))
    messages = []
    for number in range(8):
        data = b"\0\1\0\0" + struct.pack("<ddd", 9.0, number, 2.0)
        messages.append(mcap.Message(number % len(definitions), 2 * number, data))
        messages.append(mcap.Message(len(definitions), 2 * number + 1, mcap.action("go")))
    return mcap.write(path, messages, channels, per_chunk=None)


OF_X = parse_robot_file("state: {x: /own.x}\nactions: {action: /action.data}\n")


def test_a_type_is_what_the_bag_says_where_another_distribution_has_another_one(
    tmp_path: Path,
) -> None:
    bag = _points(tmp_path / "bag.mcap", HALVES[:1])
    shown = read_robot_bag(bag, OF_X).demonstration
    assert shown.states[:, 0].tolist() == [float(number) for number in range(8)]
    [_, survey], _ = survey_bag(bag)
    found = survey.field(".z")
    assert found is not None
    assert found.values == [9.0]


@pytest.mark.parametrize("comment", ["", "# of the arm\n"])
def test_a_type_that_changed_within_a_bag_is_not_misread(tmp_path: Path, comment: str) -> None:
    same = _points(tmp_path / "same.mcap", [HALVES[0], HALVES[0] + comment])
    assert read_robot_bag(same, OF_X).demonstration.states[1, 0] == 1.0
    with pytest.raises(InputError, match=f"defines {POINT} in several ways"):
        read_robot_bag(_points(tmp_path / "bag.mcap", HALVES), OF_X)


def test_how_a_bag_defines_what_is_not_read_is_said(tmp_path: Path) -> None:
    bag = _points(tmp_path / "bag.mcap", ["{}"], "jsonschema")
    with pytest.raises(RobotFileError, match="the bag defines it in jsonschema, which is not read"):
        read_robot_bag(bag, OF_X)


def test_why_a_message_of_a_robot_cannot_be_decoded_is_said(tmp_path: Path) -> None:
    channels = [
        mcap.Channel("/own", "my_msgs/msg/Own", "cdr", "wstring title\nfloat64 x\n"),
        mcap.Channel("/action", mcap.ACTION),
    ]
    data = b"\0\1\0\0" + struct.pack("<Ixxxxd", 0, 1.0)
    action = mcap.Message(1, 2, mcap.action("go"))
    path = mcap.write(tmp_path / "bag.mcap", [mcap.Message(0, 1, data), action], channels)
    [state] = read_robot_bag(path, OF_X).demonstration.states.tolist()
    assert state == [1.0]
    other = mcap.Message(0, 1, b"\0\7" + data[2:])
    path = mcap.write(tmp_path / "bag.mcap", [other, action], channels)
    with pytest.raises(InputError, match="it begins with 0007"):
        read_robot_bag(path, OF_X)


def test_values_without_a_constant_are_noted(tmp_path: Path) -> None:
    bag = _write(tmp_path / "bag", StoragePlugin.MCAP)
    text = TEXT.replace("mode: /arm.mode", "mode: {path: /arm.mode, categories: [BUSY]}")
    read = read_robot_bag(bag, parse_robot_file(text))
    assert read.demonstration.features[0].categories == ("BUSY",)
    assert read.demonstration.states[:, 0].tolist()[1::2] == [0.0, 0.0]
    assert "feature 'mode' has no value where its field is 0, which is none of its categories" in (
        read.notes
    )


@pytest.mark.parametrize(
    ("labels", "why"),
    [
        ("{MODE_IDLE: rest}", "'/arm.mode' is never 'MODE_IDLE': it is an integer or one of IDLE"),
        ("{01: rest}", "'/arm.mode' is never '01'"),
    ],
)
def test_labels_of_values_that_are_never_there_are_refused(
    tmp_path: Path, labels: str, why: str
) -> None:
    bag = _write(tmp_path / "bag", StoragePlugin.MCAP)
    text = TEXT.replace("action: /arm.name", f"action: {{path: /arm.mode, labels: {labels}}}")
    with pytest.raises(RobotFileError, match=why):
        read_robot_bag(bag, parse_robot_file(text))
    text = TEXT.replace(
        "action: /arm.name", "action: {path: '/arm.joints[0].locked', labels: {yes: go}}"
    )
    with pytest.raises(RobotFileError, match="is never 'yes': it is true or false"):
        read_robot_bag(bag, parse_robot_file(text))


IDL = f"""{"=" * 80}
IDL: my_msgs/msg/Own
// It's "made" by a person /* without .msg
#include "my_msgs/msg/Joint.idl"
module my_msgs {{ module msg {{
  const long SIZE = 3;
  typedef sequence<my_msgs::msg::Joint, SIZE> Joints;
  typedef float place_t[SIZE];
  enum Color {{ RED, GREEN }};
  module Own_Constants {{
    const uint8 MODE_IDLE = 0; const octet MODE_BUSY = 0x1;
    @verbatim (language="comment", text="no ; and no }} )")
    const string TITLE = "arm; }} # 1";
  }};
  /* struct Other {{ double x; }}; */
  @verbatim (language="comment", text= "An arm." "\\n" "It has \\"joints\\" (some).")
  struct Own {{
    std_msgs::msg::Header header;
    @default (value=1) @unit("none") octet mode;
    place_t place;
    Joints joints;
    @key string<10> name;
  }};
}}; }};
{"=" * 80}
IDL: my_msgs/msg/Joint
module my_msgs {{
  module msg {{
    struct Joint {{ double angle; boolean locked; }};
  }};
}};
"""


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_type_that_the_bag_defines_in_idl_is_read_as_that_of_msg_files(
    tmp_path: Path, plugin: StoragePlugin
) -> None:
    def shapes(text: str) -> list[Any]:
        found = parse_definitions("my_msgs/msg/Own", text)
        return [
            (_shapes(found[one][1]), _whole(found[one][0]))
            for one in ("my_msgs/msg/Own", "my_msgs/msg/Joint")
        ]

    assert shapes(IDL) == shapes(f"{OWN}{'=' * 80}\nMSG: my_msgs/Joint\n{JOINT}")
    expected = read_robot_bag(_write(tmp_path / "msg", plugin), parse_robot_file(TEXT))
    bag = _write(tmp_path / "idl", plugin, {"msgdef": IDL, "rihs01": "RIHS01_0"})
    assert b"IDL: my_msgs" in b"".join(one.read_bytes() for one in bag.iterdir())
    read = read_robot_bag(bag, parse_robot_file(TEXT))
    assert read.demonstration.features == expected.demonstration.features
    assert read.demonstration.states.tolist() == expected.demonstration.states.tolist()
    assert read.notes == expected.notes


def test_the_types_of_ros_are_the_same_in_idl() -> None:
    share = Path(pytest.importorskip("std_msgs").__file__)
    found = [one for up in share.parents for one in sorted(up.glob("share/*/msg/*.idl"))]
    if not found:
        pytest.skip("the definitions are not installed")
    for idl in found:
        name = f"{idl.parts[-3]}/msg/{idl.stem}"
        text = idl.with_suffix(".msg").read_text(encoding="utf-8")
        [(own, its)] = parse_idl(idl.read_text(encoding="utf-8")).items()
        assert own == name
        constants, fields = parse_definitions(name, text)[name]
        assert _whole(its[0]) == _whole(constants), name
        assert _shapes(its[1]) == _shapes(fields), name


@pytest.mark.parametrize(
    "struct",
    [
        "struct Own { double grid[2][3]; };",
        "struct Own { sequence<sequence<double>> rows; };",
        "enum Color { RED, GREEN }; struct Own { Color color; };",
        "struct Own { wchar letter; };",
        "struct Own { long double x; };",
        "struct Base { double x; }; struct Own : Base { double y; };",
        "struct Own; struct Other { double x; };",
        "struct Own { double",
    ],
)
def test_what_ros_has_not_is_not_known(struct: str) -> None:
    text = f"module my_msgs {{ module msg {{ {struct} }}; }};"
    with pytest.raises(MessagePathError, match=r"the bag (defines it as no|does not define)"):
        BagTypes({"my_msgs/msg/Own": text})("my_msgs/msg/Own")


@pytest.mark.parametrize(
    "part",
    [
        "/*",
        '"\\',
        "module a {",
        "sequence<",
        "struct a { ",
        "(",
        "@",
        "@a(",
        "const long a = ",
        "'",
    ],
)
def test_idl_is_read_once_however_it_is_written(part: str) -> None:
    begin = time.process_time()
    parse_idl(part * (500_000 // len(part)))
    assert time.process_time() - begin < 20.0


@given(st.lists(st.sampled_from([*IDL.split(), "{", "}", ";", "<", ">", "[", "]"])))
def test_any_words_are_definitions_in_idl_or_none(words: list[str]) -> None:
    for name, (_, fields) in parse_idl(" ".join(words)).items():
        assert name
        assert all(isinstance(field, str) for field, _ in fields)


@given(st.text())
def test_whatever_a_bag_says_is_a_definition_or_none(text: str) -> None:
    try:
        kind = BagTypes({"my_msgs/msg/Own": text})("my_msgs/msg/Own")
    except MessagePathError:
        return
    assert kind.name == "my_msgs/msg/Own"
