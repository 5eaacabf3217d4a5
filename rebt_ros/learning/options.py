"""How to learn: everything that section III of the paper leaves to the user, and more."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import InitVar, dataclass, field
from enum import Enum
from numbers import Integral, Real
from typing import Any

from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.beyond_the_paper.reductions import ALL_REDUCTIONS, Reductions
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import LARGEST_LAG
from rebt_ros.errors import OptionError

#: Stands for the ids of all suggestions.
ALL = "all"

#: Maximum reaction time (seconds).
_LATEST = 5.0


class Use(Enum):
    """Whether the executed tree has a kind of node or test."""

    AUTO = "auto"
    """Only if the demonstrations are better explained with it (see `choice`)."""
    ALWAYS = "always"
    NEVER = "never"


class PsaChoice(Enum):
    """What a PSA node is turned into."""

    SELECTOR = "selector"
    """Its actions are alternatives, the best supported first."""
    PARALLEL = "parallel"
    """Its actions are run together."""


@dataclass(frozen=True, slots=True)
class LearnOptions:
    """What section III of the paper leaves to the user, and how to judge the result.

    Enums may be given by value, such as ``psa="always"``.

    Raises:
        OptionError: A value has the wrong type or is out of range.
    """

    delta: float = 0.3
    """Threshold δ in [0, 1] of actions that are close enough for one PSA node."""
    psa: Use = Use.AUTO
    """Whether the executed tree has PSA nodes."""
    history: History | None = None
    """Which earlier action the executed tree may test; None to choose between the previous action
    and nothing, by how simple the rows are to explain and, if this leaves it open, by
    cross-validation (paper: LAT)."""
    differences: Use = Use.AUTO
    """Whether the executed tree may test the difference of two features."""
    sums: Use = Use.AUTO
    """Whether the executed tree may test weighted sums of features."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units of features by name; features with different units make no difference."""
    max_depth: int | None = None
    """Splits on the longest path of the decision tree; None to grow it fully and leave its size to
    pruning (paper: 5)."""
    ccp_alpha: float | None = None
    """Complexity parameter of minimal cost-complexity pruning; 0 prunes nothing, None chooses it by
    cross-validation."""
    level: int | None = None
    """Number of the pruning level, instead of a complexity parameter; 0 prunes nothing."""
    root: Root = Root.SELECTOR
    reductions: Reductions | None = ALL_REDUCTIONS
    """Reductions beyond the paper; None for those of Algorithm 1 only, and for the paper's mode of
    everything else (see `is_paper`)."""
    test_fraction: float = 0.25
    """Share of the rows, or of several demonstrations, that is held out; in [0, 1)."""
    refit: bool = True
    """Whether the tree is finally learned from all rows, once it has been judged."""
    simplest: bool = True
    """Whether to search for the simplest tree that fits the rows, instead of growing one greedily:
    with up to 5000 rows, and in trees of up to 30 leaves with at least 2 rows for each."""
    readable_thresholds: bool = True
    """Whether thresholds are moved to round values that splits share, within the gaps between shown
    rows."""
    leave_out_mistakes: bool = True
    """Whether rows that look like mistakes are left out, with up to 5000 samples; the row after one
    then follows the action that was meant."""
    leave_out_conditions: bool = True
    """Whether conditions that no shown row needs are left out of rules in priority order, unless
    the tree tests LAT (see `needless_conditions`)."""
    reaction_time: float | None = None
    """How late the demonstrator acted (seconds), which is undone before learning; None to estimate
    it from the demonstrations if rows are samples, and otherwise 0."""
    random_state: int = 0
    """Breaks ties between equally good splits, and decides which rows are made up."""
    lags: int = 0
    """How many rows each state feature looks back, 0 to 20; rows should be evenly spaced."""
    upsample: Upsampling = Upsampling.NONE
    """Additional rows that decision trees are fitted to, but never judged on."""
    attach: tuple[str, ...] = ()
    """Ids of the suggestions to attach, or `ALL`."""
    exact: bool = False
    """Whether the structure of trees is grown on all rows even if there are more than 100,000;
    otherwise on a sample of whole demonstrations (see `structure`)."""
    routines: bool = True
    """Whether to search for Sequences and Repeaters in rows that share a state."""
    psa_choice: PsaChoice | None = None
    """What to turn all PSA nodes into; None to leave them to the user."""
    last_action: InitVar[object] = None
    """The paper's term for `history`; refused with a sentence that says so."""

    def __post_init__(self, last_action: object) -> None:
        if last_action is not None:
            raise OptionError(
                "what the tree may test of the last action is the option history: say 'none', "
                "'previous' or 'last' there, or leave it to choose."
            )
        self._take_words()
        self._take_numbers()
        self._take_the_others()
        if not 0 <= self.delta <= 1:
            raise OptionError(f"delta must lie between 0 and 1, not at {self.delta:g}.")
        if self.max_depth is not None and self.max_depth < 1:
            raise OptionError(f"max_depth must be at least 1, not {self.max_depth}.")
        if self.ccp_alpha is not None and not 0 <= self.ccp_alpha < math.inf:
            raise OptionError(f"ccp_alpha must be 0 or more, not {self.ccp_alpha:g}.")
        if self.level is not None and self.level < 0:
            raise OptionError(f"level must be 0 or more, not {self.level}.")
        if self.level is not None and self.ccp_alpha is not None:
            raise OptionError("level and ccp_alpha both say how far to prune: give one of them.")
        if not 0 <= self.test_fraction < 1:
            raise OptionError(
                f"test_fraction must be at least 0 and less than 1, not {self.test_fraction:g}."
            )
        if self.reaction_time is not None and not 0 <= self.reaction_time <= _LATEST:
            raise OptionError(
                f"reaction_time must lie between 0 and {_LATEST:g} seconds, not at "
                f"{self.reaction_time:g}."
            )
        if not 0 <= self.random_state < 2**32:
            raise OptionError(f"random_state must be a 32-bit number, not {self.random_state}.")
        if not 0 <= self.lags <= LARGEST_LAG:
            raise OptionError(f"lags must lie between 0 and {LARGEST_LAG}, not at {self.lags}.")

    def _take_words(self) -> None:
        """Converts values of enums, as on the command line, to members."""
        for name, kind in _ENUMS.items():
            value = getattr(self, name)
            words = [str(member.value) for member in kind]
            if isinstance(value, str) and value in words:
                object.__setattr__(self, name, kind(value))
            elif name in _CHOSEN and (value is None or value == "auto"):
                object.__setattr__(self, name, None)
            elif not isinstance(value, kind):
                known = ", ".join(words)
                raise OptionError(f"{name} must be one of {known}, not {value!r}.")

    def _take_numbers(self) -> None:
        """Converts numbers of any library to Python's."""
        kinds: tuple[tuple[tuple[str, ...], type, Callable[[Any], float], str], ...] = (
            (_NUMBERS, Real, float, "a number"),
            (_WHOLE_NUMBERS, Integral, int, "a whole number"),
        )
        for names, kind, made, words in kinds:
            for name in names:
                value = getattr(self, name)
                if value is None and name in _LEFT_OPEN:
                    continue
                if isinstance(value, bool) or not isinstance(value, kind):
                    open_too = " or None" if name in _LEFT_OPEN else ""
                    raise OptionError(f"{name} must be {words}{open_too}, not {value!r}.")
                try:
                    object.__setattr__(self, name, made(value))
                except OverflowError as err:
                    raise OptionError(f"{name} is far too large.") from err

    def _take_the_others(self) -> None:
        for name in _SWITCHES:
            if not isinstance(value := getattr(self, name), bool):
                raise OptionError(f"{name} must be True or False, not {value!r}.")
        if not isinstance(self.reductions, Reductions | None):
            raise OptionError(f"reductions must be Reductions or None, not {self.reductions!r}.")
        ids = (self.attach,) if isinstance(self.attach, str) else self.attach
        if not isinstance(ids, tuple | list) or not _are_texts(ids):
            raise OptionError(f"attach must be ids of suggestions, not {ids!r}.")
        object.__setattr__(self, "attach", tuple(ids))
        units = self.units
        if not isinstance(units, Mapping) or not _are_texts([*units, *units.values()]):
            raise OptionError(f"units must be units by names of features, not {units!r}.")

    @property
    def is_paper(self) -> bool:
        """Whether there are no reductions beyond the paper, and suggestions are Algorithm 2's.

        There may then be more than twelve suggestions, from trees of any size, with at most 24
        Repeaters of single loops; they are attached after the rules.  `paper` also sets all other
        options.
        """
        return self.reductions is None

    @classmethod
    def paper(cls) -> LearnOptions:
        """The paper's settings (IV-B)."""
        return cls(
            delta=0.3,
            psa=Use.ALWAYS,
            history=History.LAST,
            differences=Use.NEVER,
            sums=Use.NEVER,
            max_depth=5,
            ccp_alpha=0.0,
            root=Root.PARALLEL,
            reductions=None,
            refit=False,
            simplest=False,
            readable_thresholds=False,
            leave_out_mistakes=False,
            leave_out_conditions=False,
            reaction_time=0.0,
            exact=True,
            routines=False,
        )


#: Options with enum values.
_ENUMS: Mapping[str, type[Enum]] = {
    "psa": Use,
    "history": History,
    "differences": Use,
    "sums": Use,
    "root": Root,
    "upsample": Upsampling,
    "psa_choice": PsaChoice,
}
#: Options that are numbers, and Boolean options.
_NUMBERS = ("delta", "ccp_alpha", "test_fraction", "reaction_time")
_WHOLE_NUMBERS = ("max_depth", "level", "random_state", "lags")
_SWITCHES = (
    "refit",
    "simplest",
    "readable_thresholds",
    "leave_out_mistakes",
    "leave_out_conditions",
    "exact",
    "routines",
)
#: Numbers that may be None.
_LEFT_OPEN = frozenset({"ccp_alpha", "reaction_time", "max_depth", "level"})
#: Options that are None if the user did not choose.
_CHOSEN = frozenset({"history", "psa_choice"})


def _are_texts(values: Iterable[object]) -> bool:
    return all(isinstance(value, str) for value in values)


DEFAULTS = LearnOptions()
