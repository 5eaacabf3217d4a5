"""What can be wrong with rules."""

from rebt_ros.errors import RebtError


class RuleError(RebtError):
    """Rules are malformed, contradict each other, or do not fit a tree.

    The message begins with the place: a file, a line and a column, from 1.
    """


class BrokenRuleError(RuleError):
    """A tree is not proven to keep its rules; the message names the rule, and a state."""


class TooManyPartsError(RuleError):
    """A tree does different things in more parts of all states than can be looked at."""

    def __init__(self) -> None:
        super().__init__(
            "the branches of the tree overlap in too many ways to look at each: learn a smaller "
            "tree, or one with leave_out_conditions off."
        )
