"""Trials without a robot: who drives, who goes on, who wins, and what is refused."""

from __future__ import annotations

import contextlib
import json
import math
import random
import re
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
import warm_processes
from hypothesis import assume, given
from hypothesis import strategies as st
from trial_examples import BAD, GO, GOOD, LEFT, learned

from rebt_ros.behavior_tree.document import dumps
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.nodes import Selector
from rebt_ros.errors import InputError, OptionError
from rebt_ros.storage.tree_file import write_tree
from rebt_ros.trial.candidates import Candidate, distinct, of_files, of_levels
from rebt_ros.trial.driven import read_driven, write_driven
from rebt_ros.trial.halving import FEWEST_EPISODES, Trial, going_on, places, ranked, rounds_of
from rebt_ros.trial.outcome import Ending, Episode, success_of
from rebt_ros.trial.result import TrialResult, as_json, table, verdict
from rebt_ros.trial.settings import StartParameter, TrialSettings
from rebt_ros.trial.tally import Tally

#: How often each of some candidates succeeds, and the size of its tree.
FIELDS = st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(1, 50)), min_size=1, max_size=12)
EPISODES = st.integers(1, 60)


@st.composite
def tallies(draw: st.DrawFn) -> Tally:
    episodes = draw(st.integers(1, 300))
    return Tally(draw(st.integers(0, episodes)), episodes)


# --- what a share is worth ---


@given(tallies())
def test_the_interval_lies_within_0_and_1_and_around_the_share(tally: Tally) -> None:
    low, high = tally.interval
    assert tally.share is not None
    assert 0.0 <= low <= tally.share <= high <= 1.0
    assert low < high


@given(tallies())
def test_failures_have_the_mirrored_interval_of_successes(tally: Tally) -> None:
    low, high = tally.interval
    mirrored = Tally(tally.episodes - tally.successes, tally.episodes).interval
    assert mirrored.low == pytest.approx(1 - high, abs=1e-12)
    assert mirrored.high == pytest.approx(1 - low, abs=1e-12)


@given(tallies(), st.integers(2, 20))
def test_more_episodes_with_the_same_share_make_the_interval_narrower(
    tally: Tally, times: int
) -> None:
    more = Tally(times * tally.successes, times * tally.episodes).interval
    assert more.high - more.low < tally.interval.high - tally.interval.low


@given(tallies())
def test_a_further_success_raises_both_ends(tally: Tally) -> None:
    further = Tally(tally.successes + 1, tally.episodes + 1).interval
    assert further.low >= tally.interval.low
    assert further.high >= tally.interval.high - 1e-12


