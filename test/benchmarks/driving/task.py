"""What a task is, so that every method can learn it and drive in it."""

from __future__ import annotations

from typing import ClassVar, Protocol, TypeAlias

#: Values of the features, in their order; text for categories, 0 and 1 for truth values.
State: TypeAlias = tuple[float | str, ...]


class Task(Protocol):
    """A task, and the episode of it that is under way."""

    name: ClassVar[str]
    features: ClassVar[tuple[str, ...]]
    """Names of what is measured."""
    actions: ClassVar[tuple[str, ...]]
    """Labels.  The first one holds until something was chosen."""
    needs_memory: ClassVar[bool]
    """Whether the expert does different things in equal states."""

    def reset(self, seed: int) -> State:
        """Begins an episode.

        Args:
            seed: At least 0; equal seeds and actions make equal episodes.
        """

    def step(self, action: str) -> State:
        """Does something for one step; not after the episode is over."""

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""

    @property
    def success(self) -> bool:
        """Whether the task is done."""

    def expert(self) -> str:
        """What the expert does now.  It may know what the features do not tell."""
