"""CSV tables: kinds of columns, missing values, headers, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.demonstration.demonstration import DEFAULT_CHANNEL
from rebt_ros.demonstration.schema import FeatureKind
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import InputError
from rebt_ros.storage.account import Account
from rebt_ros.storage.csv_table import read_csv

SHARED = Path(__file__).resolve().parents[2].parent / "shared"


@pytest.fixture
def table(tmp_path):
    """Writes text to a file and returns its path."""

    def write(text: str | bytes) -> Path:
        path = tmp_path / "table.csv"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return write


def labels(demonstration):
    return [demonstration.actions[code] for code in demonstration.chosen]


def test_numbers_text_and_truth_values_become_columns_of_their_kind(table):
    read = read_csv(table("x,on,where,action\n1.5,True,hall,go\n-2,false,kitchen,turn\n"))
    shown = read.demonstration
    assert [(one.name, one.kind) for one in shown.features] == [
        ("x", FeatureKind.NUMERIC),
        ("on", FeatureKind.BINARY),
        ("where", FeatureKind.CATEGORICAL),
    ]
    assert shown.features[2].categories == ("hall", "kitchen")
    assert shown.states.tolist() == [[1.5, 1, 0], [-2, 0, 1]]
    assert labels(shown) == ["go", "turn"]
    assert shown.channels == (DEFAULT_CHANNEL,)
    assert shown.name == "table.csv"
    assert shown.stamps.tolist() == [0, 1]
    assert read.notes == ()


def test_an_empty_cell_is_a_missing_value(table):
    shown = read_csv(table("x,where,a\n,,go\n1,hall,turn\n  ,hall,go\n")).demonstration
    np.testing.assert_array_equal(shown.states, [[np.nan, np.nan], [1.0, 0.0], [np.nan, 0.0]])
    assert shown.features[0].kind is FeatureKind.NUMERIC


def test_truth_with_gaps_is_binary_with_missing_values(table):
    shown = read_csv(table("on,a\nTrue,go\n,turn\nfalse,go\n")).demonstration
    assert shown.features[0].kind is FeatureKind.BINARY
    np.testing.assert_array_equal(shown.states[:, 0], [1, np.nan, 0])


@pytest.mark.parametrize(
    "cells",
    ["True,1,0,FALSE", "yes,Yes,no,NO", "on,ON,off,Off", "y,Y,n,N", "1,true,no,0", "T,t,F,f"],
)
def test_spellings_of_truth_are_one_value_each(table, cells):
    one, two, three, four = cells.split(",")
    shown = read_csv(table(f"on,a\n{one},go\n{two},turn\n{three},go\n{four},go\n")).demonstration
    assert shown.features[0].kind is FeatureKind.BINARY
    assert shown.states[:, 0].tolist() == [1, 1, 0, 0]


def test_zeros_and_ones_are_numbers(table):
    shown = read_csv(table("on,a\n1,go\n0,turn\n")).demonstration
    assert shown.features[0].kind is FeatureKind.NUMERIC


def test_a_column_of_numbers_with_one_word_in_it_is_noted(table):
    read = read_csv(table("x,a\n1,go\n2,go\nfar,turn\n"))
    assert read.demonstration.features[0].categories == ("1", "2", "far")
    assert read.notes == (
        "column 'x' is taken as text, not as numbers, because line 4 holds 'far'",
    )


def test_a_few_words_among_many_numbers_are_missing_values_with_a_note(table):
    rows = "".join(f"{x},go\n" for x in range(40))
    read = read_csv(table(f"x,a\n{rows}error,turn\n7,turn\nerror,turn\n"))
    assert read.demonstration.features[0].kind is FeatureKind.NUMERIC
    assert np.flatnonzero(np.isnan(read.demonstration.states[:, 0])).tolist() == [40, 42]
    assert read.notes == (
        "column 'x' is read as numbers: 2 cells hold no number, such as 'error' on line 42, and "
        "are missing values",
    )


@pytest.mark.parametrize("cell", ["", "NA", "n/a", "NaN", "null", "-", "--", "  "])
def test_what_says_that_there_is_no_value_is_a_missing_value(table, cell):
    read = read_csv(
        table(f"x,where,on,a\n1,hall,yes,go\n{cell},{cell},{cell},turn\n2,,no,{cell}\n")
    )
    assert np.isnan(read.demonstration.states[1]).all()
    assert labels(read.demonstration) == ["go", "turn"]
    assert read.notes[-1] == "1 of 3 rows have no action and are left out"
    assert read.account == Account("rows", 3, 2, 2, {"have no action": 1})


def test_a_column_of_texts_that_hardly_recur_is_no_feature(table):
    rows = "".join(f"note {x},{x % 7},{'go' if x % 2 else 'turn'}\n" for x in range(100))
    read = read_csv(table(f"comment,x,a\n{rows}"))
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert read.notes == (
        "column 'comment' holds 100 different texts in 100 cells, such as 'note 0', and is no "
        "feature",
    )


@pytest.mark.parametrize(
    "cells",
    [
        "2026-11-27,2026-11-28",
        "2026-11-27T19:25:56Z,2026-11-27 19:25:57.5+01:00",
        "19:25,19:26:07",
        "27.11.2026,28/11/2026",
    ],
)
def test_dates_and_times_are_no_features(table, cells):
    first, second = cells.split(",")
    read = read_csv(table(f"when,x,a\n{first},1,go\n{second},2,turn\n"))
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert read.notes == ("column 'when' holds dates or times and is no feature",)


@pytest.mark.parametrize("name", ["time", "Timestamp", "index", "Unnamed: 0"])
def test_columns_that_number_or_date_the_rows_are_features_only_if_asked_for(table, name):
    text = table(f"{name},x,a\n1.5,1,go\n2.5,2,turn\n")
    read = read_csv(text)
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert read.notes == (f"column {name!r} numbers or dates the rows and is no feature",)
    asked = read_csv(text, features={name})
    assert [one.name for one in asked.demonstration.features] == [name, "x"]
    assert asked.notes == ()


@pytest.mark.parametrize("cell", ["1_000", "²"])
def test_only_what_every_tool_reads_as_a_number_is_one(table, cell):
    shown = read_csv(table(f"x,a\n{cell},go\n{cell},turn\n")).demonstration
    assert shown.features[0].categories == (cell,)


@pytest.mark.parametrize("cell", ["inf", "-Infinity", "1e39", "-1e400"])
def test_a_number_that_is_not_finite_or_too_large_is_refused_with_its_place(table, cell):
    with pytest.raises(InputError, match=rf"line 3: column 'y' holds '{cell}'"):
        read_csv(table(f"x,y,a\n1,2,go\n1,{cell},turn\n"))


def test_rows_without_an_action_are_left_out_with_one_note(table):
    read = read_csv(table("x,a\n1,go\n2,\n3, \n4,turn\n"))
    assert read.demonstration.states[:, 0].tolist() == [1, 4]
    assert read.demonstration.stamps.tolist() == [0, 3]
    assert read.notes == ("2 of 4 rows have no action and are left out",)


def test_the_label_column_may_stand_anywhere(table):
    shown = read_csv(table("x,act,y\n1,go,2\n3,turn,4\n"), labels=["act"]).demonstration
    assert [one.name for one in shown.features] == ["x", "y"]
    assert labels(shown) == ["go", "turn"]


def test_a_label_keeps_its_text_but_for_blanks_around_it(table):
    text = 'x,a\n1, go  on \n2,"say ""hi"", twice"\n3,007\n'
    read = read_csv(table(text))
    assert labels(read.demonstration) == ["go  on", 'say "hi", twice', "007"]
    assert read.notes == ("blanks around actions do not count",)


def test_an_unknown_label_column_is_refused_with_the_columns_there_are(table):
    with pytest.raises(InputError, match="no column 'nope': the columns are x, y, a"):
        read_csv(table("x,y,a\n1,2,go\n"), labels=["nope"])


def test_only_the_first_columns_are_listed(table):
    header = ",".join(f"c{index}" for index in range(20))
    with pytest.raises(InputError, match=r"c0, c1, c2, c3, c4, c5, c6, c7, …\.$"):
        read_csv(table(header + "\n" + ",".join("1" * 20) + "\n"), labels=["nope"])


def events(demonstration):
    """Channel, action and state of each row."""
    channels = [demonstration.channels[code] for code in demonstration.channel]
    return list(zip(channels, labels(demonstration), demonstration.states.tolist(), strict=True))


def test_several_label_columns_are_a_channel_each(table):
    text = "base,x,arm\ngo,1,open\n,2,open\nturn,3, \n,4,\ngo,5,close\n"
    read = read_csv(table(text), labels=["base", "arm"])
    shown = read.demonstration
    assert [one.name for one in shown.features] == ["x"]
    assert shown.channels == ("arm", "base")
    assert events(shown) == [
        ("base", "go", [1]),
        ("arm", "open", [1]),
        ("arm", "open", [2]),
        ("base", "turn", [3]),
        ("base", "go", [5]),
        ("arm", "close", [5]),
    ]
    assert shown.stamps.tolist() == [0, 0, 1, 2, 4, 4]
    assert read.notes == (
        "2 of 5 rows have no action in column 'base' and are left out of its channel",
        "2 of 5 rows have no action in column 'arm' and are left out of its channel",
    )


def test_each_channel_of_a_table_has_its_own_last_action(table):
    text = "x,arm,base\n1,open,go\n2,,turn\n3,close,go\n4,open,\n"
    shown = read_csv(table(text), labels=["arm", "base"]).demonstration
    arm, base = tabulate([shown])
    assert (arm.channel, base.channel) == ("arm", "base")
    assert (arm.actions, arm.last.tolist()) == (("close", "open"), [-1, 1, 0])
    assert (base.actions, base.last.tolist()) == (("go", "turn"), [-1, 0, 1])


def test_stamps_and_positions_serve_several_labels(table):
    shown = read_csv(table("stamp,a,b\n7,go,up\n9,,up\n"), labels=["a"]).demonstration
    assert shown.stamps.tolist() == [7]
    shown = read_csv(table("stamp,x,a,b\n7,1,go,up\n9,2,,up\n"), labels=["b", "a"]).demonstration
    assert shown.stamps.tolist() == [7, 7, 9]
    shown = read_csv(table("1,go,up\n2,turn,up\n"), labels=["1", "x2"], header=False).demonstration
    assert shown.channels == ("x1", "x2")
    assert [one.name for one in shown.features] == ["x0"]


def test_two_labels_in_a_table_of_numbers_leave_the_first_line_data(table):
    read = read_csv(table("0.4,1,0\n0.5,2,0\n"), labels=["x1", "x2"])
    assert events(read.demonstration)[:2] == [("x1", "1", [0.4]), ("x2", "0", [0.4])]
    assert read.notes == ("the first line holds data, so the columns are named x0, x1, and so on",)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (["a", "a"], "column 'a' is named twice as a label"),
        (["a", "nope"], "no column 'nope': the columns are x, a, b, c"),
        (["a", "c"], "column 'c' holds no action"),
        (["x", "a", "b", "c"], "holds no action"),
    ],
)
def test_label_columns_that_cannot_be_used_are_refused(table, wanted, message):
    with pytest.raises(InputError, match=message) as caught:
        read_csv(table("x,a,b,c\n1,go,up,\n2,turn,up,\n"), labels=wanted)
    assert str(caught.value).endswith(".")


def test_an_action_in_any_label_column_must_be_printable(table):
    with pytest.raises(InputError, match=r"line 3: the action 'u.*p' must consist of printable"):
        read_csv(table("x,a,b\n1,go,up\n2,,u\tp\n"), labels=["a", "b"])


def test_a_table_of_labels_only_is_refused(table):
    with pytest.raises(InputError, match="no column beside the actions"):
        read_csv(table("a,b\ngo,up\n"), labels=["a", "b"])


@pytest.mark.parametrize("labels", [[], ["x2"], ["2"]])
def test_columns_without_a_header_are_named_by_their_index(table, labels):
    shown = read_csv(table("1,2,go\n3,4,turn\n"), labels=labels, header=False).demonstration
    assert [one.name for one in shown.features] == ["x0", "x1"]
    assert len(shown) == 2


def test_a_first_line_of_numbers_is_data_with_a_note(table):
    read = read_csv(table("0.4,3.5,go\n0.5,3.5,turn\n"))
    assert read.demonstration.states.tolist() == [[0.4, 3.5], [0.5, 3.5]]
    assert read.notes == ("the first line holds data, so the columns are named x0, x1, and so on",)


def test_indices_as_column_names_are_a_header(table):
    shown = read_csv(table("0,1,action\n5,6,go\n7,8,turn\n")).demonstration
    assert [one.name for one in shown.features] == ["0", "1"]
    assert labels(shown) == ["go", "turn"]


def test_a_first_row_that_looks_like_indices_is_data_when_its_action_recurs(table):
    assert len(read_csv(table("0,1,go\n5,6,go\n7,8,turn\n")).demonstration) == 3


def test_a_header_that_was_declared_absent_is_refused(table):
    with pytest.raises(InputError, match="the first line says 'x' above a column of numbers"):
        read_csv(table("x,y,a\n1,2,go\n3,4,turn\n"), header=False)


def test_how_the_actions_ended_is_no_feature_and_is_noted(table):
    read = read_csv(table("x,action.outcome,y.outcome,action\n1,success,a,go\n2,failure,b,go\n"))
    assert [feature.name for feature in read.demonstration.features] == ["x", "y.outcome"]
    assert read.notes == ("column 'action.outcome' says how actions ended and is no feature",)


def test_a_stamp_column_of_integers_is_the_stamp(table):
    shown = read_csv(table("stamp,x,a\n1700000000000000001,1,go\n1700000000000000002,2,go\n"))
    assert [one.name for one in shown.demonstration.features] == ["x"]
    assert shown.demonstration.stamps.tolist() == [1700000000000000001, 1700000000000000002]


def test_a_stamp_column_of_other_values_is_no_feature_either(table):
    read = read_csv(table("stamp,x,a\n0.5,1,go\n0.6,2,go\n"))
    assert [one.name for one in read.demonstration.features] == ["x"]
    assert "does not hold integers" in read.notes[0]
    asked = read_csv(table("stamp,x,a\n0.5,1,go\n0.6,2,go\n"), features={"stamp"})
    assert [one.name for one in asked.demonstration.features] == ["stamp", "x"]


def test_byte_order_mark_line_ends_and_blank_lines_do_not_matter(table):
    shown = read_csv(table(b"\xef\xbb\xbfx,a\r\n\r\n1,go\r\n2,turn\r\n\r\n")).demonstration
    assert [one.name for one in shown.features] == ["x"]
    assert labels(shown) == ["go", "turn"]


def test_line_numbers_count_line_breaks_inside_cells(table):
    with pytest.raises(InputError, match="line 5: column 'y' holds 'inf'"):
        read_csv(table('x,y,a\n"two\nlines",1,go\n\nb,inf,go\n'))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("\n\n", "is empty"),
        ("x,a\n", "has no rows"),
        ("x,a\n1,\n2,\n", "column 'a' holds no action"),
        ("x,y,a\n1,2,go\n1,go\n", "line 3: there are 2 cells where 3 were expected"),
        ("x,y,a\n1,2,go\n1,2,3,go\n", "line 3: there are 4 cells where 3 were expected"),
        ("x,x,a\n1,2,go\n", "two columns are named 'x'"),
        ("x\n1\n", "single column"),
        ("stamp,a\n1,go\n", "no column beside the actions"),
        ('x,a\n1,"go\n', "line 2: this is not CSV"),
        ('x,a\n1,"go\nup"\n', "line 2: the action .* printable"),
        (b"x,a\n1,go\n1,\xff\n", "line 3: this is not UTF-8"),
        (b"x,a\n1,g\0o\n", "not a text file"),
    ],
)
def test_what_is_no_table_is_refused_with_one_sentence(table, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read_csv(table(text))
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_missing_files_and_directories_are_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_csv(tmp_path / "nothing.csv")
    with pytest.raises(InputError, match="is a directory"):
        read_csv(tmp_path)


@given(
    st.lists(
        st.tuples(
            st.floats(-1e38, 1e38), st.sampled_from(["go", "turn, left", 'say "hi"', "über"])
        ),
        min_size=1,
        max_size=20,
    )
)
def test_every_bit_of_a_number_and_every_label_survives(tmp_path_factory, rows):
    import csv

    path = tmp_path_factory.mktemp("csv") / "table.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("x", "a"), *((repr(x), label) for x, label in rows)])
    shown = read_csv(path).demonstration
    assert shown.states[:, 0].tobytes() == np.array([x for x, _ in rows]).tobytes()
    assert labels(shown) == [label for _, label in rows]


@pytest.mark.skipif(not SHARED.exists(), reason="third-party data is not beside the checkout")
class TestRealData:
    def test_the_robot_tutor(self):
        read = read_csv(SHARED / "data" / "tutor.csv", labels=["/robot_dialogue"])
        assert read.notes == (
            "186 of 1000 rows have no action and are left out",
            "column '/Time' numbers or dates the rows and is no feature",
        )
        assert len(read.demonstration) == 814
        kinds = {one.name: one.kind for one in read.demonstration.features}
        assert kinds["/ExerciseSubmissionResult"] is FeatureKind.BINARY
        assert kinds["/IsNewExercise"] is FeatureKind.BINARY
        assert kinds["/KC"] is FeatureKind.NUMERIC

    def test_the_wall_following_robot_needs_no_options(self):
        read = read_csv(SHARED / "data" / "scitos_g5_24.csv")
        assert read.demonstration.states.shape == (5456, 24)
        assert len(read.demonstration.actions) == 4
        assert "holds data" in read.notes[0]