@pytest.mark.parametrize(
    ("successes", "episodes", "low", "high"),
    # Newcombe (1998), table I, method 3, and two that follow from the formula by hand.
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_the_interval_is_the_published_one(
    successes: int, episodes: int, low: float, high: float
) -> None:
    assert Tally(successes, episodes).interval == pytest.approx((low, high), abs=1e-4)


@pytest.mark.parametrize("share", [0.3, 0.8, 0.97])
def test_the_interval_holds_the_true_share_about_as_often_as_it_says(share: float) -> None:
    count = 20
    held = sum(
        math.comb(count, one) * share**one * (1 - share) ** (count - one)
        for one in range(count + 1)
        if Tally(one, count).interval.low <= share <= Tally(one, count).interval.high
    )
    assert held >= 0.85


def test_nothing_tried_says_nothing() -> None:
    assert Tally().share is None
    assert Tally().interval == (0.0, 1.0)
    assert not Tally(5, 5).surely_above(Tally())


@pytest.mark.parametrize(("successes", "episodes"), [(3, 2), (-1, 2)])
def test_there_are_not_more_successes_than_episodes(successes: int, episodes: int) -> None:
    with pytest.raises(ValueError, match="successes"):
        Tally(successes, episodes)


@given(tallies(), tallies())
def test_what_is_surely_above_is_above_and_never_the_other_way_round(
    one: Tally, other: Tally
) -> None:
    if one.surely_above(other):
        assert one.share is not None
        assert other.share is not None
        assert one.share > other.share
        assert not other.surely_above(one)


@pytest.mark.parametrize(
    ("one", "other", "lead"),
    # Newcombe (1998), interval estimation for the difference, table II, method 10.
    [
        (Tally(56, 70), Tally(48, 80), 0.0524),
        (Tally(9, 10), Tally(3, 10), 0.1705),
        (Tally(6, 7), Tally(2, 7), 0.0582),
        (Tally(5, 56), Tally(0, 29), -0.0381),
    ],
)
def test_the_least_lead_is_the_published_one(one: Tally, other: Tally, lead: float) -> None:
    assert one.least_lead(other) == pytest.approx(lead, abs=1e-4)
    assert one.surely_above(other) is (lead > 0)


# --- who drives ---


@given(EPISODES)
def test_rounds_double_up_to_all_episodes(episodes: int) -> None:
    rounds = rounds_of(episodes)
    assert rounds[-1] == episodes
    assert all(earlier == (later + 1) // 2 for earlier, later in pairwise(rounds))
    assert rounds[0] >= min(FEWEST_EPISODES, episodes)


@pytest.mark.parametrize(
    ("episodes", "rounds"), [(1, (1,)), (8, (8,)), (10, (5, 10)), (20, (5, 10, 20))]
)
def test_the_first_round_is_not_too_short(episodes: int, rounds: tuple[int, ...]) -> None:
    assert rounds_of(episodes) == rounds


@pytest.mark.parametrize("episodes", [0, -3, 10**9])
def test_a_number_of_episodes_that_makes_no_sense_is_refused(episodes: int) -> None:
    with pytest.raises(OptionError, match=f"not {episodes}"):
        rounds_of(episodes)


@given(st.integers(1, 200), st.integers(1, 12))
def test_halving_ends_with_two_and_never_cuts_more_than_half(candidates: int, rounds: int) -> None:
    count = candidates
    for left in range(rounds, 0, -1):
        before, count = count, places(count, left)
        assert (before + 1) // 2 <= count <= before
        assert count >= min(before, 2)
    assert count <= max(2, math.ceil(candidates / 2**rounds) + 1)


@given(st.lists(st.tuples(tallies(), st.integers(1, 9)), min_size=1, max_size=12))
def test_of_equal_successes_the_smaller_tree_comes_first(field: list[tuple[Tally, int]]) -> None:
    order = ranked([one for one, _ in field], [size for _, size in field])
    assert sorted(order) == list(range(len(field)))
    for better, worse in pairwise(order):
        shares = [field[one][0].share for one in (better, worse)]
        assert shares[0] >= shares[1]
        if shares[0] == shares[1]:
            assert (field[better][1], better) < (field[worse][1], worse)


@given(
    st.lists(st.tuples(st.integers(0, 10), st.integers(1, 9)), min_size=1, max_size=20),
    st.integers(1, 4),
)
def test_who_goes_on_is_not_worse_than_who_leaves(
    field: list[tuple[int, int]], rounds_left: int
) -> None:
    results = [Tally(successes, 10) for successes, _ in field]
    sizes = [size for _, size in field]
    chosen = going_on(results, sizes, rounds_left)
    assert ranked(results, sizes)[0] in chosen
    assert chosen == tuple(sorted(set(chosen)))
    assert len(chosen) <= places(len(field), rounds_left)
    for stays in chosen:
        for leaves in set(range(len(field))) - set(chosen):
            assert (-results[stays].successes, sizes[stays]) <= (
                -results[leaves].successes,
                sizes[leaves],
            )


def test_who_is_hopeless_leaves_also_where_there_is_room() -> None:
    assert going_on([Tally(5, 5), Tally(0, 5)], [9, 1], 1) == (0,)
    assert going_on([Tally(5, 5), Tally(3, 5)], [9, 1], 1) == (0, 1)


def _drive(trial: Trial, succeeds: Callable[[int, int], bool]) -> list[tuple[int, int]]:
    """Drives a trial to its end; who drove which episode."""
    driven = []
    while (turn := trial.turn) is not None:
        driven.append((turn.candidate, turn.episode))
        left = trial.most_left
        trial.note(success=succeeds(turn.candidate, turn.episode))
        assert trial.most_left <= left - 1
    return driven


@given(FIELDS, EPISODES, st.integers(0, 2**32))
def test_a_trial_is_fair_and_ends(field: list[tuple[float, int]], episodes: int, seed: int) -> None:
    chance = random.Random(seed)
    trial = Trial([size for _, size in field], episodes)
    most = trial.most_left
    driven = _drive(trial, lambda one, _: chance.random() < field[one][0])
    assert trial.most_left == 0
    assert trial.driven == len(driven) <= most <= episodes * len(field)
    # Each drives the episodes from 0 on, once.
    assert len(set(driven)) == len(driven)
    by_round: dict[int, set[int]] = {}
    for standing in trial.standings:
        count = standing.tally.episodes
        assert {number for one, number in driven if one == standing.candidate} == set(range(count))
        # All that leave in the same round have driven the same episodes.
        by_round.setdefault(standing.round, set()).add(count)
        assert count == trial.rounds[standing.round]
    assert all(len(counts) == 1 for counts in by_round.values())
    assert trial.standings[0].candidate == trial.winner
    assert trial.standings[0].tally.episodes == episodes


@given(FIELDS, EPISODES, st.integers(0, 2**32))
def test_those_who_take_part_drive_in_turns(
    field: list[tuple[float, int]], episodes: int, seed: int
) -> None:
    chance = random.Random(seed)
    trial = Trial([size for _, size in field], episodes)
    numbers = [
        number for _, number in _drive(trial, lambda one, _: chance.random() < field[one][0])
    ]
    assert numbers == sorted(numbers)


@given(FIELDS, EPISODES)
def test_a_trial_is_deterministic(field: list[tuple[float, int]], episodes: int) -> None:
    def standings() -> object:
        trial = Trial([size for _, size in field], episodes)
        _drive(trial, lambda one, number: random.Random(f"{one} {number}").random() < field[one][0])
        return trial.standings

    assert standings() == standings()


@given(st.lists(st.integers(1, 50), min_size=1, max_size=12), EPISODES)
def test_of_trees_that_always_succeed_the_smallest_wins(sizes: list[int], episodes: int) -> None:
    trial = Trial(sizes, episodes)
    _drive(trial, lambda one, number: True)
    assert trial.winner is not None
    assert sizes[trial.winner] == min(sizes)


@given(FIELDS, EPISODES, st.data())
def test_a_tree_that_alone_succeeds_wins_whatever_its_size(
    field: list[tuple[float, int]], episodes: int, data: st.DataObject
) -> None:
    good = data.draw(st.integers(0, len(field) - 1))
    trial = Trial([size for _, size in field], episodes)
    _drive(trial, lambda one, number: one == good)
    assert trial.winner == good


@given(FIELDS, EPISODES, st.data())
def test_an_interrupted_trial_has_standings_but_no_winner(
    field: list[tuple[float, int]], episodes: int, data: st.DataObject
) -> None:
    trial = Trial([size for _, size in field], episodes)
    stop = data.draw(st.integers(0, max(trial.rounds[0] * len(field) - 1, 0)))
    for _ in range(stop):
        trial.note(success=True)
    assume(trial.turn is not None)
    assert trial.winner is None
    assert trial.driven == sum(one.tally.episodes for one in trial.standings) == stop


def test_a_trial_that_is_over_takes_no_more_episodes() -> None:
    trial = Trial([3], 1)
    trial.note(success=True)
    with pytest.raises(ValueError, match="over"):
        trial.note(success=True)


def test_a_trial_without_trees_is_refused() -> None:
    with pytest.raises(OptionError, match="no candidate"):
        Trial([], 5)


def test_halving_finds_a_good_tree_with_half_of_the_episodes() -> None:
    shares = [0.0, 0.1, 0.3, 0.6, 0.8, 0.9, *[0.98] * 10]
    chance, trials = random.Random(1), 400
    driven, success = 0, 0.0
    for _ in range(trials):
        trial = Trial(range(1, 17), 20)
        _drive(trial, lambda one, _: chance.random() < shares[one])
        assert trial.winner is not None
        driven += trial.driven
        success += shares[trial.winner]
    assert driven / trials < 0.5 * 20 * len(shares)
    assert success / trials > 0.95


# --- what the world says ---


@pytest.mark.parametrize("text", ["success", "Success ", "SUCCEEDED", "true", "True", '"success"'])
def test_words_of_success(text: str) -> None:
    assert success_of(text)


@pytest.mark.parametrize("text", ["failure", "failed", "false", " FAILURE\n", '"false"'])
def test_words_of_failure(text: str) -> None:
    assert not success_of(text)


@given(st.booleans(), st.dictionaries(st.text(), st.integers() | st.booleans() | st.text()))
def test_a_field_of_a_json_object_says_it(success: bool, others: dict[str, object]) -> None:
    assert success_of(json.dumps({**others, "reached": success}), "reached") is success


@pytest.mark.parametrize(
    ("text", "field", "words"),
    [
        ("maybe", None, "neither success nor failure"),
        ("", None, "neither success nor failure"),
        ("1", None, "neither success nor failure"),
        ("x" * 9999, None, "…"),
        ('{"start": 4, "reached": true}', None, r"--outcome-field \(reached\)"),
        ('{"start": 4}', None, "neither success nor failure"),
        ('{"start": 4}', "reached", "no boolean field 'reached'"),
        ('{"reached": 1}', "reached", "no boolean field 'reached'"),
        ("success", "reached", "no boolean field 'reached'"),
        ("[" * 99999, "reached", "no boolean field 'reached'"),
    ],
)
def test_what_says_neither_is_refused_with_a_sentence(
    text: str, field: str | None, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        success_of(text, field)


@given(st.text(), st.none() | st.text())
def test_any_text_is_understood_or_refused(text: str, field: str | None) -> None:
    with contextlib.suppress(InputError):
        assert success_of(text, field) in (True, False)


# --- which trees ---


def _levels(directory: Path, *trees: LearnedTree) -> Path:
    entries = []
    for number, tree in enumerate(trees):
        write_tree(directory / "levels" / f"{number:02d}" / "tree.json", tree)
        entries.append({"level": f"{number:02d}", "chosen": number == 1})
    (directory / "levels" / "summary.json").write_text(json.dumps(entries))
    return directory


def test_candidates_come_from_files_and_from_levels(tmp_path: Path) -> None:
    write_tree(tmp_path / "good.json", GOOD)
    (one,) = of_files([tmp_path / "good.json"])
    assert (one.name, one.nodes, one.agreement) == (str(tmp_path / "good.json"), 16, 0.97)
    assert one.document == dumps(GOOD)
    levels = list(of_levels(_levels(tmp_path, GOOD, BAD)))
    assert [one.name for one in levels] == ["level 00", "level 01 (chosen)"]
    assert [one.learned for one in levels] == [GOOD, BAD]


def test_the_same_tree_drives_once(tmp_path: Path) -> None:
    elsewhere = replace(GOOD, provenance=replace(GOOD.provenance, ccp_alpha=0.5))
    trees = [GOOD, BAD, elsewhere]
    named = [Candidate(str(place), tree, Path()) for place, tree in enumerate(trees)]
    found, notes = distinct(named)
    assert [one.name for one in found] == ["0", "1"]
    assert notes == ("2 is the same tree as 0, which drives for both",)


@pytest.mark.parametrize(
    ("summary", "words"),
    [
        (None, "no levels/summary.json.*learn INPUT --levels --out"),
        ("{", "not JSON"),
        ("[]", "no list of pruning levels"),
        ('[{"level": "../../elsewhere"}]', "no list of pruning levels"),
        ('[{"level": 3}]', "no list of pruning levels"),
        ('[{"level": "07"}]', r"07/tree.json does not exist"),
    ],
)
def test_a_directory_without_levels_is_refused(
    tmp_path: Path, summary: str | None, words: str
) -> None:
    if summary is not None:
        (tmp_path / "levels").mkdir()
        (tmp_path / "levels" / "summary.json").write_text(summary)
    with pytest.raises(InputError, match=words):
        list(of_levels(tmp_path))


@given(st.lists(tallies(), min_size=3, max_size=3))
def test_what_a_trial_has_found_is_read_as_it_was_written(found: list[Tally]) -> None:
    named = [Candidate("one", tree, Path()) for tree in (GOOD, BAD, learned(Selector((GO, LEFT))))]
    with tempfile.TemporaryDirectory() as kept:
        assert read_driven(Path(kept)) == {}
        write_driven(Path(kept), zip(named, found, strict=True))
        assert read_driven(Path(kept)) == {
            one.fingerprint: tally
            for one, tally in zip(named, found, strict=True)
            if tally.episodes
        }


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"trees": []}',
        '{"trees": {"a": {"successes": 2, "episodes": 1}}}',
        '{"trees": {"a": {"successes": 0.5, "episodes": 1}}}',
        '{"trees": {"a": {"successes": -1, "episodes": 1}}}',
        "[" * 100_000,
    ],
)
def test_a_spoilt_file_of_a_trial_is_a_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "trials.json").write_text(text)
    with pytest.raises(InputError, match=r"trials.json cannot be used .*: delete it"):
        read_driven(tmp_path)


