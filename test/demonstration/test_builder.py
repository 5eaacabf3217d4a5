"""The builder turns streams of messages into rows, in event mode and in sampled mode."""

from __future__ import annotations

import contextlib
import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.demonstration.builder import (
    LARGEST_VALUE,
    BadMessageError,
    DemonstrationBuilder,
    Fault,
    StateTopic,
)
from rebt_ros.demonstration.demonstration import Demonstration, Row
from rebt_ros.errors import InputError, OptionError

SECOND = 1_000_000_000
MS = 1_000_000


def one_topic(sample_rate: float | None = None, *channels: str) -> DemonstrationBuilder:
    return DemonstrationBuilder([StateTopic("state")], channels or ["action"], sample_rate)


def sampled(rate: float = 10.0, *channels: str) -> DemonstrationBuilder:
    return one_topic(rate, *channels)


# --- event mode -------------------------------------------------------------------------------


def test_every_action_message_is_a_row_with_the_latest_state() -> None:
    # time   message        row
    # 1      state 1.0      -
    # 2      state 2.0      -
    # 3      action go      go at 2.0
    # 4      action go      go at 2.0
    # 5      state 3.0      -
    # 6      action turn    turn at 3.0 after go
    # 7      action go      go at 3.0 after turn
    builder = one_topic()
    assert builder.observe(1, "state", [1.0]) == ()
    assert builder.observe(2, "state", [2.0]) == ()
    assert builder.act(3, "action", "go") == (Row(3, "action", "go", None, (2.0,)),)
    assert builder.act(4, "action", "go") == (Row(4, "action", "go", None, (2.0,)),)
    assert builder.observe(5, "state", [3.0]) == ()
    assert builder.act(6, "action", "turn") == (Row(6, "action", "turn", "go", (3.0,)),)
    assert builder.act(7, "action", "go") == (Row(7, "action", "go", "turn", (3.0,)),)


def test_values_that_are_named_in_another_order_are_taken_by_their_names() -> None:
    builder = one_topic()
    builder.observe(1, "state", [1.0, 2.0], ["front", "left"])
    builder.observe(2, "state", [4.0, 3.0], ["left", "front"])
    assert builder.act(3, "action", "go")[0].state == (3.0, 4.0)
    builder.observe(4, "state", [5.0, 6.0])
    assert builder.act(5, "action", "go")[0].state == (5.0, 6.0)
    with pytest.raises(BadMessageError, match="calls its values front, right") as caught:
        builder.observe(6, "state", [7.0, 8.0], ["front", "right"])
    assert caught.value.fault is Fault.NAMES
    assert builder.act(7, "action", "go")[0].state == (5.0, 6.0)


def test_names_that_somebody_gave_hold_whatever_messages_say() -> None:
    builder = DemonstrationBuilder([StateTopic("state", ("a", "b"))], ["action"])
    builder.observe(1, "state", [1.0, 2.0], ["b", "a"])
    assert builder.act(2, "action", "go")[0].state == (1.0, 2.0)
    single = one_topic()
    single.observe(1, "state", [1.0], ["step 1"])
    single.observe(2, "state", [2.0], ["step 2"])
    assert single.act(3, "action", "go")[0].state == (2.0,)


def test_an_empty_label_is_no_row_in_event_mode() -> None:
    builder = one_topic()
    builder.observe(1, "state", [1.0])
    builder.act(2, "action", "go")
    assert builder.act(3, "action", "") == ()
    assert builder.act(4, "action", "turn")[0].last_action == "go"


def test_every_channel_has_a_lat_of_its_own() -> None:
    builder = one_topic(None, "legs", "arm")
    builder.observe(1, "state", [1.0])
    rows = [
        *builder.act(2, "legs", "go"),
        *builder.act(3, "arm", "grasp"),
        *builder.act(4, "legs", "turn"),
        *builder.act(5, "arm", "grasp"),
        *builder.act(6, "arm", "drop"),
    ]
    assert [(row.channel, row.action, row.last_action) for row in rows] == [
        ("legs", "go", None),
        ("arm", "grasp", None),
        ("legs", "turn", "go"),
        ("arm", "grasp", None),
        ("arm", "drop", "grasp"),
    ]


