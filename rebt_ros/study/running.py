"""Running one configuration: simulate, learn all pruning levels, compare."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from random import Random

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.routines.finding import find_routines
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.table import DemonstrationTable, tabulate
from rebt_ros.errors import InputError, RebtError
from rebt_ros.learning.evaluation import teacher_forced_choices
from rebt_ros.learning.suggesting import occurrences_in
from rebt_ros.paper.lat_occurrences import Occurrences
from rebt_ros.study.agreement import held_out_agreements
from rebt_ros.study.configurations import Lost, digest
from rebt_ros.study.edit_distance.labelled_tree import labelled
from rebt_ros.study.edit_distance.networkx_measure import NetworkxMeasure
from rebt_ros.study.mode import Mode
from rebt_ros.study.mode_trees import main_tree, plain_tree
from rebt_ros.study.modes import offer
from rebt_ros.study.provenance import fingerprint
from rebt_ros.study.reduction import Size, SizeComparison
from rebt_ros.study.results import (
    ConfigurationResult,
    LevelSizes,
    ModeResult,
    NetworkxPair,
    Pairs,
    SubtreeResult,
)
from rebt_ros.study.scores import ComparedTree, Distances, comparable, score
from rebt_ros.study.settings import MAX_DEPTH, Settings
from rebt_ros.study.simulator.configuration import ExperimentConfig, as_behavior_tree
from rebt_ros.study.simulator.synthetic_robot import ExperimentRobot, published_variables, simulate
from rebt_ros.study.subtree_text import one_line


@dataclass(frozen=True, slots=True)
class _Reduced:
    """A mode's tree without SAES, against the decision tree and what BT-Espresso makes of it."""

    sizes: SizeComparison
    mismatches: int
    """Rows on which it does not what the decision tree does."""


@dataclass(frozen=True, slots=True)
class _Level:
    """What a mode makes at one pruning level."""

    generated: tuple[ComparedTree, ...]
    offered: LevelSizes
    reduced: _Reduced | None
    """None where the decision tree decides nothing."""


def attempt(config: ExperimentConfig, settings: Settings) -> ConfigurationResult | Lost:
    """Runs a configuration; whatever goes wrong is the reason why it is lost."""
    try:
        return run_configuration(config, settings)
    except RebtError as error:
        return Lost(config.name, str(error))
    except Exception as error:
        # One configuration must not stop the others, which can take an hour.
        return Lost(config.name, f"{type(error).__name__}: {error}")


def run_configuration(config: ExperimentConfig, settings: Settings) -> ConfigurationResult:
    """Runs a configuration.

    Raises:
        InputError: No action was done.
    """
    start = time.monotonic()
    robot = ExperimentRobot(config, settings.seed, variables=published_variables(config))
    demonstration = simulate(robot, settings.ticks).demonstration
    if not len(demonstration):
        raise InputError(f"{config.name} did nothing in {settings.ticks} ticks: simulate more.")
    (table,) = tabulate([demonstration])
    levels = _levels(table)
    distances = Distances()
    subtrees = tuple(
        _subtree(number, as_behavior_tree(subtree), table, levels, distances)
        for number, subtree in enumerate(config.subtrees, start=1)
    )
    pairs = Pairs(distances.compared, distances.excluded, distances.measured)
    agreements = held_out_agreements(table)
    return ConfigurationResult(
        configuration=config.name,
        digest=digest(config),
        fingerprint=fingerprint(settings),
        rows=len(table),
        levels=len(levels[Mode.BASELINE]),
        skipped=len(config.notes),
        subtrees=subtrees,
        modes={
            mode: ModeResult(
                tuple(level.offered for level in made),
                tuple(level.reduced.sizes for level in made if level.reduced),
                agreements.get(mode),
                sum(level.reduced.mismatches for level in made if level.reduced),
            )
            for mode, made in levels.items()
        },
        pairs=pairs,
        networkx=_networkx_pairs(config, levels, distances, settings),
        seconds=round(time.monotonic() - start, 2),
    )