def test_levels_of_several_channels_are_named(tmp_path: Path) -> None:
    _levels(tmp_path / "channels" / "arm", GOOD)
    with pytest.raises(InputError, match=r"a family for each channel.*channels/arm"):
        list(of_levels(tmp_path))


# --- what was found ---


def _result(outcomes: Sequence[str], episodes: int) -> TrialResult:
    """Of trees that succeed where their line says so."""
    trees = [GOOD, BAD, learned(Selector((GO, LEFT)))][: len(outcomes)]
    candidates = tuple(
        Candidate(f"tree {one}", tree, Path(f"{one}.json")) for one, tree in enumerate(trees)
    )
    trial = Trial([one.nodes for one in candidates], episodes)
    driven: list[list[Episode]] = [[] for _ in candidates]
    while (turn := trial.turn) is not None and turn.episode < len(outcomes[turn.candidate]):
        success = outcomes[turn.candidate][turn.episode] == "+"
        driven[turn.candidate].append(Episode(success, 1.5, Ending.TOLD, turn.episode))
        trial.note(success=success)
    return TrialResult(
        candidates, tuple(map(tuple, driven)), trial.standings, trial.rounds, trial.winner
    )


def test_the_table_has_success_and_interval_beside_nodes_and_agreement() -> None:
    assert table(_result(["++++", "+---"], 4)) == [
        ("", "nodes", "agreement", "success", "episodes", "95% interval"),
        ("tree 0", "16", "97.0%", "100%", "4/4", "51% to 100%"),
        ("tree 1", "5", "40.0%", "25%", "1/4", "5% to 70%"),
    ]