def test_several_state_topics_stand_side_by_side_in_the_order_given() -> None:
    builder = DemonstrationBuilder(
        [StateTopic("pose", ("x", "y")), StateTopic("power", ("volt",))], ["action"]
    )
    builder.observe(1, "power", [12.0])
    assert builder.features is None
    builder.observe(2, "pose", [1.0, 2.0])
    assert builder.features is not None
    assert [(one.name, one.topic, one.index) for one in builder.features] == [
        ("x", "pose", 0),
        ("y", "pose", 1),
        ("volt", "power", 0),
    ]
    assert builder.act(3, "action", "go")[0].state == (1.0, 2.0, 12.0)
    builder.observe(4, "power", [11.0])
    assert builder.act(5, "action", "go")[0].state == (1.0, 2.0, 11.0)


def test_the_builder_keeps_no_hold_of_the_callers_list() -> None:
    builder = one_topic()
    values = [1.0]
    builder.observe(1, "state", values)
    values[0] = 9.0
    assert builder.act(2, "action", "go")[0].state == (1.0,)


@settings(max_examples=60)
@given(
    st.lists(
        st.one_of(
            st.floats(-1, 1).map(lambda value: ("state", value)),
            st.sampled_from(("go", "turn", "wait")).map(lambda label: ("action", label)),
        ),
        max_size=20,
    )
)
def test_rows_gathered_into_columns_are_the_same_rows(
    messages: list[tuple[str, float | str]],
) -> None:
    builder = one_topic()
    builder.observe(0, "state", [0.5])
    rows: list[Row] = []
    for stamp, (kind, content) in enumerate(messages, start=1):
        if kind == "state":
            assert isinstance(content, float)
            builder.observe(stamp, "state", [content])
        else:
            rows += builder.act(stamp, "action", str(content))
    assert builder.features is not None
    gathered = Demonstration.from_rows("test", builder.features, rows)
    assert len(gathered) == len(rows)
    assert gathered.actions == tuple(sorted({row.action for row in rows}))
    for row, state, stamp, code in zip(
        rows,
        gathered.states.tolist(),
        gathered.stamps.tolist(),
        gathered.chosen.tolist(),
        strict=True,
    ):
        assert (tuple(state), stamp, gathered.actions[code]) == (row.state, row.stamp, row.action)


# --- names of features ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "labels", "names"),
    [
        ((), (), ["state[0]", "state[1]"]),
        (("x", "y"), (), ["x", "y"]),
        ((), ("left", "right"), ["left", "right"]),
        (("x", "y"), ("left", "right"), ["x", "y"]),
        # Labels that do not name each value once are not used.
        ((), ("left",), ["state[0]", "state[1]"]),
        ((), ("left", "left"), ["state[0]", "state[1]"]),
        ((), ("left", ""), ["state[0]", "state[1]"]),
        ((), ("a", "b", "c"), ["state[0]", "state[1]"]),
    ],
)
def test_features_are_named_by_parameter_else_by_the_message_else_by_index(
    fields: tuple[str, ...], labels: tuple[str, ...], names: list[str]
) -> None:
    builder = DemonstrationBuilder([StateTopic("/robot/state", fields)], ["action"])
    builder.observe(1, "/robot/state", [1.0, 2.0], labels)
    assert builder.features is not None
    assert [one.name for one in builder.features] == names


def test_only_the_first_message_of_a_topic_names_its_values() -> None:
    builder = one_topic()
    builder.observe(1, "state", [1.0, 2.0])
    builder.observe(2, "state", [1.0, 2.0], ["left", "right"])
    assert builder.features is not None
    assert [one.name for one in builder.features] == ["state[0]", "state[1]"]


