"""Rules that stand in robot files count wherever those are used."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import robot_bags as some_bags
import strategies as some

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.commands import learn as learn_command
from rebt_ros.errors import RebtError
from rebt_ros.offline.check_and_explain import check, repaired
from rebt_ros.offline.learning_from_files import learn
from rebt_ros.offline.rules_files import rules_for
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.verification import rules_file
from rebt_ros.verification.errors import RuleError
from rebt_ros.verification.robot_rules import rules_of, together
from rebt_ros.verification.verdict import Answer

STATE = "state: {distance: /a.b}\nrules:\n"


def rules_in(text: str) -> str:
    return f"{STATE}{text}"


def refusal(text: str, tree: nodes.Node = some.ACTIONS[0]) -> str:
    robot = parse_robot_file(rules_in(text), "robot.yaml")
    with pytest.raises(RuleError) as caught:
        check(some.learned(tree), rules_of(robot))
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- never: go\n  when: distance << 1", "line 4, column 19: a feature or a number is expec"),
        ("- {never: go, when: 'distance <'}", "line 3, column 32: a feature or a number is expect"),
        ("- never: fly", "line 3, column 10: there is no action 'fly': there are go, grasp"),
        (
            "- never: go\n  when: distance < 1 and far",
            "line 4, column 26: there is no feature 'far",
        ),
        (
            "- never: go\n- always: go",
            "line 4, column 11: 'always go' contradicts 'never go' of ro",
        ),
    ],
)
def test_what_is_wrong_has_its_line_and_column(text: str, said: str) -> None:
    assert refusal(text).startswith(f"robot.yaml, {said}")


def test_what_is_carried_tells_which_rule_is_wrong() -> None:
    robot = parse_robot_file(rules_in("- never: go\n- never: fly"), "robot.yaml")
    carried = loads(dumps(replace(some.learned(some.ACTIONS[0]), robot=robot)))
    with pytest.raises(
        RuleError, match=r"^the document's robot file, rule 2: there is no action 'f"
    ):
        check(carried)


def test_a_tree_is_checked_by_the_rules_of_the_robot_file_it_carries() -> None:
    robot = parse_robot_file(rules_in("- never: go\n  when: distance < 0.3"), "robot.yaml")
    learned = replace(some.learned(some.ACTIONS[0]), robot=robot)
    [verdict] = check(learned).verdicts
    assert verdict.answer is Answer.BROKEN
    both = check(learned, rules_file.loads("rules: [{never: turn}]", "rules.yaml")).verdicts
    assert [one.answer for one in both] == [Answer.PROVEN, Answer.BROKEN]


def test_rules_of_several_files_are_asked_once_and_contradict_each_other() -> None:
    robot = parse_robot_file(rules_in("- never: go"), "robot.yaml")
    same = rules_file.loads("rules: [{never: go}, {never: turn}]", "rules.yaml")
    assert [str(one) for one in together(same, rules_of(robot)).rules] == ["never go", "never turn"]
    assert together(None, rules_of(parse_robot_file("state: {a: /a.b}"))) is None
    opposite = rules_file.loads("rules: [{always: go}]", "rules.yaml")
    with pytest.raises(RuleError, match=r"robot\.yaml, line 3, column 10: 'never go' contradicts"):
        check(some.learned(some.ACTIONS[0]), rules_for(opposite, robot))


def test_a_bag_is_learned_from_only_where_the_robot_files_rules_are_kept(tmp_path: Path) -> None:
    bag = some_bags.write_bag(tmp_path / "bag", some_bags.shown())
    text = some_bags.ROBOT_FILE + "rules:\n  - never: forward\n    when: ahead < 5.05\n"
    reading = InputOptions(robot=parse_robot_file(text, "robot.yaml"))
    with pytest.raises(
        RuleError, match=r"^nothing is written: it breaks 'never forward when ahead"
    ):
        learn([bag], out=tmp_path / "learned", reading=reading)
    assert not (tmp_path / "learned").exists()
    result = learn([bag], out=tmp_path / "learned", reading=reading, repair=True)
    tree = loads((tmp_path / "learned" / "tree.json").read_text())
    assert tree == result.learned
    assert [one.answer for one in check(tree).verdicts] == [Answer.PROVEN]
    assert tree.provenance.mended.rows == result.learned.provenance.rows
    assert tree.provenance.mended.changed > 0
    summary = json.loads((tmp_path / "learned" / "summary.json").read_text())
    assert summary["rules"] == [{"rule": "never forward when ahead < 5.05", "answer": "proven"}]
    before, after = summary["mended"]["agreement"]
    # The demonstrator did go there.
    assert after < before == 1.0
    [replayed] = rebt_ros.replay(result.learned, [bag])
    assert replayed.teacher_forced_agreement == pytest.approx(after)


def test_learn_writes_no_tree_that_breaks_a_rule(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "shown.csv"
    rows = [f"{step / 20},{'go' if step > 4 else 'turn'}" for step in range(20)]
    table.write_text("\n".join(("distance,action", *rows * 5)) + "\n")
    rules = tmp_path / "rules.yaml"
    rules.write_text(
        "rules:\n- never: go\n  when: distance < 0.3\n- never: turn\n  when: distance > 1\n"
    )
    command = [str(table), "--rules", str(rules), "--out", str(tmp_path / "learned")]
    with pytest.raises(SystemExit) as ended:
        learn_command.main(command)
    assert ended.value.code == 1
    said = capsys.readouterr().err
    assert said.startswith("learn: nothing is written: it breaks 'never go when distance < 0.3'")
    assert said.count("\n") == 1
    assert not (tmp_path / "learned").exists()
    learn_command.main([*command, "--repair"])
    out = capsys.readouterr().out
    assert "All 2 rules are proven." in out
    assert "Guards make it keep its rules: +" in out
    rules.write_text("rules:\n- never: go\n  when: distance << 0.3\n")
    with pytest.raises(SystemExit):
        learn_command.main([*command, "--repair"])
    assert "rules.yaml, line 3, column 19" in capsys.readouterr().err


def test_a_document_whose_guards_are_none_is_refused() -> None:
    robot = parse_robot_file(rules_in("- never: go\n  when: distance < 0.3"), "robot.yaml")
    mended = repaired(check(replace(some.learned(some.ACTIONS[0]), robot=robot))).learned
    assert loads(dumps(mended)) == mended
    document = json.loads(dumps(mended))
    document["provenance"]["mended"]["agreement"] = [0.5]
    with pytest.raises(RebtError, match="agreement"):
        loads(json.dumps(document))
