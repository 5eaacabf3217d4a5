"""The commands as a user runs them: what they write, print, and how they refuse."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
import warm_processes

from rebt_ros.storage.btlog import read_btlog
from rebt_ros.storage.tree_file import read_tree

TABLE = "front,docked,action\n" + "".join(
    f"{front / 10},{docked},{'charge' if docked else 'turn' if front < 5 else 'go'}\n"
    for docked in (0, 1)
    for front in range(10)
    for _ in range(4)
)


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs a command where nothing of ROS can be imported."""
    return warm_processes.run(f"rebt_ros.commands.{arguments[0]}", *arguments[1:], ros=False)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tables") / "table.csv"
    path.write_text(TABLE)
    return path


@pytest.fixture(scope="module")
def learned(table: Path) -> Path:
    out = table.parent / "learned"
    done = run("learn", table, "--out", out, "--test-fraction", "0")
    assert done.returncode == 0, done.stderr
    return out


def test_learn_writes_tree_summary_and_pictures_without_ros(learned: Path) -> None:
    assert {"tree.json", "summary.json", "tree.svg", "tree.dot", "tree.txt"} <= {
        path.name for path in learned.iterdir()
    }
    summary = json.loads((learned / "summary.json").read_text())
    assert summary["rows"] == 80
    assert summary["demonstrations"] == 1
    assert summary["features"] == ["front", "docked"]
    assert summary["actions"] == ["charge", "go", "turn"]
    assert summary["fidelity_mismatches"] == 0
    assert summary["nodes"] == 8
    assert summary["intervals"] == 0
    assert {"ccp_alpha", "teacher_forced_agreement", "own_history_agreement"} <= set(summary)
    assert {action.label for action in read_tree(learned / "tree.json").actions} == {
        "charge",
        "go",
        "turn",
    }


def test_learn_prints_the_tree_as_a_person_would_say_it(table: Path, tmp_path: Path) -> None:
    done = run("learn", table, "--out", tmp_path)
    assert done.returncode == 0
    for line in ("--> docked", "--> charge", "front", "Learned a behavior tree", "own history"):
        assert line in done.stdout
    assert "\033[" not in done.stdout