def _levels(table: DemonstrationTable) -> dict[Mode, list[_Level]]:
    """All pruning levels of all modes; none where one action is all that was done."""
    made: dict[Mode, list[_Level]] = {mode: [] for mode in Mode}
    if len(table.actions) < 2:
        return made
    fitted = fit(table, FitOptions(vocabulary=Vocabulary(History.LAST), max_depth=MAX_DEPTH))
    routines = find_routines(table)
    occurrences = occurrences_in(table)
    for ccp_alpha in fitted.path.alphas.tolist():
        trained = fitted.at(ccp_alpha)
        baseline = Size.of(main_tree(Mode.BASELINE, trained))
        for mode, levels in made.items():
            levels.append(_level(mode, table, trained, ccp_alpha, baseline, routines, occurrences))
    return made


def _level(
    mode: Mode,
    table: DemonstrationTable,
    trained: TrainedTree,
    ccp_alpha: float,
    baseline: Size,
    routines: Sequence[FoundRoutine],
    occurrences: Occurrences,
) -> _Level:
    main = main_tree(mode, trained)
    offered = offer(mode, table, trained, main, ccp_alpha, routines, occurrences)
    return _Level(
        comparable(offered.subtrees),
        LevelSizes(len(offered.subtrees), offered.suggestions),
        _reduced(mode, table, trained, main, baseline),
    )


def _reduced(
    mode: Mode, table: DemonstrationTable, trained: TrainedTree, main: nodes.Node, baseline: Size
) -> _Reduced | None:
    # Of trees whose leaves all choose one action, BT-Espresso makes a single node as well.
    if len({leaf.most_probable for _, leaf in trained.tree.paths()}) == 1:
        return None
    plain = plain_tree(mode, trained.tree, main)
    mismatches = np.sum(teacher_forced_choices(plain, table) != trained.predict(table))
    return _Reduced(SizeComparison(baseline, Size.of(plain)), int(mismatches))


def _subtree(
    number: int,
    simulated: nodes.Node,
    table: DemonstrationTable,
    levels: Mapping[Mode, Sequence[_Level]],
    distances: Distances,
) -> SubtreeResult:
    tree = labelled(simulated)
    done = any(action.label in table.actions for action in nodes.actions(simulated))
    if tree is None or not done or not levels[Mode.BASELINE]:
        return SubtreeResult(number, one_line(simulated), len(tree or ()), 0, 0, {})
    compared = ComparedTree(tree, simulated)
    return SubtreeResult(
        number,
        one_line(simulated),
        len(tree),
        compared.repeaters,
        compared.psa,
        {
            mode: score(tree, [level.generated for level in made], distances)
            for mode, made in levels.items()
        },
    )


def _networkx_pairs(
    config: ExperimentConfig,
    levels: Mapping[Mode, Sequence[_Level]],
    distances: Distances,
    settings: Settings,
) -> tuple[NetworkxPair, ...]:
    """The paper's measure on a sample of the configuration's different pairs."""
    if not settings.networkx_pairs:
        return ()
    generated = dict.fromkeys(
        one.tree for made in levels.values() for level in made for one in level.generated
    )
    simulated = [labelled(as_behavior_tree(subtree)) for subtree in config.subtrees]
    pairs = [(one, other) for one in simulated if one is not None for other in generated]
    drawn = Random(f"{settings.seed} {config.name} networkx").sample(
        pairs, min(settings.networkx_pairs, len(pairs))
    )
    found = []
    with NetworkxMeasure() as measure:
        for one, other in drawn:
            bounds = distances.between(one, other)
            distance = measure.distance(one, other, settings.pair_seconds)
            sizes = (len(one), len(other))
            found.append(NetworkxPair(sizes, float(bounds.lower), float(bounds.upper), distance))
    return tuple(found)