def test_a_name_that_two_topics_share_is_led_by_the_topic() -> None:
    builder = DemonstrationBuilder(
        [StateTopic("/left/state"), StateTopic("/right/state", ("x",))], ["action"]
    )
    builder.observe(1, "/left/state", [1.0], ["x"])
    builder.observe(2, "/right/state", [2.0])
    assert builder.features is not None
    assert [one.name for one in builder.features] == ["/left/state/x", "/right/state/x"]


# --- sampled mode -----------------------------------------------------------------------------


def stamps(rows: tuple[Row, ...]) -> list[float]:
    return [row.stamp / MS for row in rows]


def test_an_action_is_sampled_on_a_fixed_grid_until_the_next_one() -> None:
    # ms    message        rows due before it
    # 0     state 1.0
    # 50    action go      (the grid begins: 50, 150, 250 ...)
    # 150   state 2.0      50 at 1.0
    # 260   state 3.0      150 and 250 at 2.0
    # 300   action turn
    # 460   state 4.0      350 and 450 at 3.0: turn after go
    builder = sampled()
    assert builder.observe(0, "state", [1.0]) == ()
    assert builder.act(50 * MS, "action", "go") == ()
    assert builder.observe(150 * MS, "state", [2.0]) == (
        Row(50 * MS, "action", "go", None, (1.0,)),
    )
    assert builder.observe(260 * MS, "state", [3.0]) == (
        Row(150 * MS, "action", "go", None, (2.0,)),
        Row(250 * MS, "action", "go", None, (2.0,)),
    )
    assert builder.act(300 * MS, "action", "turn") == ()
    assert builder.observe(460 * MS, "state", [4.0]) == (
        Row(350 * MS, "action", "turn", "go", (3.0,)),
        Row(450 * MS, "action", "turn", "go", (3.0,)),
    )


def test_a_state_that_comes_on_the_instant_of_a_sample_is_the_one_sampled() -> None:
    builder = sampled()
    builder.observe(0, "state", [1.0])
    builder.act(0, "action", "go")
    builder.observe(100 * MS, "state", [2.0])
    rows = builder.observe(101 * MS, "state", [3.0])
    assert rows == (Row(100 * MS, "action", "go", None, (2.0,)),)


def test_an_empty_label_ends_the_action_and_the_grid_goes_on() -> None:
    builder = sampled()
    builder.observe(0, "state", [1.0])
    builder.act(0, "action", "go")
    assert stamps(builder.act(110 * MS, "action", "")) == [0, 100]
    assert builder.observe(500 * MS, "state", [2.0]) == ()
    assert builder.act(530 * MS, "action", "turn") == ()
    assert stamps(builder.observe(750 * MS, "state", [2.0])) == [600, 700]


def test_the_end_of_an_action_that_never_began_does_no_harm() -> None:
    builder = sampled()
    builder.observe(0, "state", [1.0])
    assert builder.act(10 * MS, "action", "") == ()
    assert builder.act(20 * MS, "action", "go") == ()
    assert stamps(builder.observe(130 * MS, "state", [1.0])) == [20, 120]