def test_learn_follows_its_options(table: Path, tmp_path: Path) -> None:
    done = run(
        "learn", table, "--out", tmp_path, "--root", "parallel", "--max-depth", "1", "--refit",
        "--history", "none", "--ccp-alpha", "0", "--delta", "0.1", "--test-fraction", "0.5",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["root"] == "parallel"
    assert summary["decision_tree_leaves"] == 2
    assert summary["delta"] == 0.1
    assert summary["held_out_rows"] == 40
    assert summary["refit"] is True


def test_learn_counts_the_intervals_unless_they_are_kept_apart(tmp_path: Path) -> None:
    rows = [
        (place / 10, inside, "turn" if not 3 < place <= 7 else "charge" if inside else "go")
        for place in range(11)
        for inside in (0, 1)
    ]
    lines = [f"{front},{inside},{action}" for front, inside, action in rows * 4]
    path = tmp_path / "table.csv"
    path.write_text("\n".join(["front,docked,action", *lines]) + "\n")
    sizes = {}
    # Two rules ask for the same one.
    for option, intervals in (("default", 2), ("--no-intervals", 0), ("--paper", 0)):
        options = [] if option == "default" else [option]
        done = run("learn", path, "--out", tmp_path, "--test-fraction", "0", *options)
        assert done.returncode == 0, done.stderr
        summary = json.loads((tmp_path / "summary.json").read_text())
        assert summary["intervals"] == intervals
        assert ("0.35 < front ≤ 0.75" in done.stdout) is (intervals > 0)
        sizes[option] = summary["nodes"]
    assert sizes["default"] < sizes["--no-intervals"] < sizes["--paper"]


def test_two_label_columns_are_learned_and_replayed_as_two_channels(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    rows = (
        f"{'grasp' if near else 'open'},{near / 10},{'wait' if blocked else 'go'},{blocked}\n"
        for _ in range(6)
        for near in (0, 3, 7)
        for blocked in (0, 1)
    )
    table.write_text("arm,distance,base,blocked\n" + "".join(rows))
    labels = ("--label", "arm", "--label", "base")
    done = run("learn", table, *labels, "--out", tmp_path, "--test-fraction", "0")
    assert done.returncode == 0, done.stderr
    tree = read_tree(tmp_path / "tree.json")
    assert [feature.name for feature in tree.features] == ["distance", "blocked"]
    assert {(one.channel, one.label) for one in tree.actions} == {
        ("arm", "grasp"),
        ("arm", "open"),
        ("base", "go"),
        ("base", "wait"),
    }
    done = run("replay", tmp_path / "tree.json", table, *labels)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("100.00%") >= 2


def test_replay_shows_agreement_confusion_and_disagreements(learned: Path, table: Path) -> None:
    other = table.parent / "other.csv"
    other.write_text(TABLE.replace("0.2,0,turn", "0.2,0,go", 1))
    logged = table.parent / "other.btlog"
    done = run("replay", learned / "tree.json", other, "--btlog", logged)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(f"\nWhat each node did is in {logged}.\n")
    assert read_btlog(logged).transitions
    assert "98.75%" in done.stdout
    lines = done.stdout.splitlines()
    header = next(line for line in lines if line.startswith("shown"))
    go = next(line for line in lines if line.startswith("go "))
    assert header.split()[3:] == ["charge", "go", "turn"]
    assert go.split()[1:] == ["·", "20", "1"]
    assert len(go) == len(header)
    first = next(line for line in lines if line.startswith("other"))
    assert first.split()[1:] == ["8", "go", "turn"]


@pytest.mark.parametrize(
    "command",
    [
        ("learn", "--out", "OUT"),
        ("replay", "TREE"),
        ("inspect",),
        ("suggest-rules",),
        ("check", "TREE"),
        ("explain", "TREE", "--row", "0"),
    ],
)
def test_every_command_tells_how_it_read_what_it_was_given(
    learned: Path, tmp_path: Path, command: tuple[str, ...]
) -> None:
    odd = tmp_path / "odd.csv"
    lines = TABLE.splitlines()
    odd.write_text("\n".join([*lines, "0.3,1,", "0.3,1,"]) + "\n")
    words = {"TREE": str(learned / "tree.json"), "OUT": str(tmp_path / "out")}
    name, *given = (words.get(one, one) for one in command)
    done = run(name.replace("-", "_"), *given, odd)
    assert done.returncode == 0, done.stderr
    said = (done.stdout + done.stderr).splitlines()
    assert said.count("note: odd.csv: 2 of 82 rows have no action and are left out.") == 1


def test_replay_names_actions_that_the_tree_does_not_have(learned: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text(TABLE.replace(",go", ",GO").replace(",turn", ",1"))
    done = run("replay", learned / "tree.json", other)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("note: '1', 'GO' are no actions of the tree, which cannot agree")
    assert "in 40 of 80 rows" in done.stdout.splitlines()[0]


def test_how_the_inputs_were_read_is_told_where_nothing_can_be_learned(tmp_path: Path) -> None:
    signs = tmp_path / "signs.csv"
    signs.write_text("x,action\n" + "".join(f"{x},{'+-'[x % 2]}\n" for x in range(20)))
    done = run("learn", signs, "--out", tmp_path / "out")
    assert done.returncode == 1
    assert "one action only ('+')" in done.stderr
    assert done.stdout.splitlines() == [
        "note: signs.csv: '-' is taken for no action: write it out if it is one.",
        "note: signs.csv: 10 of 20 rows have no action and are left out.",
    ]


def test_replay_refuses_a_recording_without_the_features_of_the_tree(
    learned: Path, tmp_path: Path
) -> None:
    foreign = tmp_path / "foreign.csv"
    foreign.write_text("speed,action\n1.0,go\n2.0,turn\n")
    done = run("replay", learned / "tree.json", foreign)
    assert done.returncode == 1
    assert "'docked'" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("learn", "nowhere.csv"), "nowhere.csv does not exist"),
        (("learn", "TABLE", "--label", "nix"), "'nix'"),
        (("learn", "NUMBERS"), "do not look like actions"),
        (("learn", "TABLE", "--label", "docked", "--label", "docked"), "'docked' is named twice"),
        (("learn", "TABLE", "--delta", "2"), "delta must lie between 0 and 1"),
        (("learn", "TABLE", "--max-depth", "0"), "max_depth must be at least 1"),
        (("learn", "TABLE", "--root", "sequence"), "Sequence root"),
        (("learn", "TABLE", "--attach", "psa-9"), "'psa-9'"),
        (("learn", "TABLE", "--binary", "front"), "'front' cannot be binary"),
        (("learn", "TABLE", "--categorical", "wheel"), "no feature 'wheel'"),
        (("learn", "TABLE", "--unit", "wheel=m"), "no feature 'wheel', which is given a unit"),
        (("replay", "TABLE", "TABLE"), "is a demonstration, and no tree"),
        (("replay", "nowhere.json", "TABLE"), "nowhere.json"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence_with_exit_code_1(
    table: Path, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    numbers = tmp_path / "numbers.csv"
    numbers.write_text("x,y\n" + "".join(f"{one},{one / 7}\n" for one in range(50)))
    given = [{"TABLE": table, "NUMBERS": numbers}.get(one, one) for one in arguments]
    extra = ["--out", tmp_path / "out"] if arguments[0] == "learn" else []
    done = run(*given, *extra)
    assert done.returncode == 1
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_what_was_learned_before_stays_when_learning_fails(learned: Path, table: Path) -> None:
    before = (learned / "tree.json").read_bytes()
    one_action = table.parent / "one.csv"
    one_action.write_text("x,action\n1,go\n2,go\n")
    done = run("learn", one_action, "--out", learned)
    assert done.returncode == 1
    assert "one action only" in done.stderr
    assert (learned / "tree.json").read_bytes() == before
