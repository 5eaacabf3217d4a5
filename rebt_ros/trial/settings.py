"""Where a trial hears how episodes end, and how it puts the world at their starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from rebt_ros.errors import OptionError

#: Of an episode whose end the world tells (seconds).
DEFAULT_TIME_LIMIT: Final = 60.0

_LARGEST_START: Final = 2**31 - 1


@dataclass(frozen=True, slots=True)
class StartParameter:
    """An integer parameter of a node that says at which start the world stands after a reset."""

    node: str
    name: str
    first: int = 0
    """The start of episode 0; the others count on from it."""

    @classmethod
    def of(cls, text: str, first: int = 0) -> StartParameter:
        """The parameter that a text such as ``robot/first_start`` names.

        Raises:
            OptionError: It names none, or the first start is none.
        """
        node, _, name = text.rpartition("/")
        if not node or not name:
            raise OptionError(
                f"start parameter {text!r} is not NODE/PARAMETER: name both, such as "
                "robot/first_start."
            )
        if not 0 <= first <= _LARGEST_START:
            raise OptionError(f"the first start must be 0 to {_LARGEST_START}, not {first}.")
        return cls(node, name, first)


@dataclass(frozen=True, slots=True)
class TrialSettings:
    """How episodes begin and end.

    With neither a topic nor a person, the answer of the service that resets the world says how the
    episode before it went.

    Raises:
        OptionError: They make no sense together.
    """

    outcome_topic: str | None = None
    """Bool, or String as of `success_of`."""
    outcome_field: str | None = None
    """Of a JSON object that comes as a String."""
    ask: bool = False
    """Whether a person at the terminal says how episodes end."""
    reset_service: str | None = None
    """Trigger."""
    start: StartParameter | None = None
    time_limit: float | None = DEFAULT_TIME_LIMIT
    """After which an episode has failed, or is over where the reset says how it went (seconds);
    None for no limit."""
    executor: str = "executor"
    """The node's name."""

    def __post_init__(self) -> None:
        if self.ask and self.outcome_topic is not None:
            raise OptionError("a topic and a person both tell outcomes: give one of them.")
        if not self.ask and self.outcome_topic is None and self.reset_service is None:
            raise OptionError(
                "nothing says how an episode ends: give --outcome-topic, --ask or --reset-service."
            )
        if self.outcome_field is not None and self.outcome_topic is None:
            raise OptionError("--outcome-field is of a topic's messages: give --outcome-topic.")
        if self.start is not None and self.reset_service is None:
            raise OptionError(
                "a start holds from the next reset on: give --reset-service with --start-parameter."
            )
        if self.time_limit is None:
            if self.told_by_reset:
                raise OptionError(
                    "where the reset says how an episode went, --time-limit says when it is over: "
                    "give it."
                )
        elif not (math.isfinite(self.time_limit) and self.time_limit > 0):
            raise OptionError(f"the time limit must be more than 0 s, not {self.time_limit:g}.")

    @property
    def told_by_reset(self) -> bool:
        """Whether the service that resets the world says how the episode before went."""
        return not self.ask and self.outcome_topic is None
