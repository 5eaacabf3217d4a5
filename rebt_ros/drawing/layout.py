"""Where the boxes of a drawn tree go; no two overlap, and both layouts take linear time.

top_down
    Every level is a line of boxes, and each parent is centered over its children.  Good for trees
    that are not wider than a page.
outline
    Reads like an indented text: leaves follow their parent on its line, other children begin lines
    of their own below it.  Good for trees of any size.

A tree comes as a list in which each box stands before its children and each subtree in one piece
(preorder); lengths are in pixels, y grows downwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

Point: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """A box to be placed."""

    width: float
    height: float
    parent: int | None = None
    """Position of its parent in the list; None for the root, which comes first."""


@dataclass(frozen=True, slots=True)
class Layout:
    """A drawn tree, with its upper left corner at the origin."""

    corners: tuple[Point, ...]
    """Upper left corner of each box."""
    links: tuple[tuple[Point, ...], ...]
    """For each box but the root, the bends of the line that leads to it."""
    width: float
    height: float


def top_down(
    boxes: Sequence[Box], *, sibling_gap: float = 12, cousin_gap: float = 26, level_gap: float = 34
) -> Layout:
    """The tidy drawing of Reingold and Tilford (1981), for boxes of any width.

    Pushing subtrees to the left leaves small ones lopsided between large ones; the mean of that
    drawing and its mirror image is symmetric, and keeps the gaps and the centering because both
    drawings have them.

    Raises:
        ValueError: There are no boxes, or they are not in preorder.
    """
    children = _children(boxes)
    gaps = (sibling_gap, cousin_gap)
    leftmost = _centers(boxes, children, gaps)
    rightmost = _centers(boxes, [child[::-1] for child in children], gaps)
    centers = [(left - right) / 2 for left, right in zip(leftmost, rightmost, strict=True)]
    levels = [0] * len(boxes)
    for index, box in enumerate(boxes):
        if box.parent is not None:
            levels[index] = levels[box.parent] + 1
    tops = _tops(boxes, levels, level_gap)
    start = min(x - box.width / 2 for x, box in zip(centers, boxes, strict=True))
    corners = [
        (x - start - box.width / 2, tops[level])
        for x, box, level in zip(centers, boxes, levels, strict=True)
    ]
    links = []
    for index, box in enumerate(boxes):
        if box.parent is not None:
            from_x, to_x = centers[box.parent] - start, centers[index] - start
            to_y = corners[index][1]
            from_y, turn = corners[box.parent][1] + boxes[box.parent].height, to_y - level_gap / 2
            links.append(((from_x, from_y), (from_x, turn), (to_x, turn), (to_x, to_y)))
    return _layout(boxes, corners, links)


def outline(
    boxes: Sequence[Box],
    *,
    indent: float = 30,
    gap: float = 14,
    row_gap: float = 10,
    width: float = 1000,
) -> Layout:
    """Leaves follow their parent or the leaf before them on its line, while they fit.

    A line ends at `width`, but has half of that at least however far it is indented.

    Raises:
        ValueError: There are no boxes, or they are not in preorder.
    """
    children = _children(boxes)
    lefts = [0.0] * len(boxes)
    rows = [0] * len(boxes)
    follows = [False] * len(boxes)
    for index, box in enumerate(boxes):
        if box.parent is None:
            continue
        before = index - 1
        left = lefts[before] + boxes[before].width + gap
        start = lefts[box.parent]
        # Only the parent or a leaf beside it can stand right before a leaf that goes on its line.
        follows[index] = (
            not children[index]
            and (before == box.parent or boxes[before].parent == box.parent)
            and left + box.width <= max(width, start + width / 2)
        )
        rows[index] = rows[before] if follows[index] else rows[before] + 1
        lefts[index] = left if follows[index] else start + indent
    tops = _tops(boxes, rows, row_gap)
    heights = [0.0] * (rows[-1] + 1)
    for box, row in zip(boxes, rows, strict=True):
        heights[row] = max(heights[row], box.height)
    middles = [tops[row] + heights[row] / 2 for row in rows]
    corners = [
        (left, middle - box.height / 2)
        for left, middle, box in zip(lefts, middles, boxes, strict=True)
    ]
    links: list[tuple[Point, ...]] = []
    for index, box in enumerate(boxes):
        if box.parent is None:
            continue
        end = (lefts[index], middles[index])
        if follows[index]:
            links.append(((lefts[index - 1] + boxes[index - 1].width, middles[index]), end))
        else:
            x = lefts[box.parent] + min(indent, boxes[box.parent].width) / 2
            top = corners[box.parent][1] + boxes[box.parent].height
            links.append(((x, top), (x, middles[index]), end))
    return _layout(boxes, corners, links)


def _children(boxes: Sequence[Box]) -> list[list[int]]:
    """Positions of each box's children."""
    if not boxes or boxes[0].parent is not None:
        raise ValueError("the first box must be the root")
    children: list[list[int]] = [[] for _ in boxes]
    path = [0]
    for index, box in enumerate(boxes[1:], start=1):
        while path and path[-1] != box.parent:
            path.pop()
        if not path:
            raise ValueError(f"box {index} is not in preorder")
        children[path[-1]].append(index)
        path.append(index)
    return children


