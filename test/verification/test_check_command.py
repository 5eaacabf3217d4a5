"""``check`` says which rules a tree keeps, and what is noticeable about it."""

from __future__ import annotations

from pathlib import Path

import pytest
import strategies as some

from rebt_ros.behavior_tree import nodes
from rebt_ros.commands import check
from rebt_ros.demonstration.schema import Feature
from rebt_ros.storage.tree_file import write_tree
from rebt_ros.verification import comparing, proof, sweep
from rebt_ros.verification.errors import TooManyPartsError

GO, GRASP, TURN, WAIT = some.ACTIONS
NEAR = some.at_most("distance", 0.3)
CAREFUL = nodes.Selector((some.when(NEAR, then=TURN), GO))


def tree_file(directory: Path, tree: nodes.Node, name: str = "tree.json") -> str:
    write_tree(directory / name, some.learned(tree))
    return str(directory / name)


def rules_file(directory: Path, text: str) -> str:
    path = directory / "rules.yaml"
    path.write_text(f"rules:\n{text}")
    return str(path)


def table_file(directory: Path) -> str:
    path = directory / "shown.csv"
    path.write_text(
        "distance,battery,docked,kind,action\n"
        "0.9,0.5,0,box,go\n0.8,0.5,1,cup,go\n0.25,0.4,0,box,turn\n0.2,0.5,1,tool,go\n"
    )
    return str(path)


