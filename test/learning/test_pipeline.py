"""Learning from whole demonstrations: what is learned, how it is judged, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pruned_trees import train

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.beyond_the_paper import priority_root
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.builder import DemonstrationBuilder, StateTopic
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import InputError, OptionError
from rebt_ros.learning import evaluation, pipeline, suggesting
from rebt_ros.learning.options import DEFAULTS, LearnOptions
from rebt_ros.learning.pipeline import learn, learn_from, summary_sentence
from rebt_ros.logic.conditions import LastActionIs, PreviousActionIs
from rebt_ros.storage.input_options import InputOptions

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
SCITOS, TUTOR = SHARED / "scitos_g5_24.csv", SHARED / "tutor.csv"


def demonstration(
    name: str, shown: list[tuple[float, str]], channel: str = "action"
) -> Demonstration:
    """A demonstration with the feature ``x``."""
    rows = [Row(t, channel, action, None, (x,)) for t, (x, action) in enumerate(shown)]
    return Demonstration.from_rows(name, (Feature("x"),), rows)


def turning_and_going(name: str, seed: int, rows: int = 60) -> Demonstration:
    """Turns where x is positive, goes elsewhere."""
    numbers = np.random.default_rng(seed).normal(size=rows).tolist()
    return demonstration(name, [(x, "turn" if x > 0 else "go") for x in numbers])


def there_and_back(name: str, rounds: int = 15) -> Demonstration:
    """What to do depends on x and, as much, on the last action taken."""
    one_round = [(0.0, "grasp"), (1.0, "go"), (0.0, "place"), (1.0, "return")]
    return demonstration(name, one_round * rounds)


def test_a_policy_that_was_shown_is_learned() -> None:
    learned = learn([turning_and_going("one", 1), turning_and_going("two", 2)])
    figures = learned.provenance.figures
    assert figures.fidelity_mismatches == 0
    assert figures.held_out_rows == 60
    assert figures.own_history_agreement is not None
    assert figures.own_history_agreement > 0.9
    assert learned.provenance.demonstrations == 2
    assert learned.provenance.rows == 120


def test_the_previous_action_is_tested_only_where_that_raises_own_history_recall() -> None:
    auto = learn([there_and_back("one"), there_and_back("two")])
    assert auto.provenance.history is History.PREVIOUS
    assert auto.provenance.history is not History.NONE
    assert auto.provenance.figures.own_history_agreement == 1.0
    assert auto.provenance.figures.mean_recall == 1.0
    plain = learn([turning_and_going("one", 1), turning_and_going("two", 2)])
    assert plain.provenance.history is History.NONE
    assert plain.provenance.history is History.NONE


@pytest.mark.parametrize("history", History)
def test_the_history_can_be_prescribed(history: History) -> None:
    learned = learn([there_and_back("one"), there_and_back("two")], LearnOptions(history=history))
    assert learned.provenance.history is history
    tested = {type(one.literal.condition) for one in nodes.conditions(learned.tree)}
    kinds = {History.PREVIOUS: PreviousActionIs, History.LAST: LastActionIs}
    assert tested & {PreviousActionIs, LastActionIs} == (
        {kinds[history]} if history in kinds else set()
    )


def test_a_tree_says_what_its_rows_are() -> None:
    events = [turning_and_going("one", 1), turning_and_going("two", 2)]
    assert learn(events).row_kind is RowKind.EVENT
    samples = [replace(one, row_kind=RowKind.SAMPLE) for one in events]
    assert learn(samples).row_kind is RowKind.SAMPLE
    with pytest.raises(InputError, match="the rows of one are events and those of two are samples"):
        learn([events[0], samples[1]])


def test_everything_shown_is_learned_from_and_judged_before_that() -> None:
    # The second demonstration contradicts the first one.
    first = demonstration("one", [(float(x), "go" if x < 5 else "turn") for x in range(10)])
    second = demonstration("two", [(float(x), "turn" if x < 5 else "go") for x in range(10)])
    third = demonstration("three", [(float(x), "turn" if x < 5 else "go") for x in range(10)])
    options = LearnOptions(test_fraction=0.6, history=History.NONE)
    held = learn([first, second, third], replace(options, refit=False))
    assert held.provenance.figures.own_history_agreement == 0.0
    assert held.provenance.figures.mean_recall == 0.0
    assert (held.provenance.rows, held.provenance.demonstrations) == (10, 1)
    refitted = learn([first, second, third], options)
    assert refitted.provenance.figures.own_history_agreement == 0.0
    assert refitted.provenance.figures.held_out_rows == 20
    # What is counted is what was learned from.
    assert (refitted.provenance.rows, refitted.provenance.demonstrations) == (30, 3)
    assert sum(leaf.rows for channel in refitted.shown for leaf in channel.leaves) == 30
    assert refitted.tree != held.tree
    # Two of three say so.
    (table,) = tabulate([second])
    assert (evaluation.own_history_choices(refitted.tree, table) == table.chosen).all()


def test_the_end_of_the_only_demonstration_is_learned_too() -> None:
    shown = demonstration("one", [(float(x), "go" if x < 35 else "dock") for x in range(40)])
    learned = learn([shown])
    assert learned.provenance.rows == 40
    assert learned.provenance.figures.held_out_rows == 10
    assert learned.provenance.figures.own_history_agreement == 0.5
    assert "dock" in {action.label for action in nodes.actions(learned.tree)}
    paper = learn([shown], replace(LearnOptions(), refit=False))
    assert "dock" not in {action.label for action in nodes.actions(paper.tree)}


def test_figures_are_those_of_the_tree_that_was_learned_without_the_rows() -> None:
    table = tabulate([turning_and_going(str(seed), seed) for seed in range(4)])[0]
    learning = learn_from(table)
    held_out = table.where(learning.evidence.held_out)
    assert len(held_out) == 60
    without = fit(
        table.where(~learning.evidence.held_out),
        FitOptions(vocabulary=learning.evidence.judge.vocabulary),
    )
    assert learning.evidence.judge.at(0.0).tree == without.at(0.0).tree
    figures = learning.learned.provenance.figures
    own = learning.evidence.judge.at(learning.policy.ccp_alpha).predict(held_out)
    assert figures.own_history_agreement == pytest.approx(np.mean(own == held_out.chosen))


def test_figures_of_the_papers_mode_are_those_of_rows_that_it_was_not_learned_from() -> None:
    shown = [there_and_back("one"), there_and_back("two"), there_and_back("three")]
    learned = learn(shown, LearnOptions.paper())
    assert learned.provenance.history is History.LAST
    assert (learned.provenance.rows, learned.provenance.demonstrations) == (120, 2)
    assert learned.provenance.figures.held_out_rows == 60
    assert not any(
        isinstance(one.literal.condition, PreviousActionIs)
        for one in nodes.conditions(learned.tree)
    )


def test_nothing_is_judged_where_nothing_is_held_out() -> None:
    learned = learn([turning_and_going("one", 1)], LearnOptions(test_fraction=0.0))
    assert learned.provenance.figures.own_history_agreement is None
    assert learned.provenance.figures.held_out_rows == 0
    assert "no rows were held out" in summary_sentence(learned)


def test_learning_twice_from_one_table_gives_equal_trees() -> None:
    shown = [turning_and_going("one", 1), there_and_back("two")]
    assert learn(shown) == learn(shown)


def test_the_sentence_tells_rows_demonstrations_actions_nodes_and_agreement() -> None:
    sentence = summary_sentence(learn([turning_and_going("one", 1), turning_and_going("two", 2)]))
    for part in ("120 rows", "2 demonstrations", "2 actions", "5 nodes", "%"):
        assert part in sentence


def test_one_action_only_is_refused() -> None:
    with pytest.raises(InputError, match="one action only"):
        learn([demonstration("one", [(1.0, "go"), (2.0, "go")])])


def test_no_rows_are_refused() -> None:
    with pytest.raises(InputError, match="no demonstration rows"):
        learn([demonstration("one", [])])
    with pytest.raises(InputError, match="no demonstration rows"):
        learn([])


def test_two_rows_are_enough() -> None:
    learned = learn([demonstration("one", [(1.0, "go"), (2.0, "turn")])])
    assert learned.provenance.figures.fidelity_mismatches == 0


def test_one_action_only_on_one_of_two_channels_is_refused_with_its_name() -> None:
    builder = DemonstrationBuilder([StateTopic("state")], ["arm", "base"])
    builder.observe(0, "state", [1.0])
    rows = [*builder.act(1, "arm", "grasp"), *builder.act(2, "base", "go")]
    rows += builder.act(3, "base", "wait")
    both = Demonstration.from_rows("both", builder.features or (), rows)
    with pytest.raises(InputError, match="the only row of channel 'arm' shows one action only"):
        learn([both])


def test_demonstrations_without_features_are_decided_by_their_majority() -> None:
    rows = [Row(t, "action", label, None, ()) for t, label in enumerate("aabab")]
    learned = learn([Demonstration.from_rows("one", (), rows)], LearnOptions(history=History.NONE))
    assert [action.label for action in learned.actions] == ["a", "b"]


@pytest.mark.parametrize(
    "wrong",
    [
        {"delta": 1.5},
        {"delta": -0.1},
        {"delta": float("nan")},
        {"max_depth": 0},
        {"ccp_alpha": -1.0},
        {"test_fraction": 1.0},
        {"random_state": -1},
        {"lags": -1},
        {"lags": 21},
        {"level": -1},
        {"level": 1, "ccp_alpha": 0.1},
        {"reaction_time": -0.1},
        {"reaction_time": 5.1},
        {"reaction_time": float("nan")},
    ],
)
def test_options_out_of_range_are_refused_by_name(wrong: dict[str, float]) -> None:
    with pytest.raises(OptionError, match=next(iter(wrong))):
        LearnOptions(**wrong)  # type: ignore[arg-type]


def test_a_tree_too_large_for_the_best_order_of_rules_is_equivalent_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = tabulate([turning_and_going("one", 1), there_and_back("two")])[0]
    assert not any("best order" in note for note in learn_from(table).notes)
    for module in (pipeline, priority_root):
        monkeypatch.setattr(module, "MOST_LEAVES_IN_BEST_ORDER", 1)
    learning = learn_from(table)
    chosen = evaluation.teacher_forced_choices(learning.learned.tree, table)
    assert (chosen == learning.decision_tree.predict(table)).all()
    (note,) = [note for note in learning.notes if "best order" in note]
    leaves = learning.decision_tree.tree.leaves
    assert f"{leaves} leaves" in note
    assert "prune more" in note


def test_in_large_tables_suggestions_are_counted_in_the_first_rows_which_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = tabulate([there_and_back("one", rounds=60)])[0]
    everything = {one.id: one.support for one in learn_from(table).learned.suggestions}
    monkeypatch.setattr(suggesting, "_MOST_ROWS", len(table) // 2)
    learning = learn_from(table)
    assert "first" in learning.notes[-1]
    assert str(len(table) // 2) in learning.notes[-1]
    counted = {one.id: one.support for one in learning.learned.suggestions}
    assert counted
    assert all(support < everything[one] for one, support in counted.items())


def test_a_tree_too_large_to_be_minimized_is_equivalent_and_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = tabulate([turning_and_going("one", 1), there_and_back("two")])[0]
    for module in (pipeline, priority_root, suggesting):
        monkeypatch.setattr(module, "MOST_LEAVES_MINIMIZED", 1)
    monkeypatch.setattr(pipeline, "MOST_LEAVES_IN_BEST_ORDER", 1)
    learning = learn_from(table)
    chosen = evaluation.teacher_forced_choices(learning.learned.tree, table)
    assert (chosen == learning.decision_tree.predict(table)).all()
    assert learning.learned.suggestions == ()
    assert [note for note in learning.notes if "keep its conditions" in note]
    assert [note for note in learning.notes if "no PSA nodes and LAT trees" in note]


def test_routines_that_are_left_out_are_counted_also_where_the_tree_is_too_large(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = tabulate([there_and_back("one")])[0]
    trained = train(table)
    subtree = nodes.Sequence((nodes.Action("go", "action"), nodes.Action("turn", "action")))
    routines = [FoundRoutine(subtree, support, support) for support in range(10, 0, -1)]
    monkeypatch.setattr(suggesting, "MOST_LEAVES_MINIMIZED", 0)
    offered, notes = suggesting.suggest(table, trained, 0.0, DEFAULTS, routines)
    assert [one.support for one in offered] == list(range(10, 2, -1))
    assert notes[0].startswith("no PSA nodes and LAT trees")
    assert notes[1:] == ("2 more, less supported suggestions are left out",)


@pytest.mark.parametrize("root", [Root.PARALLEL, Root.SELECTOR])
def test_a_parallel_and_a_selector_root_choose_alike(root: Root) -> None:
    table = tabulate([turning_and_going("one", 1), there_and_back("two")])[0]
    learning = learn_from(table, LearnOptions(root=root, max_depth=None))
    chosen = evaluation.teacher_forced_choices(learning.learned.tree, table)
    assert (chosen == learning.decision_tree.predict(table)).all()


@pytest.mark.skipif(not SCITOS.exists(), reason="third-party data is not there")
def test_the_wall_following_robot_is_learned_without_a_mismatch() -> None:
    result = rebt_ros.learn([SCITOS])
    figures = result.learned.provenance.figures
    assert result.learned.provenance.rows == 5456
    assert len(result.learned.features) == 24
    assert figures.held_out_rows == 1364
    assert figures.fidelity_mismatches == 0
    assert figures.own_history_agreement is not None
    assert figures.own_history_agreement >= 0.95


@pytest.mark.skipif(not TUTOR.exists(), reason="third-party data is not there")
def test_the_robot_tutor_is_learned_with_its_missing_and_label_free_cells() -> None:
    result = rebt_ros.learn([TUTOR], reading=InputOptions(labels=("/robot_dialogue",)))
    learned = result.learned
    kinds = {feature.name: feature.kind for feature in learned.features}
    assert learned.provenance.rows == 1000 - 186
    assert any("186 of 1000 rows" in note for note in result.notes)
    assert kinds["/ExerciseSubmissionResult"] is FeatureKind.BINARY
    assert kinds["/KC"] is FeatureKind.NUMERIC
    assert len(learned.actions) == 4
    assert learned.provenance.figures.fidelity_mismatches == 0
