"""The learner's parameters.  All can be set at any time: each call reads them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rclpy.node import Node

from rebt_ros.behavior_tree.learned_tree import Root
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.last_action import History
from rebt_ros.demonstration.schema import LARGEST_LAG
from rebt_ros.errors import OptionError
from rebt_ros.live.learning_process import Request
from rebt_ros.ros.parameters import Parameters, at_home

_USES: Final = ("auto", "always", "never")


@dataclass(frozen=True, slots=True)
class RuleSettings:
    """What reads the parameters about rules."""

    file: Callable[[], Path | None]
    repair: Callable[[], bool]
    """Whether guards are put into a tree that breaks a rule."""
    action_results: Callable[[], bool]
    """Whether the robot reports how actions end."""


@dataclass(frozen=True, slots=True)
class LearnerSettings:
    """What reads the parameters."""

    demonstrations: Callable[[], Path]
    output: Callable[[], Path]
    """Where tree.json is written to."""
    timeout: Callable[[], float]
    """How long learning may take, seconds; 0 for no limit."""
    relearn_after: Callable[[], int]
    """Ended demonstrations after which to learn without a call; 0 for never."""
    least_agreement: Callable[[], float]
    """With held-out rows; trees that agree less are not published."""
    only_better: Callable[[], bool]
    """Whether a tree that is worse than the one that is published is not published."""
    kept_trees: Callable[[], int]
    """How many of the published trees are kept."""
    rules: RuleSettings
    binary: Callable[[], tuple[str, ...]]
    categorical: Callable[[], tuple[str, ...]]
    options: Mapping[str, Callable[[], object]]
    """By the names that they have in `LearnOptions`."""

    def request(self, published: str) -> Request:
        """What is to be learned from what, and how, as the parameters are now.

        Args:
            published: The document that is published now.

        Raises:
            OptionError: A directory makes no sense.
        """
        return Request(
            str(self.demonstrations().absolute()),
            {name: read() for name, read in self.options.items()},
            self.binary(),
            self.categorical(),
            published if self.only_better() else "",
            str(file) if (file := self.rules.file()) else "",
            self.rules.repair(),
            self.rules.action_results(),
        )


def declare_settings(node: Node) -> LearnerSettings:
    """Declares the parameters.

    Raises:
        OptionError: One makes no sense.
    """
    declare = Parameters(node)
    settings = LearnerSettings(
        demonstrations=declare.directory(
            "demonstrations",
            "demonstrations",
            "Directory with the recordings to learn from; ~ is your home directory.",
            fixed=False,
        ),
        output=declare.directory(
            "output", "learned", "Directory for tree.json and all other output.", fixed=False
        ),
        timeout=declare.number(
            "relearn_timeout",
            0.0,
            "Time limit for learning (seconds); 0.0 for no limit.",
            0.0,
            1e6,
            fixed=False,
        ),
        relearn_after=declare.integer(
            "relearn_after",
            0,
            "Relearn automatically after this many new demonstrations; 0 to relearn only on "
            "request.",
            0,
            100_000,
            fixed=False,
        ),
        least_agreement=declare.number(
            "min_agreement",
            0.0,
            "Lowest own-history agreement with held-out rows at which a tree is published.",
            0.0,
            1.0,
            fixed=False,
        ),
        only_better=declare.flag(
            "keep_if_better",
            False,
            "Keep the published tree if it agrees with the same held-out rows better than the "
            "new one.",
            fixed=False,
        ),
        kept_trees=declare.integer(
            "kept_trees",
            20,
            "How many published trees to keep in OUTPUT/trees, for ~/rollback.",
            2,
            100_000,
            fixed=False,
        ),
        rules=_rules(declare),
        binary=declare.texts(
            "binary_features",
            [],
            "Features to treat as binary. Other features are binary if all their values are 0 or "
            "1.",
            fixed=False,
        ),
        categorical=declare.texts(
            "categorical_features", [], "Features whose numbers stand for categories.", fixed=False
        ),
        options={**_pruning(declare), **_form(declare), **_rows(declare)},
    )
    declare.refuse_others()
    return settings


def _rules(declare: Parameters) -> RuleSettings:
    """What a tree that is published must keep."""
    file = declare.text(
        "rules_file",
        "",
        "Rules file (docs/rules.md): a tree is published only if it is proven to keep these "
        "rules. Empty for none.",
        fixed=False,
    )
    return RuleSettings(
        lambda: at_home("rules_file", name) if (name := file()) else None,
        declare.flag(
            "repair",
            False,
            "Add guards to a tree that breaks a rule, instead of refusing to publish it.",
            fixed=False,
        ),
        declare.flag(
            "action_results",
            False,
            "Set this if the executor has an action_result_topic, so that actions can fail.",
            fixed=False,
        ),
    )


def _pruning(declare: Parameters) -> dict[str, Callable[[], object]]:
    """How large the tree becomes."""
    max_depth = declare.integer(
        "max_depth", 0, "Maximum depth of the decision tree; 0 for no limit.", 0, 100, fixed=False
    )
    ccp_alpha = declare.number(
        "ccp_alpha",
        -1.0,
        "Complexity parameter for pruning; 0.0 prunes nothing, and -1.0 chooses it by "
        "cross-validation.",
        -1.0,
        1e9,
        fixed=False,
    )
    level = declare.integer(
        "level",
        -1,
        "Pruning level to use instead of ccp_alpha; 0 prunes nothing, and -1 sets no level.",
        -1,
        1_000_000,
        fixed=False,
    )
    return {
        "level": lambda: None if (number := level()) < 0 else number,
        "max_depth": lambda: max_depth() or None,
        "ccp_alpha": lambda: None if (alpha := ccp_alpha()) < 0 else alpha,
    }


def _form(declare: Parameters) -> dict[str, Callable[[], object]]:
    """What stands in the tree."""
    history = declare.text(
        "history",
        "auto",
        "What the tree may test about earlier actions: the previous action, the paper's last "
        "action taken, or none. auto: the previous action, if it makes the rows simpler to "
        "explain.",
        choices=("auto", *(kind.value for kind in History)),
        fixed=False,
    )
    units = declare.texts(
        "units",
        [],
        "Units of features, such as left=m. Features with different units are not compared with "
        "each other.",
        fixed=False,
    )
    # Said at the start, not only after a first demonstration.
    _units(units())
    return {
        "delta": declare.number(
            "delta",
            0.3,
            "Threshold δ for putting actions with similar shares into one PSA node.",
            0.0,
            1.0,
            fixed=False,
        ),
        "psa": declare.text(
            "psa",
            "auto",
            "Whether to use PSA nodes. auto: where they raise agreement.",
            choices=_USES,
            fixed=False,
        ),
        "root": declare.text(
            "root",
            "selector",
            "Root node: selector makes smaller trees, parallel is what the paper uses.",
            choices=[root.value for root in Root],
            fixed=False,
        ),
        "history": lambda: None if (asked := history()) == "auto" else asked,
        "differences": declare.text(
            "differences",
            "auto",
            "Whether the tree may compare two features, as in left < right. auto: if that makes "
            "it a quarter smaller at the same agreement.",
            choices=_USES,
            fixed=False,
        ),
        "sums": declare.text(
            "sums",
            "auto",
            "Whether the tree may test weighted sums of features, as in angle + 0.4 × spin > "
            "0.02. auto: where they describe the demonstrations more briefly.",
            choices=_USES,
            fixed=False,
        ),
        "units": lambda: _units(units()),
        "simplest": declare.flag(
            "simplest",
            True,
            "Search for the simplest tree that fits the rows, up to 30 leaves.",
            fixed=False,
        ),
        "leave_out_mistakes": declare.flag(
            "leave_out_mistakes",
            True,
            "Ignore rows that look like mistakes.",
            fixed=False,
        ),
        "leave_out_conditions": declare.flag(
            "leave_out_conditions",
            True,
            "Leave out conditions that no demonstrated row needs.",
            fixed=False,
        ),
        "readable_thresholds": declare.flag(
            "readable_thresholds",
            True,
            "Move thresholds to round values within the gaps between rows.",
            fixed=False,
        ),
    }


def _units(texts: Sequence[str]) -> dict[str, str]:
    """Units by features.

    Raises:
        OptionError: A text does not name both.
    """
    units = {}
    for text in texts:
        feature, sign, unit = text.rpartition("=")
        if not (feature and sign and unit):
            raise OptionError(f"units has {text!r}, which is not FEATURE=UNIT, such as left=m.")
        units[feature] = unit
    return units


def _rows(declare: Parameters) -> dict[str, Callable[[], object]]:
    """What rows it is learned from, and judged on."""
    reaction_time = declare.number(
        "reaction_time",
        -1.0,
        "The demonstrator's reaction time, which is corrected before learning (seconds); -1.0 to "
        "estimate it from demonstrations recorded with a sample rate.",
        -1.0,
        5.0,
        fixed=False,
    )
    return {
        "reaction_time": lambda: None if (late := reaction_time()) < 0 else late,
        "test_fraction": declare.number(
            "test_fraction",
            0.25,
            "Share of the rows or demonstrations to hold out for evaluation.",
            0.0,
            0.9,
            fixed=False,
        ),
        "refit": declare.flag("refit", True, "Learn from all rows after evaluation.", fixed=False),
        "exact": declare.flag(
            "exact",
            False,
            "Grow trees on all rows even if there are more than 100000, instead of on a sample.",
            fixed=False,
        ),
        "lags": declare.integer(
            "lags",
            0,
            "Number of earlier rows whose values are features, too; needs recordings with a "
            "sample rate.",
            0,
            LARGEST_LAG,
            fixed=False,
        ),
        "random_state": declare.integer(
            "random_state",
            0,
            "Seed that decides between equally good splits.",
            0,
            2**32 - 1,
            fixed=False,
        ),
        "upsample": declare.text(
            "upsample",
            "none",
            "Whether to synthesize rows for rare actions; svm-smote needs imbalanced-learn.",
            choices=[upsampling.value for upsampling in Upsampling],
            fixed=False,
        ),
    }
