"""Arguments that make no sense are refused in words of their own, before anything is done."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import rebt_ros
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.commands import experiment, generate, learn, simulate
from rebt_ros.commands.shell import parse
from rebt_ros.demonstration.builder import StateTopic
from rebt_ros.demonstration.demonstration import RowKind
from rebt_ros.errors import RebtError

COMMANDS: Mapping[str, Callable[[list[str]], None]] = {
    "experiment": experiment.main,
    "generate": generate.main,
    "learn": learn.main,
    "simulate": simulate.main,
}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("learn x.csv --max-depth 3.5", "'3.5' is neither a whole number nor auto"),
        ("learn x.csv --max-depth many", "'many' is neither a whole number nor auto"),
        ("learn x.csv --ccp-alpha small", "'small' is neither a number nor auto"),
        ("learn x.csv --reaction-time 0,3", "'0,3' is neither a number nor auto"),
        ("learn x.csv --history lat", "'lat' is none of auto, none, previous, last"),
        ("learn x.csv --root priority", "'priority' is none of "),
        ("learn x.csv --psa yes", "'yes' is none of auto, always, never"),
        ("learn x.csv --psa-as choice", "'choice' is none of "),
        ("learn x.csv --differences no", "'no' is none of auto, always, never"),
        ("learn x.csv --upsample smote", "'smote' is none of none, svm-smote"),
        ("learn x.csv --rows action", "'action' is none of event, sample"),
        ("learn x.csv --unit left:m", "'left:m' is not FEATURE=UNIT"),
        ("learn x.csv --out FILE", "is no directory: name another place"),
        ("learn x.csv --out FILE/learned", "is no directory: name another place"),
        ("simulate x.json --out FILE", "is no directory: name another place"),
        ("simulate x.json --bag rosbag", "'rosbag' is none of "),
        ("generate 3 --out FILE", "is no directory: name another place"),
        ("experiment DIRECTORY/nowhere", "nowhere is no directory: name one of configuration"),
    ],
)
def test_what_an_argument_cannot_be_is_said_in_words(
    line: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    line = line.replace("FILE", str(file)).replace("DIRECTORY", str(tmp_path))
    command, *arguments = line.split()
    with pytest.raises(SystemExit) as ended:
        COMMANDS[command](arguments)
    assert ended.value.code in (1, 2)
    output = capsys.readouterr()
    assert said in output.err
    assert not output.out
    # Names of Python are no words of a user.
    assert "_" not in output.err.splitlines()[-1].replace(str(tmp_path), "")


def test_an_input_without_a_name_is_not_the_current_directory(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        learn.main(["", "--out", "x"])
    assert "an input needs a name" in capsys.readouterr().err


@pytest.mark.parametrize("line", ["x -a 1 y z", "x y z -a 1", "-a 1 x y z", "x y -a 1 z"])
def test_options_may_stand_anywhere_among_inputs(line: str) -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("first")
    parser.add_argument("inputs", nargs="+")
    parser.add_argument("-a")
    parsed = parse(parser, line.split())
    assert (parsed.first, parsed.inputs, parsed.a) == ("x", ["y", "z"], "1")


def test_names_that_begin_with_a_dash_are_inputs_behind_two_dashes() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("inputs", nargs="+")
    parser.add_argument("-a")
    assert parse(parser, ["-a", "1", "--", "-x", "-y"]).inputs == ["-x", "-y"]


def _learn(inputs: Any = "nowhere.csv", **options: Any) -> None:
    rebt_ros.learn(inputs, **options)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: _learn(5), "5 is no input"),
        (lambda: _learn(None), "None is no input"),
        (lambda: _learn(b"x.csv"), "b'x.csv' is no input"),
        (lambda: _learn(["x.csv", None]), "None is no input"),
        (lambda: _learn(""), "'' is no input"),
        (lambda: _learn(out=""), "out must name a directory, not ''"),
        (lambda: _learn(out=3), "out must name a directory, not 3"),
        (lambda: _learn(options={"delta": 0.2}), "options must be LearnOptions"),
        (lambda: _learn(reading={"labels": "a"}), "reading must be InputOptions"),
        (lambda: _learn(declared={"x": "truth"}), "the kind of 'x' must be one of numeric, binary"),
        (lambda: _learn(declared="x"), "declared must be kinds by names"),
        (lambda: rebt_ros.InputOptions(labels=5), "labels must be texts, not 5"),
        (lambda: rebt_ros.InputOptions(action_topics=[None]), "action_topics must be texts"),
        (lambda: rebt_ros.InputOptions(state_topics=[3]), "state_topics must be names"),
        (lambda: rebt_ros.InputOptions(row_kind="rows"), "row_kind must be one of event, sample"),
        (lambda: rebt_ros.InputOptions(header="no"), "header must be True or False, not 'no'"),
        (lambda: rebt_ros.InputOptions(sample_rate="10"), "sample_rate must be a number or None"),
        (lambda: rebt_ros.InputOptions(robot="robot.yaml"), "robot must be a RobotFile or None"),
        (lambda: rebt_ros.LearnOptions(last_action="never"), "is the option history: say 'none'"),
    ],
)
def test_what_a_call_cannot_take_is_said_in_a_sentence(
    call: Callable[[], object], said: str
) -> None:
    with pytest.raises(RebtError) as refused:
        call()
    assert said in str(refused.value)
    assert str(refused.value).endswith(".")


def test_a_word_stands_for_a_tuple_of_it_and_for_an_enum() -> None:
    options = rebt_ros.InputOptions(
        labels="a", channels=["b", "c"], action_topics="/d", state_topics="/e", row_kind="event"
    )
    assert (options.labels, options.channels, options.action_topics) == (
        ("a",),
        ("b", "c"),
        ("/d",),
    )
    assert options.state_topics == (StateTopic("/e"),)
    assert options.row_kind is RowKind.EVENT
    assert replace(options, header=False).labels == ("a",)
    assert replace(rebt_ros.LearnOptions(root="parallel"), delta=0.1).root is Root.PARALLEL