def test_rules_that_are_kept_are_proven(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rules = rules_file(tmp_path, "- never: go\n  when: distance < 0.3\n")
    check.main([tree_file(tmp_path, CAREFUL), "--rules", rules])
    assert "proven   never go when distance < 0.3" in capsys.readouterr().out


def test_a_broken_rule_is_exit_code_1_with_a_witness_the_region_and_the_nearest_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = rules_file(
        tmp_path, "- never: go\n  when: distance < 0.5\n- always: turn\n  when: distance < 0.1\n"
    )
    with pytest.raises(SystemExit) as ended:
        check.main([tree_file(tmp_path, CAREFUL), table_file(tmp_path), "--rules", rules])
    assert ended.value.code == 1
    out = capsys.readouterr().out
    assert "BROKEN   never go when distance < 0.5" in out
    assert "broken where 0.3 < distance < 0.5" in out
    assert "nearest row that was shown: row 2 of shown.csv (turn)" in out
    assert "2 of 4 rows were shown in such states, 1 of them with go" in out
    assert "proven   always turn when distance < 0.1" in out
    assert "none of the 4 rows was shown in such a state" in out


def test_a_tree_is_repaired_and_what_that_changes_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = rules_file(tmp_path, "- never: go\n  when: distance < 0.5 or docked\n")
    mended = str(tmp_path / "mended.json")
    tree = tree_file(tmp_path, CAREFUL)
    check.main([tree, table_file(tmp_path), "--rules", rules, "--repair", mended])
    out = capsys.readouterr().out
    assert f"Written to {mended}: +4 nodes, 1 of 4 rows changed, agreement with them from" in out
    assert "; all rules are proven." in out
    check.main([mended, "--rules", rules])
    assert "proven   never go when distance < 0.5 or docked" in capsys.readouterr().out


def test_what_is_noticeable_is_said_without_rules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far = ~NEAR
    tree = nodes.Selector(
        (
            some.when(some.at_most("distance", 0.1), NEAR, then=TURN),
            some.when(NEAR, far, then=GRASP),
            some.when(some.at_most("battery", 0.2), then=WAIT),
        )
    )
    check.main([tree_file(tmp_path, tree), table_file(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    assert "never reached: grasp" in lines
    assert "never decides: distance ≤ 0.3" in lines
    assert "never decides: distance > 0.3" in lines
    assert "shown, but never chosen: go" in lines
    assert any(line.startswith("nothing is commanded where") for line in lines)
    assert "never shown: turn where distance ≤ 0.1" in lines


def test_a_good_tree_has_nothing_noticeable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tree(tmp_path / "tree.json", some.learned(CAREFUL))
    check.main([str(tmp_path / "tree.json"), table_file(tmp_path)])
    out = capsys.readouterr().out
    # The vocabulary of these tests has more actions than were shown.
    assert out.splitlines() == ["shown, but never chosen: grasp", "shown, but never chosen: wait"]


def test_two_trees_are_compared_region_by_region(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bold = nodes.Selector((some.when(some.at_most("distance", 0.2), then=TURN), GO))
    mine, other = tree_file(tmp_path, CAREFUL), tree_file(tmp_path, bold, "bold.json")
    check.main([mine, table_file(tmp_path), "--against", other])
    out = capsys.readouterr().out
    assert "turn instead of go where 0.2 < distance ≤ 0.3" in out
    assert "1 row that was shown lies there" in out
    check.main([mine, "--against", mine])
    assert "both do the same in every state." in capsys.readouterr().out


def test_with_action_results_a_rule_may_be_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = rules_file(tmp_path, "- never: go\n  when: distance < 0.3\n")
    with pytest.raises(SystemExit):
        check.main([tree_file(tmp_path, CAREFUL), "--rules", rules, "--action-results"])
    assert "UNKNOWN  never go when distance < 0.3" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("- never: go\n  when: front < 0.3\n", "line 3, column 9: there is no feature 'front'"),
        ("- never: go\n- always: go\n  when: docked\n", "contradicts 'never go'"),
    ],
)
def test_what_is_wrong_with_rules_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, why: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        check.main([tree_file(tmp_path, CAREFUL), "--rules", rules_file(tmp_path, text)])
    assert ended.value.code == 1
    assert why in capsys.readouterr().err


def test_channels_in_one_policy_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mixed = nodes.Sequence((nodes.Action("stop", "arm"), nodes.Action("stop", "base")))
    with pytest.raises(SystemExit):
        check.main([tree_file(tmp_path, mixed)])
    assert "mixes the channel 'base' with others" in capsys.readouterr().err


def test_where_branches_overlap_too_much_rules_are_answered_all_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Of twelve features, each branch asks two: more parts than the few that are looked at here.
    names = [f"f{place}" for place in range(12)]
    asked = [
        (some.at_most(one, 0.3), ~some.at_most(other, 0.6))
        for place, one in enumerate(names)
        for other in names[place + 1 :]
    ]
    tree = nodes.Selector(
        (*(some.when(*tests, then=(GO, TURN)[k % 2]) for k, tests in enumerate(asked)), WAIT)
    )
    write_tree(tmp_path / "tree.json", some.learned(tree, [Feature(name) for name in names]))
    text = "- never: go\n  when: f0 <= 0.1\n- never: wait\n  when: f0 <= 0.1 and f1 > 0.6\n"
    text += "- never: wait\n  when: f0 > 0.5\n"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(proof, "_MOST_PARTS", 5)
        patched.setattr(proof, "_MOST_PER_NODE", 0)
        patched.setattr(sweep, "_MOST_PARTS", 5)
        with pytest.raises(SystemExit):
            check.main([str(tmp_path / "tree.json"), "--rules", rules_file(tmp_path, text)])
    out = capsys.readouterr().out
    assert "BROKEN   never go when f0 <= 0.1" in out
    assert "broken where " in out
    # A state beside what is shown breaks it: other regions are not looked at.
    assert "BROKEN   never wait when f0 > 0.5" in out
    assert "broken in more regions than can be listed" in out
    assert "proven   never wait when f0 <= 0.1 and f1 > 0.6" in out
    assert "What else is noticeable is not known: the branches of the tree overlap" in out


def test_of_trees_whose_branches_overlap_too_much_known_differences_are_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def too_many_parts(*_: object) -> None:
        raise TooManyPartsError

    (tmp_path / "other").mkdir()
    other = nodes.Selector((some.when(some.at_most("distance", 0.3), then=TURN), GO))
    files = [tree_file(tmp_path, GO), "--against", tree_file(tmp_path / "other", other)]
    unknown = "whether the trees do the same elsewhere is unknown"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(comparing, "_all_differing", too_many_parts)
        check.main(files)
        out = capsys.readouterr().out
        # Of such small trees, all of them are known nevertheless.
        assert "go instead of turn where distance ≤ 0.3" in out
        assert unknown not in out
        patched.setattr(comparing, "_MOST_SPLIT", 0)
        check.main(files)
    out = capsys.readouterr().out
    assert unknown in out
    assert "both do the same" not in out
