"""Finds routines in a demonstration table, and makes subtrees of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from rebt_ros.behavior_tree import nodes
from rebt_ros.beyond_the_paper.routines.corpus import LONGEST_WORD, corpus
from rebt_ros.beyond_the_paper.routines.found_routine import FoundRoutine
from rebt_ros.beyond_the_paper.routines.guards import Guard, guard, holds
from rebt_ros.beyond_the_paper.routines.likelihood import Model
from rebt_ros.beyond_the_paper.routines.moments import Moments, moments
from rebt_ros.beyond_the_paper.routines.program import Place, Step
from rebt_ros.beyond_the_paper.routines.search import programs
from rebt_ros.beyond_the_paper.routines.streams import State
from rebt_ros.demonstration.schema import Feature
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.logic.conditions import Literal, Threshold

#: Minimum share and number of rows that follow another row in the same moment, for a search for
#: routines.
_LEAST_TOGETHER = 0.05
_FEWEST_TOGETHER = 100
#: Rounds of expectation maximization before guards are learned.
_THOROUGH = 10
#: Number of best programs whose routines are offered.
_MOST_PROGRAMS = 3
#: Minimum number of events for learning what another round depends on.
_FEWEST_ROUNDS = 100
#: How often a step must follow in the same moment; it never does if its guard contradicts the one
#: before.
_FEWEST_PASSED = 30
#: How much rarer continuing must be if a guard does not hold: within a stream, and at its
#: beginning, which may also have waited while the state changed.
_CONTRAST, _CONTRAST_AT_BEGINNING = 0.6, 0.72


def find_routines(table: DemonstrationTable) -> tuple[FoundRoutine, ...]:
    """Routines of the program that best explains what was done in each state.

    There is something to find only if several actions were done in one state.  Actions in one state
    have one reason, so their order shows what belongs together, and their presence shows what it
    depends on.

    Args:
        table: The rows to learn from.

    Returns:
        Each routine once, whatever its thresholds: those of the best program, by the rows they
        explain; then its Sequences cut in two, those cut before a guarded step first; then the
        routines of the next programs.
    """
    shown = moments(table)
    together = shown.rows - len(shown)
    if together < max(_FEWEST_TOGETHER, _LEAST_TOGETHER * len(table)) or len(shown.actions) < 2:
        return ()
    read = corpus(shown)
    readings = []
    for program in programs(shown, read)[:_MOST_PROGRAMS]:
        model = Model(program, read)
        model.fit(_THOROUGH)
        reading = _Reading(model, shown, table.features)
        readings.append(sorted(reading.routines(table.channel), key=lambda one: -one.rows))
    best = readings[0]
    offered = [one.whole for one in best]
    offered += [part for one in best for part in one.parts(guarded=True)]
    offered += [part for one in best for part in one.parts(guarded=False)]
    offered += [one.whole for reading in readings[1:] for one in reading]
    different: dict[object, FoundRoutine] = {}
    for routine in offered:
        if len(routine.subtree.children) > 1:
            different.setdefault(_gist(routine.subtree), routine)
    return tuple(different.values())


@dataclass(frozen=True, slots=True)
class _ReadStep:
    """An offered step."""

    guard: tuple[nodes.Node, ...]
    action: nodes.Node
    support: int
    """How often its rarest action was done in it."""
    rows: int


@dataclass(frozen=True, slots=True)
class _ReadRoutine:
    """An offered routine."""

    steps: tuple[_ReadStep, ...]
    repeated: bool

    @property
    def rows(self) -> int:
        """Number of rows that it explains."""
        return sum(step.rows for step in self.steps)

    @property
    def whole(self) -> FoundRoutine:
        """The whole routine."""
        return _found(self.steps, nodes.Repeater if self.repeated else _sequence)

    def parts(self, *, guarded: bool) -> Iterator[FoundRoutine]:
        """The two parts, before a step and from it on.

        Two Sequences of which one always follows the other do the same as one Sequence, so the end
        of the first cannot be observed.

        Args:
            guarded: Whether the step must have a guard.
        """
        if self.repeated:
            return
        for cut in range(1, len(self.steps)):
            if bool(self.steps[cut].guard) == guarded:
                yield _found(self.steps[:cut], _sequence)
                yield _found(self.steps[cut:], _sequence)


def _found(
    steps: tuple[_ReadStep, ...],
    kind: Callable[[tuple[nodes.Node, ...]], nodes.Sequence | nodes.Repeater],
) -> FoundRoutine:
    children = tuple(node for step in steps for node in (*step.guard, step.action))
    support = min(step.support for step in steps)
    return FoundRoutine(kind(children), support, sum(step.rows for step in steps))


def _gist(node: nodes.Node) -> object:
    """A key that is equal for routines that differ only in thresholds or order of conditions."""
    match node:
        case nodes.Condition(literal=Literal(Threshold(quantity=name), positive)):
            return name, positive
        case nodes.Selector(children=children):
            return frozenset(_gist(child) for child in children)
        case nodes.Sequence(children=children) | nodes.Repeater(children=children):
            parts: list[object] = [type(node)]
            conditions: set[object] = set()
            for child in children:
                if isinstance(child, nodes.Condition | nodes.Selector):
                    conditions.add(_gist(child))
                else:
                    parts += [frozenset(conditions), child]
                    conditions = set()
            return tuple(parts)
        case _:
            return node


#: The beginning of a stream.
_START = Place(0, 0)


@dataclass(frozen=True, slots=True)
class _Border:
    """A border between two steps of a stream."""

    stream: int
    before: Place
    after: Place


@dataclass(slots=True)
class _Events:
    """Moments in which a routine might have continued, and whether it did."""

    moments: list[int] = field(default_factory=list)
    went_on: list[bool] = field(default_factory=list)

    def add(self, where: list[int], went_on: bool) -> None:
        """An event for each moment."""
        self.moments += where
        self.went_on += [went_on] * len(where)


class _Reading:
    """What each row of the moments was, in terms of a program."""

    def __init__(self, model: Model, shown: Moments, features: tuple[Feature, ...]) -> None:
        self._model = model
        self._program = model.program
        self._shown = shown
        self._features = features
        self._borders: dict[_Border, _Events] = {}
        #: Events after all rounds of a routine.  If fewer were seen, the last one may not have been
        #: the end; this is more likely the earlier the moment began, which depends on the state.
        self._after_all: dict[_Border, _Events] = {}
        self._begun: dict[tuple[int, Place], set[int]] = {}
        #: Rows that are members of the step at a place of a stream.
        self._rows: dict[tuple[int, Place, int], int] = {}
        of_word: list[list[int]] = [[] for _ in shown.words]
        for moment, word in enumerate(shown.word.tolist()):
            of_word[word].append(moment)
        for word, where in zip(shown.words, of_word, strict=True):
            cut = len(word) > LONGEST_WORD
            self._note(model.explain(word[:LONGEST_WORD], cut), where, cut)

    def _note(self, explained: list[int | None], where: list[int], cut: bool) -> None:
        """Records what the rows of a word are, in all moments with this word."""
        states = [self._model.states[one] for one in explained if one is not None]
        rounds = 0
        for before, after in zip([None, *states], [*states, None], strict=True):
            if before is None or (after is not None and after.stream != before.stream):
                rounds = 0
                if after is not None:
                    begun = (after.stream, self._place(after))
                    self._begun.setdefault(begun, set()).update(where)
            if before is None:
                continue
            place, goes_on = self._place(before), None
            if after is not None and after.stream == before.stream:
                goes_on = self._place(after)
            routine = self._program[before.stream][place.routine]
            key = (before.stream, place, before.member)
            self._rows[key] = self._rows.get(key, 0) + len(where)
            if not before.completes(routine.steps[place.step]) or (cut and after is None):
                continue
            rounds += self._ends(place, before.stream)
            for follower in self._followers(before.stream, place, rounds):
                border = _Border(before.stream, place, follower)
                self._borders.setdefault(border, _Events()).add(where, goes_on == follower)
                if rounds >= routine.rounds:
                    self._after_all.setdefault(border, _Events()).add(where, goes_on == follower)
                if goes_on == follower:
                    break

    def _place(self, state: State) -> Place:
        return self._model.order[state.stream][state.place]

    def _ends(self, place: Place, stream: int) -> bool:
        return place.step + 1 == len(self._program[stream][place.routine].steps)

    def _followers(self, stream: int, place: Place, rounds: int) -> list[Place]:
        """The steps that may follow a step after some rounds of its routine in the same moment."""
        routines = self._program[stream]
        if not self._ends(place, stream):
            return [Place(place.routine, place.step + 1)]
        # The round is unknown, except that it was the last one if all were seen.
        again = rounds < routines[place.routine].rounds
        return [Place(place.routine, 0)] * again + [Place(place.routine + 1, 0)] * (
            place.routine + 1 < len(routines)
        )

    def routines(self, channel: str) -> Iterator[_ReadRoutine]:
        """All routines of the program."""
        for stream, routines in enumerate(self._program):
            for number, routine in enumerate(routines):
                steps = (
                    self._step(stream, Place(number, step), members, channel)
                    for step, members in enumerate(routine.steps)
                )
                yield _ReadRoutine(tuple(steps), routine.rounds > 1)

    def _step(self, stream: int, place: Place, members: Step, channel: str) -> _ReadStep:
        guards: list[nodes.Node] = []
        for clause in self._guard(stream, place.routine, place.step):
            conditions = tuple(nodes.Condition(literal) for literal in clause)
            guards.append(conditions[0] if len(conditions) == 1 else nodes.Selector(conditions))
        actions = tuple(nodes.Action(self._shown.actions[one], channel) for one in members)
        action = actions[0] if len(actions) == 1 else nodes.ParallelSelector(actions)
        rows = [self._rows.get((stream, place, member), 0) for member in range(len(members))]
        return _ReadStep(tuple(guards), action, min(rows), sum(rows))

    def _guard(self, stream: int, number: int, place: int) -> Guard:
        """The guard of a step."""
        here = Place(number, place)
        if place:
            border = _Border(stream, Place(number, place - 1), here)
            return self._told_by(self._borders.get(border, _Events()), here=here, stream=stream)
        again = self._again(stream, number)
        if again is not None:
            return again
        if not number:
            return self._where_begun(stream, here)
        last = Place(number - 1, len(self._program[stream][number - 1].steps) - 1)
        border = _Border(stream, last, here)
        sure = self._after_all.get(border, _Events())
        if len(sure.moments) >= _FEWEST_ROUNDS:
            return self._told_by(sure, here=here, stream=stream)
        # The routine before it also ends by failing where it would continue from the beginning.
        where = self._again(stream, number - 1)
        return self._told_by(self._borders.get(border, _Events()), where, here, stream)

    def _again(self, stream: int, number: int) -> Guard | None:
        """The guard of another round; None if there is none, or if it was rarely seen."""
        routine = self._program[stream][number]
        border = _Border(stream, Place(number, len(routine.steps) - 1), Place(number, 0))
        if len(self._borders.get(border, _Events()).moments) < _FEWEST_ROUNDS:
            return None
        return self._told_by(self._borders[border], here=Place(number, 0), stream=stream)

    def _told_by(
        self, events: _Events, where: Guard | None = None, here: Place = _START, stream: int = 0
    ) -> Guard:
        """The conditions for continuing at a place of a stream.

        Args:
            events: When this might have happened.
            where: Conditions for events to count.
            here: The place.
            stream: The stream.
        """
        if sum(events.went_on) < _FEWEST_PASSED:
            return self._where_begun(stream, here)
        states, went_on = self._shown.states[events.moments], np.array(events.went_on, dtype=bool)
        if where:
            counted = holds(where, states, self._features)
            states, went_on = states[counted], went_on[counted]
        return guard(states, went_on, self._features, _CONTRAST)

    def _where_begun(self, stream: int, here: Place) -> Guard:
        """The conditions for a stream to begin at a place."""
        begun = np.zeros(len(self._shown), dtype=bool)
        begun[list(self._begun.get((stream, here), ()))] = True
        return guard(self._shown.states, begun, self._features, _CONTRAST_AT_BEGINNING)


def _sequence(children: tuple[nodes.Node, ...]) -> nodes.Sequence:
    return nodes.Sequence(children, memory=True)
