"""Trees that are lists of branches, each of which acts where its conditions hold.

Most learned trees are: a Selector of Sequences, each with conditions before one action.  The
conditions of a branch, multiplied out, are *terms*, which all their literals have to meet; and the
first branch of which a term holds acts.  So boxes need not be pushed through the tree node by node,
which cuts them into as many pieces as a rule has conditions that may fail.  Instead all boxes are
split at the same time, each on the condition that most of its terms still ask, until it is known
which branch is the first: much like the decision tree that the branches came from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from rebt_ros.arrays import BoolArray, FloatArray, IntArray, WordArray
from rebt_ros.behavior_tree import nodes
from rebt_ros.logic.conditions import Condition, Literal
from rebt_ros.verification.errors import TooManyPartsError

#: Most literals of all terms: where multiplying out gives more, the tree is not read as branches.
_MOST_LITERALS: Final = 400_000
#: Boxes times literals that are looked at together.
_QUESTIONS_AT_A_TIME: Final = 2_000_000

#: Boxes that are split together where the first parts are wanted soon.
_SPLIT_IN_TURN: Final = 256

#: How many times as many counters as questions it is quicker to have than to sort the questions.
_SPARSE: Final = 4

_Term: TypeAlias = tuple[Literal, ...]
#: Where a condition holds: the words of a box that it is about, and their bits.
_Mask: TypeAlias = Callable[[Condition], tuple[slice, WordArray]]


@dataclass(frozen=True, slots=True)
class Branch:
    """Acts where one of its terms holds, and no branch before it does."""

    terms: tuple[_Term, ...]


def branches_of(tree: nodes.Node) -> tuple[Branch, ...] | None:
    """The branches of a tree, one for each action leaf in their order.

    Returns:
        None where the tree is no list of branches, or too large as one.
    """
    try:
        return tuple(Branch(terms) for terms in _Reader().acting(tree, ((),)))
    except _OtherShape:
        return None


class _OtherShape(Exception):  # noqa: N818 - an answer rather than an error
    """The tree is no list of branches."""


class _Reader:
    def __init__(self) -> None:
        self._left = _MOST_LITERALS

    def acting(self, node: nodes.Node, before: tuple[_Term, ...]) -> list[tuple[_Term, ...]]:
        """The terms of each action leaf of a node, after what was asked before it."""
        match node:
            case nodes.Action():
                return [before]
            case nodes.Selector(children, memory=False) | nodes.ParallelSelector(children):
                return [terms for child in children for terms in self.acting(child, before)]
            case nodes.Parallel(children=(nodes.Action(), *others)) if all(
                isinstance(other, nodes.Action) for other in others
            ):
                # All act at once, and the first one has the channel.
                return [before, *(() for _ in others)]
            case nodes.Sequence(children=(*tests, last), memory=False):
                for test in tests:
                    before = self._product(before, self._terms(test))
                return self.acting(last, before)
            case _:
                raise _OtherShape

    def _terms(self, node: nodes.Node) -> tuple[_Term, ...]:
        """The terms of a node without actions."""
        match node:
            case nodes.Condition(literal=literal):
                return ((literal,),)
            case nodes.Inverter(child=nodes.Condition(literal=literal)):
                return ((~literal,),)
            case nodes.Selector(children=children, memory=False):
                return tuple(term for child in children for term in self._terms(child))
            case nodes.Sequence(children=children, memory=False):
                product: tuple[_Term, ...] = ((),)
                for child in children:
                    product = self._product(product, self._terms(child))
                return product
            case _:
                raise _OtherShape

    def _product(self, first: tuple[_Term, ...], second: tuple[_Term, ...]) -> tuple[_Term, ...]:
        if len(first) == 1 and not first[0]:
            return second
        self._left -= len(first) * len(second)
        if self._left < 0:
            raise _OtherShape
        product = tuple((*one, *other) for one in first for other in second)
        if len(product) > len(first):
            self._left -= sum(map(len, product))
        return product


@dataclass(frozen=True, eq=False, slots=True)
class Parted:
    """Boxes in each of which one branch acts."""

    boxes: WordArray
    acting: IntArray
    """Which branch; the number behind the last one: none, shape (boxes,)."""
    origin: IntArray
    """Which box of the start each one is a part of, shape (boxes,)."""


@dataclass(frozen=True, eq=False, slots=True)
class Order:
    """In which order to split boxes, and which not at all."""

    distance: Callable[[WordArray], FloatArray]
    """Of boxes, the nearest first; no part of a box is nearer than the box."""
    limits: FloatArray
    """Boxes that are as far as this or farther are not gone on with, shape (boxes of the start,).
    They may get smaller meanwhile."""


def parted(branches: Sequence[Branch], mask: _Mask, start: WordArray, most: int) -> Parted:
    """Splits boxes until it is known of each which branch acts.

    Args:
        branches: In their order.
        mask: Where their conditions hold, as `Grid.mask` says.
        start: The boxes, shape (words, boxes).
        most: How many parts there may be.

    Raises:
        TooManyPartsError: There would be more.
    """
    # Every branch differs from every other one.
    apart = np.tile(np.arange(len(branches) + 1), (start.shape[1], 1))
    return _Parting(branches, mask, apart, most).run(start)


def where_some_act(
    branches: Sequence[Branch],
    mask: _Mask,
    start: WordArray,
    wanted: BoolArray,
    most: int,
    order: Order | None = None,
) -> Iterator[tuple[WordArray, IntArray]]:
    """The parts of boxes in which one of some branches acts, a few at a time.

    Nothing is asked that only tells wanted branches, or only unwanted ones, from each other: where
    branches overlap, these are far fewer parts than those that `parted` finds.  Few boxes are split
    up at a time, so that the first parts are there long before the last ones.

    Args:
        branches: In their order.
        mask: As for `parted`.
        start: The boxes, shape (words, boxes).
        wanted: Which branches are wanted in each box, at last whether it is wanted that none acts,
            shape (boxes, branches + 1).
        most: How many boxes may be split.
        order: By default all boxes are gone on with, those first about which the least is left to
            be asked.

    Yields:
        Parts, and which box of the start each one is a part of, shape (parts,).

    Raises:
        TooManyPartsError: More would have to be split.
    """
    parting = _Parting(branches, mask, wanted.astype(np.int64), most)
    for found in parting.in_turn(start, order):
        there = wanted[found.origin, found.acting]
        if there.any():
            yield found.boxes[:, there], found.origin[there]


@dataclass(eq=False, slots=True)
class _Front:
    """Boxes of which it is not yet known which branch acts, and what is left to be asked."""

    boxes: WordArray
    """Below their words, an empty one for fields of fewer words than others."""
    best: IntArray
    """The first branch that is known to hold in all of a box, shape (boxes,)."""
    origin: IntArray
    """As in `Parted`."""
    box: IntArray
    """The box of each pair of a box and a term that may hold in it, shape (pairs,)."""
    term: IntArray
    """Its term, shape (pairs,)."""
    pair: IntArray
    """The pair of each question: a pair, and a literal that may fail, shape (questions,)."""
    literal: IntArray
    """Its literal, shape (questions,)."""
    fresh: BoolArray
    """Which questions the last splits may have answered, shape (questions,)."""

    def decided(self) -> Parted:
        """Takes away the boxes about which nothing is left to be asked."""
        waiting = np.zeros(self.boxes.shape[1], dtype=bool)
        waiting[self.box] = True
        found = Parted(self.boxes[:-1, ~waiting], self.best[~waiting], self.origin[~waiting])
        self.box = (np.cumsum(waiting) - 1)[self.box]
        self.boxes, self.best = self.boxes[:, waiting], self.best[waiting]
        self.origin = self.origin[waiting]
        return found

    def keep(self, kept: BoolArray) -> None:
        """Gives up all other boxes; `fresh` does not count before the next split."""
        pairs = kept[self.box]
        questions = pairs[self.pair]
        self.pair = (np.cumsum(pairs) - 1)[self.pair[questions]]
        self.literal = self.literal[questions]
        self.box, self.term = (np.cumsum(kept) - 1)[self.box[pairs]], self.term[pairs]
        self.boxes, self.best = self.boxes[:, kept], self.best[kept]
        self.origin = self.origin[kept]

    def apart(self, others: BoolArray) -> _Front:
        """Gives up some boxes, and returns them by themselves."""
        front = replace(self)
        front.keep(others)
        self.keep(~others)
        return front


class _Parting:
    """Splits boxes.

    Args:
        branches: In their order.
        mask: As for `parted`.
        kinds: Of each box of the start a number for each branch, at last for none: those with the
            same one need not be told from each other, shape (boxes, branches + 1).
        most: How many parts there may be, or boxes be split in turn.
    """

    def __init__(self, branches: Sequence[Branch], mask: _Mask, kinds: IntArray, most: int) -> None:
        self._kinds = kinds
        self._left = most
        self._none = len(branches)
        # Of literals: the condition, and whether it has to hold.
        number: dict[Condition, int] = {}
        rank: list[int] = []
        term: list[int] = []
        condition: list[int] = []
        positive: list[bool] = []
        for place, branch in enumerate(branches):
            for literals in branch.terms:
                for literal in literals:
                    term.append(len(rank))
                    condition.append(number.setdefault(literal.condition, len(number)))
                    positive.append(literal.positive)
                rank.append(place)
        self._rank = np.array(rank, dtype=np.int64)
        self._term = np.array(term, dtype=np.int64)
        self._condition = np.array(condition, dtype=np.int64)
        self._positive = np.array(positive, dtype=bool)
        masks = [mask(one) for one in number]
        width = max((len(bits) for _, bits in masks), default=1)
        # A field of fewer words than others goes on with an empty one, the last of all.
        self._words = np.full((width, len(masks)), -1)
        self._masks = np.zeros((width, len(masks)), dtype=np.uint64)
        for place, (its, bits) in enumerate(masks):
            self._words[: len(bits), place] = np.arange(its.start, its.stop)
            self._masks[: len(bits), place] = bits

    def run(self, start: WordArray) -> Parted:
        """Splits all boxes; where no branch acts, the number behind the last one does.

        Raises:
            TooManyPartsError: They fall into more parts than there may be.
        """
        done: list[Parted] = []
        for front in self._fronts(start, np.arange(start.shape[1])):
            done += self._split_up(front)
        return Parted(
            np.concatenate([part.boxes for part in done], axis=1),
            np.concatenate([part.acting for part in done]),
            np.concatenate([part.origin for part in done]),
        )

    def _split_up(self, front: _Front) -> Iterator[Parted]:
        """Splits boxes until none is left of which it is not known which branch acts."""
        while True:
            self._answer(front)
            decided = front.decided()
            yield decided
            if not len(front.box):
                return
            self._left -= decided.boxes.shape[1]
            # Each is split in two.
            if 2 * front.boxes.shape[1] > self._left:
                raise TooManyPartsError
            self._split(front)

    def in_turn(self, start: WordArray, order: Order | None) -> Iterator[Parted]:
        """Splits the first boxes in an order until it is known which branch acts, then others.

        Raises:
            TooManyPartsError: More would have to be split than there may be.
        """
        places = np.arange(start.shape[1])
        if order is not None:
            places = places[np.argsort(order.distance(start), kind="stable")]
        for first in self._fronts(start, places):
            waiting: list[tuple[_Front, FloatArray]] = []
            yield self._taken_up(first, order, waiting)
            while waiting:
                front, soon = waiting.pop()
                if order is not None:
                    near = soon < order.limits[front.origin]
                    front.keep(near)
                    soon = soon[near]
                if len(soon) > _SPLIT_IN_TURN:
                    later = np.ones(len(soon), dtype=bool)
                    later[np.argsort(soon, kind="stable")[:_SPLIT_IN_TURN]] = False
                    waiting.append((front.apart(later), soon[later]))
                if not len(front.box):
                    continue
                self._left -= front.boxes.shape[1]
                if self._left < 0:
                    raise TooManyPartsError
                self._split(front)
                yield self._taken_up(front, order, waiting)

    def _taken_up(
        self, front: _Front, order: Order | None, waiting: list[tuple[_Front, FloatArray]]
    ) -> Parted:
        """Boxes about which nothing is left to be asked; the others wait."""
        self._answer(front)
        decided = front.decided()
        if len(front.box):
            soon = (
                np.bincount(front.box, minlength=front.boxes.shape[1]).astype(np.float64)
                if order is None
                else order.distance(front.boxes[:-1])
            )
            waiting.append((front, soon))
        return decided

    def _fronts(self, start: WordArray, places: IntArray) -> Iterator[_Front]:
        """The boxes of the start in some order, as many at a time as can be looked at together."""
        at_a_time = max(1, _QUESTIONS_AT_A_TIME // max(1, len(self._term)))
        for first in range(0, max(1, len(places)), at_a_time):
            some = places[first : first + at_a_time]
            yield self._front(start[:, some], some)

    def _front(self, start: WordArray, origin: IntArray) -> _Front:
        """Boxes with all questions there are."""
        count, terms = start.shape[1], len(self._rank)
        boxes = np.arange(count)
        return _Front(
            np.concatenate([start, np.zeros((1, count), dtype=np.uint64)]),
            np.full(count, self._none),
            origin,
            np.repeat(boxes, terms),
            np.tile(np.arange(terms), count),
            (boxes[:, np.newaxis] * terms + self._term).reshape(-1),
            np.tile(np.arange(len(self._term)), count),
            np.ones(count * len(self._term), dtype=bool),
        )

    def _answer(self, front: _Front) -> None:
        """Leaves out what need not be asked any more."""
        pair, literal = front.pair, front.literal
        fresh = np.flatnonzero(front.fresh)
        box = front.box[pair[fresh]]
        inside, outside = self._sides(front.boxes, box, self._condition[literal[fresh]])
        positive = self._positive[literal[fresh]]
        may, must = np.where(positive, inside, outside), np.where(positive, ~outside, ~inside)
        never = np.zeros(len(front.box), dtype=bool)
        never[pair[fresh[~may]]] = True
        unanswered = ~never[pair]
        unanswered[fresh[must]] = False
        # A term that is asked nothing holds in all of its box; no later branch acts there.
        always = ~never
        always[pair[unanswered]] = False
        rank = self._rank[front.term]
        np.minimum.at(front.best, front.box[always], rank[always])
        kept = ~never & ~always & (rank < front.best[front.box])
        # What is asked behind the last branch that would differ from the best one makes none.
        kind = self._kinds[front.origin[front.box], rank]
        differs = kept & (kind != self._kinds[front.origin, front.best][front.box])
        last = np.full(front.boxes.shape[1], -1)
        np.maximum.at(last, front.box[differs], rank[differs])
        kept &= rank <= last[front.box]
        unanswered &= kept[pair]
        front.pair = (np.cumsum(kept) - 1)[pair[unanswered]]
        front.literal = literal[unanswered]
        front.box, front.term = front.box[kept], front.term[kept]

    def _split(self, front: _Front) -> None:
        """Splits each box on the condition that is asked most; the insides come first."""
        count, pairs = front.boxes.shape[1], len(front.box)
        box, asked = front.box[front.pair], self._condition[front.literal]
        chosen = _most_frequent(box, asked, count, self._words.shape[1])
        front.boxes = self._halves(front.boxes, chosen)
        # Questions about other fields are answered as before.
        front.fresh = np.tile(self._words[0, asked] == self._words[0, chosen[box]], 2)
        front.best, front.origin = np.tile(front.best, 2), np.tile(front.origin, 2)
        front.box = np.concatenate([front.box, front.box + count])
        front.term, front.literal = np.tile(front.term, 2), np.tile(front.literal, 2)
        front.pair = np.concatenate([front.pair, front.pair + pairs])

    def _sides(
        self, boxes: WordArray, box: IntArray, asked: IntArray
    ) -> tuple[BoolArray, BoolArray]:
        """Whether conditions hold, and do not hold, anywhere in boxes, shape (questions,)."""
        inside, outside = np.zeros(len(box), dtype=bool), np.zeros(len(box), dtype=bool)
        for words, masks in zip(self._words, self._masks, strict=True):
            part, mask = boxes[words[asked], box], masks[asked]
            inside |= (part & mask) != 0
            outside |= (part & ~mask) != 0
        return inside, outside

    def _halves(self, boxes: WordArray, split: IntArray) -> WordArray:
        inside, outside = boxes.copy(), boxes.copy()
        places = np.arange(boxes.shape[1])
        for words, masks in zip(self._words, self._masks, strict=True):
            inside[words[split], places] &= masks[split]
            outside[words[split], places] &= ~masks[split]
        return np.concatenate([inside, outside], axis=1)


def _most_frequent(box: IntArray, asked: IntArray, boxes: int, conditions: int) -> IntArray:
    """The condition that is asked most often of each box, shape (boxes,)."""
    keys = box * conditions + asked
    if boxes * conditions <= _SPARSE * len(keys):
        votes = np.bincount(keys, minlength=boxes * conditions).reshape(boxes, conditions)
        return np.asarray(votes.argmax(axis=1))
    different, counts = np.unique(keys, return_counts=True)
    # Of each box, the last one in this order stays: the most frequent, the first of several.
    different = different[np.lexsort((-different, counts))]
    chosen = np.zeros(boxes, dtype=np.int64)
    chosen[different // conditions] = different % conditions
    return chosen