@pytest.mark.parametrize(
    ("outcomes", "episodes", "words"),
    [
        (
            ["+" * 8, "-" * 8],
            8,
            "tree 0 wins: 8 of 8 episodes succeeded .95% interval 68% to 100%..$",
        ),
        (["+++", "+++"], 3, "tree 1 wins.* do not tell it from tree 0: none of these is smaller."),
        (["+++", "++-"], 3, "tree 0 wins.* do not tell it from tree 1: more episodes would tell."),
        (["+", "+"], 3, "interrupted after 2 episodes: there is no winner"),
    ],
)
def test_the_verdict_says_how_sure_it_is(outcomes: list[str], episodes: int, words: str) -> None:
    assert re.search(words, verdict(_result(outcomes, episodes)))


def test_results_for_scripts_have_every_episode() -> None:
    found = json.loads(json.dumps(as_json(_result(["+-+", "---"], 3))))
    assert (found["winner"], found["episodes"], found["rounds"]) == ("0.json", 6, [3])
    best, worst = found["candidates"]
    assert (best["name"], best["successes"], best["episodes"], best["nodes"]) == (
        "tree 0",
        2,
        3,
        16,
    )
    assert best["success"] == pytest.approx(2 / 3)
    assert best["interval"][0] < 2 / 3 < best["interval"][1]
    assert [one["success"] for one in best["outcomes"]] == [True, False, True]
    assert best["outcomes"][1] == {"success": False, "seconds": 1.5, "ending": "told", "start": 1}
    assert worst["success"] == 0.0