def test_channels_are_sampled_at_the_same_instants_each_with_its_own_action() -> None:
    builder = sampled(10.0, "legs", "arm")
    builder.observe(0, "state", [1.0])
    builder.act(0, "legs", "go")
    assert [(row.stamp // MS, row.action) for row in builder.act(50 * MS, "arm", "grasp")] == [
        (0, "go")
    ]
    rows = builder.act(210 * MS, "legs", "")
    assert [(row.stamp // MS, row.channel) for row in rows] == [
        (100, "legs"),
        (100, "arm"),
        (200, "legs"),
        (200, "arm"),
    ]
    rows = builder.observe(310 * MS, "state", [1.0])
    assert [(row.stamp // MS, row.action) for row in rows] == [(300, "grasp")]


def test_sampling_pauses_when_no_state_came_for_more_than_a_second() -> None:
    # The last state came at 0: it stands for the rows before 1 s, and what follows starts anew.
    builder = sampled()
    builder.observe(0, "state", [1.0])
    builder.act(0, "action", "go")
    rows = builder.observe(5 * SECOND + 30 * MS, "state", [2.0])
    assert stamps(rows) == [n * 100 for n in range(10)]
    assert stamps(builder.observe(5 * SECOND + 140 * MS, "state", [2.0])) == [5030, 5130]


def test_actions_alone_do_not_end_a_silence() -> None:
    builder = sampled()
    builder.observe(0, "state", [1.0])
    builder.act(0, "action", "go")
    assert len(builder.act(3 * SECOND, "action", "turn")) == 10
    assert builder.act(4 * SECOND, "action", "go") == ()
    assert builder.act(9 * SECOND, "action", "turn") == ()
    assert builder.observe(10 * SECOND, "state", [2.0]) == ()
    assert stamps(builder.observe(10 * SECOND + 150 * MS, "state", [2.0])) == [10000, 10100]


def test_a_second_without_states_is_no_silence_yet() -> None:
    builder = sampled()
    builder.observe(0, "state", [1.0])
    builder.act(0, "action", "go")
    assert len(builder.observe(SECOND, "state", [2.0])) == 10
    assert stamps(builder.observe(SECOND + 50 * MS, "state", [2.0])) == [1000]


def test_a_slow_grid_is_not_made_faster_by_slow_states() -> None:
    # A row every 10 s, a state every 1.5 s.
    builder = sampled(0.1)
    builder.observe(0, "state", [0.0])
    builder.act(0, "action", "go")
    taken = [
        row.stamp / SECOND
        for number in range(1, 41)
        for row in builder.observe(number * 3 * SECOND // 2, "state", [float(number)])
    ]
    assert 6 <= len(taken) <= 7
    assert all(later - earlier >= 10 for earlier, later in pairwise(taken))


def test_a_clock_that_is_set_back_starts_the_grid_anew() -> None:
    builder = sampled()
    builder.observe(100 * SECOND, "state", [1.0])
    builder.act(100 * SECOND, "action", "go")
    builder.observe(100 * SECOND + 50 * MS, "state", [1.0])
    assert builder.observe(20 * SECOND, "state", [2.0]) == ()
    assert stamps(builder.observe(20 * SECOND + 150 * MS, "state", [3.0])) == [20000, 20100]


def test_silence_is_noticed_also_after_a_clock_was_set_back() -> None:
    builder = sampled()
    builder.observe(100 * SECOND, "state", [1.0])
    builder.act(100 * SECOND, "action", "go")
    builder.act(20 * SECOND, "action", "turn")
    # The state is as old as the clock allows: it came by 20 s.
    assert len(builder.act(60 * SECOND, "action", "go")) == 10


def test_a_clock_that_is_set_forward_is_a_silence() -> None:
    builder = sampled()
    builder.observe(0, "state", [1.0])
    builder.act(0, "action", "go")
    year = 365 * 24 * 3600 * SECOND
    assert len(builder.observe(30 * year, "state", [2.0])) == 10


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 400),
            st.sampled_from(("", "go", "turn", "state", "state", "state")),
        ),
        max_size=25,
    ),
    st.sampled_from((1.0, 3.0, 10.0, 30.0)),
)
def test_samples_lie_on_the_grid_and_never_overtake_the_messages(
    steps: list[tuple[int, str]], rate: float
) -> None:
    builder = sampled(rate)
    builder.observe(0, "state", [0.0])
    now, earlier, held, begun = 0, -1, "", None
    period = round(SECOND / rate)
    for gap, content in steps:
        now += gap * MS
        if content == "state":
            rows = builder.observe(now, "state", [float(now)])
        else:
            rows = builder.act(now, "action", content)
        for row in rows:
            assert earlier < row.stamp < now
            assert row.action == held
            assert begun is not None
            # Gaps are below a second here, but a state may be older than that: a new grid.
            assert (row.stamp - begun) % period == 0 or row.stamp - earlier > period
            if (row.stamp - begun) % period:
                begun = row.stamp
            earlier = row.stamp
        if content != "state":
            held = content
            if begun is None and content:
                begun = now


# --- what is refused --------------------------------------------------------------------------


def two_topics() -> DemonstrationBuilder:
    builder = DemonstrationBuilder(
        [StateTopic("state"), StateTopic("power", ("volt",))], ["action"], 10.0
    )
    builder.observe(0, "state", [1.0, 2.0])
    builder.observe(0, "power", [12.0])
    builder.act(0, "action", "go")
    return builder


@pytest.mark.parametrize(
    ("fault", "topic", "values", "named"),
    [
        (Fault.UNKNOWN_TOPIC, "pose", [1.0], "'pose'"),
        (Fault.EMPTY, "state", [], "'state'"),
        (Fault.LENGTH, "state", [1.0], "1 values where 2"),
        (Fault.LENGTH, "power", [1.0, 2.0], "2 values where 1"),
        (Fault.NOT_FINITE, "state", [1.0, math.nan], "nan at index 1"),
        (Fault.NOT_FINITE, "state", [math.inf, 1.0], "inf at index 0"),
        (Fault.TOO_LARGE, "state", [1.0, 1.1e38], "1.1e+38 at index 1"),
        (Fault.TOO_LARGE, "power", [-1e300], "-1e+300 at index 0"),
    ],
)
def test_a_bad_state_message_is_refused_and_changes_nothing(
    fault: Fault, topic: str, values: list[float], named: str
) -> None:
    spoilt, untouched = two_topics(), two_topics()
    with pytest.raises(BadMessageError) as refusal:
        spoilt.observe(250 * MS, topic, values)
    _check(refusal.value, fault, named)
    _check_same(spoilt, untouched)


@pytest.mark.parametrize(
    ("fault", "channel", "label", "named"),
    [
        (Fault.UNKNOWN_TOPIC, "arm", "go", "'arm'"),
        (Fault.UNKNOWN_TOPIC, "state", "go", "'state'"),
        (Fault.LABEL, "action", "go\n", r"'go\n'"),
        (Fault.LABEL, "action", "\0", r"'\x00'"),
        (Fault.LABEL, "action", "\ud800", r"'\ud800'"),
    ],
)
def test_a_bad_action_message_is_refused_and_changes_nothing(
    fault: Fault, channel: str, label: str, named: str
) -> None:
    spoilt, untouched = two_topics(), two_topics()
    with pytest.raises(BadMessageError) as refusal:
        spoilt.act(250 * MS, channel, label)
    _check(refusal.value, fault, named)
    _check_same(spoilt, untouched)


def test_an_action_before_the_first_state_is_refused_and_names_the_silent_topic() -> None:
    builder = DemonstrationBuilder([StateTopic("state"), StateTopic("power")], ["action"], 10.0)
    builder.observe(0, "state", [1.0])
    with pytest.raises(BadMessageError) as refusal:
        builder.act(1, "action", "go")
    _check(refusal.value, Fault.NO_STATE, "'power'")
    builder.observe(2, "power", [1.0])
    # Neither the grid nor the action had begun.
    assert builder.observe(SECOND, "power", [1.0]) == ()


@pytest.mark.parametrize("values", [[], [math.nan], [1e39], [1.0, 2.0]])
def test_a_bad_first_message_leaves_the_topic_unheard(values: list[float]) -> None:
    builder = DemonstrationBuilder([StateTopic("power", ("volt",))], ["action"])
    with pytest.raises(BadMessageError):
        builder.observe(1, "power", values)
    assert builder.features is None
    builder.observe(2, "power", [1.0])
    assert builder.act(3, "action", "go")[0].state == (1.0,)


def test_the_largest_values_are_taken() -> None:
    builder = one_topic()
    builder.observe(1, "state", [LARGEST_VALUE, -LARGEST_VALUE, 5e-324, -0.0])
    assert builder.act(2, "action", "go")[0].state[:2] == (1e38, -1e38)


def test_labels_may_hold_any_printable_character() -> None:
    builder = one_topic()
    builder.observe(1, "state", [1.0])
    assert builder.act(2, "action", "gehe über Straße 🤖")[0].action == "gehe über Straße 🤖"


def _check(refusal: BadMessageError, fault: Fault, named: str) -> None:
    text = str(refusal)
    assert isinstance(refusal, InputError)
    assert refusal.fault is fault
    assert named in text
    assert text.endswith(".")
    assert "\n" not in text
    assert text.isprintable()


def _check_same(one: DemonstrationBuilder, other: DemonstrationBuilder) -> None:
    """Both answer the same from here on."""
    assert one.features == other.features
    script = (
        lambda builder: builder.observe(310 * MS, "state", [3.0, 4.0]),
        lambda builder: builder.act(420 * MS, "action", "turn"),
        lambda builder: builder.observe(640 * MS, "power", [11.0]),
        lambda builder: builder.act(900 * MS, "action", ""),
    )
    for step in script:
        assert step(one) == step(other)


@pytest.mark.parametrize(
    ("topics", "channels", "rate", "message"),
    [
        ([], ["action"], None, "at least one"),
        (["state"], [], None, "at least one"),
        (["state", "state"], ["action"], None, "must differ"),
        (["state"], ["action", "action"], None, "must differ"),
        (["state"], ["state"], None, "must differ"),
        (["state"], ["action"], 0.0, "sample rate"),
        (["state"], ["action"], -1.0, "sample rate"),
        (["state"], ["action"], math.nan, "sample rate"),
        (["state"], ["action"], math.inf, "sample rate"),
        # A period below a nanosecond, and one beyond all numbers.
        (["state"], ["action"], 1e12, "sample rate"),
        (["state"], ["action"], 5e-324, "sample rate"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    topics: list[str], channels: list[str], rate: float | None, message: str
) -> None:
    with pytest.raises(OptionError, match=message):
        DemonstrationBuilder([StateTopic(name) for name in topics], channels, rate)


def test_field_names_of_a_topic_must_differ() -> None:
    with pytest.raises(OptionError, match="'state' must differ"):
        StateTopic("state", ("x", "x"))


#: When a message was sent, its kind, and how much later it comes than it was sent.
MESSAGES = st.lists(
    st.tuples(st.sampled_from(["pose", "power", "action"]), st.integers(0, 30)),
    max_size=40,
)


@given(MESSAGES)
def test_messages_that_come_late_make_the_rows_of_the_order_in_which_they_were_sent(
    messages: list[tuple[str, int]],
) -> None:
    """As from a bag, in which they stand in that order; all states have come before an action."""

    def rows_of(order: list[int], told: bool) -> list[Row]:
        builder = DemonstrationBuilder([StateTopic("pose"), StateTopic("power")], ["action"])
        rows: list[Row] = []
        for sent in order:
            topic = messages[sent][0]
            when = sent if told else None
            with contextlib.suppress(BadMessageError):
                if topic == "action":
                    rows += builder.act(sent, topic, "ab"[sent % 2], when)
                else:
                    rows += builder.observe(sent, topic, [float(sent)], (), when)
        return rows

    sent = list(range(len(messages)))
    # Actions keep their order, as those of one publisher do, and none overtakes a state.
    states = [one for one in sent if messages[one][0] != "action"]
    arrival = {one: one + messages[one][1] for one in states}
    latest = 0
    for one in sent:
        if messages[one][0] == "action":
            before = [arrival[state] for state in states if state < one]
            latest = max([latest, one + messages[one][1], *before])
            arrival[one] = latest
    came = sorted(sent, key=lambda one: (arrival[one], one))
    assert rows_of(came, told=True) == rows_of(sent, told=False)


def test_an_action_from_before_all_states_that_are_known_is_left_out() -> None:
    builder = one_topic()
    builder.observe(10, "state", [1.0], sent=10)
    with pytest.raises(BadMessageError) as caught:
        builder.act(11, "action", "go", sent=9)
    assert caught.value.fault is Fault.NO_STATE


def test_states_whose_sending_is_not_known_are_paired_by_arrival() -> None:
    builder = one_topic()
    builder.observe(10, "state", [1.0], sent=10)
    builder.observe(11, "state", [2.0])
    assert builder.act(12, "action", "go", sent=10)[0].state == (2.0,)