def _tops(boxes: Sequence[Box], rows: Sequence[int], gap: float) -> list[float]:
    """Upper edge of each row, which is as high as its highest box."""
    heights = [0.0] * (max(rows) + 1)
    for box, row in zip(boxes, rows, strict=True):
        heights[row] = max(heights[row], box.height)
    tops = [0.0]
    for height in heights[:-1]:
        tops.append(tops[-1] + height + gap)
    return tops


def _layout(
    boxes: Sequence[Box], corners: Sequence[Point], links: Sequence[tuple[Point, ...]]
) -> Layout:
    return Layout(
        corners=tuple(corners),
        links=tuple(links),
        width=max(x + box.width for (x, _), box in zip(corners, boxes, strict=True)),
        height=max(y + box.height for (_, y), box in zip(corners, boxes, strict=True)),
    )


class _Contour:
    """How far a subtree reaches to one side at each level, its top level first."""

    def __init__(self, reach: list[float], shift: float = 0.0) -> None:
        self._stored = reach  # lowest level first, so that a new top level is cheap
        self._shift = shift  # to be added to what is stored, so that moving is cheap

    def __len__(self) -> int:
        return len(self._stored)

    def __getitem__(self, level: int) -> float:
        return self._stored[-1 - level] + self._shift

    def move(self, distance: float) -> None:
        self._shift += distance

    def grow(self, reach: float) -> None:
        """Adds a level on top."""
        self._stored.append(reach - self._shift)

    def hide(self, behind: _Contour) -> _Contour:
        """This contour, continued by the other one below its lowest level; uses up both."""
        if len(self) >= len(behind):
            return self
        for level in range(len(self)):
            behind._stored[-1 - level] = self[level] - behind._shift
        return behind


def _centers(
    boxes: Sequence[Box], children: Sequence[Sequence[int]], gaps: tuple[float, float]
) -> list[float]:
    """Where each box's middle is when every subtree is as far to the left as it goes.

    Joining two contours takes as many steps as the lower one has levels, and those levels are
    hidden for good, so that all joins together take linear time.
    """
    sibling_gap, cousin_gap = gaps
    offsets = [0.0] * len(boxes)  # from the parent's middle
    contours: dict[int, tuple[_Contour, _Contour]] = {}
    for index in reversed(range(len(boxes))):
        left, right = _Contour([]), _Contour([])
        for child in children[index]:
            child_left, child_right = contours.pop(child)
            offset = 0.0
            if len(right):
                offset = max(
                    right[level] - child_left[level] + (cousin_gap if level else sibling_gap)
                    for level in range(min(len(right), len(child_left)))
                )
            offsets[child] = offset
            child_left.move(offset)
            child_right.move(offset)
            left, right = left.hide(child_left), child_right.hide(right)
        if children[index]:
            middle = (offsets[children[index][0]] + offsets[children[index][-1]]) / 2
            for child in children[index]:
                offsets[child] -= middle
            left.move(-middle)
            right.move(-middle)
        left.grow(-boxes[index].width / 2)
        right.grow(boxes[index].width / 2)
        contours[index] = left, right
    for index, box in enumerate(boxes):
        if box.parent is not None:
            offsets[index] += offsets[box.parent]
    return offsets