def test_results_of_an_interrupted_trial_name_no_winner() -> None:
    found = as_json(_result(["", ""], 3))
    assert found["winner"] is None
    assert [one["success"] for one in found["candidates"]] == [None, None]


# --- what is refused ---


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "nothing says how an episode ends"),
        ({"ask": True, "outcome_topic": "t"}, "give one of them"),
        ({"ask": True, "outcome_field": "f"}, "give --outcome-topic"),
        ({"outcome_topic": "t", "start": StartParameter("n", "p")}, "give --reset-service"),
        ({"outcome_topic": "t", "time_limit": 0.0}, "more than 0 s"),
        ({"outcome_topic": "t", "time_limit": math.nan}, "more than 0 s"),
        ({"reset_service": "r", "time_limit": None}, "give it"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, object], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        TrialSettings(**settings)  # type: ignore[arg-type]


def test_a_reset_tells_only_where_nobody_else_does() -> None:
    assert TrialSettings(reset_service="r").told_by_reset
    assert not TrialSettings(reset_service="r", ask=True).told_by_reset
    assert not TrialSettings(reset_service="r", outcome_topic="t").told_by_reset


def test_a_start_parameter_is_a_node_and_a_name() -> None:
    assert StartParameter.of("/arm/robot/first_start", 7) == StartParameter(
        "/arm/robot", "first_start", 7
    )
    for text in ("first_start", "robot/", "/first_start", ""):
        with pytest.raises(OptionError, match="NODE/PARAMETER"):
            StartParameter.of(text)
    with pytest.raises(OptionError, match="not -1"):
        StartParameter.of("robot/first_start", -1)


def _run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs the command where nothing of ROS can be imported."""
    return warm_processes.run("rebt_ros.commands.trial", *arguments, ros=False)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--help"], 0, "successive halving"),
        ([], 2, "name a TREE, or a directory with --levels"),
        (["TREE"], 1, "nothing says how an episode ends"),
        (["none.json", "--ask"], 1, "none.json does not exist"),
        (["--levels", "DIR", "--ask"], 1, "no levels/summary.json"),
        (["TREE", "--ask", "--episodes", "0"], 1, "episodes must be 1 to"),
        (["TREE", "--ask", "--first-start", "4"], 1, "give --start-parameter"),
        (["TREE", "--outcome-topic", "t", "--start-parameter", "x"], 1, "NODE/PARAMETER"),
        (["TREE", "--ask"], 1, "source your ROS 2 first"),
        (["TREE", "--ask", "--ros-args", "-r", "a:=b"], 1, "source your ROS 2 first"),
        (["--ros-args", "-r", "a:=b", "--", "TREE", "--ask"], 1, "source your ROS 2 first"),
    ],
)
def test_the_command_refuses_with_one_sentence(
    tmp_path: Path, arguments: list[str], code: int, words: str
) -> None:
    write_tree(tmp_path / "good.json", GOOD)
    names = {"TREE": tmp_path / "good.json", "DIR": tmp_path}
    done = _run(*(names.get(one, one) for one in arguments))
    assert done.returncode == code, done.stderr
    assert words in " ".join((done.stdout + done.stderr).split())
    assert "Traceback" not in done.stderr
