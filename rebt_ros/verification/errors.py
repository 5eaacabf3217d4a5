"""What can be wrong with rules."""

from rebt_ros.errors import RebtError


class RuleError(RebtError):
    """Rules are malformed, contradict each other, or do not fit a tree.

    The message begins with the place: a file, a line and a column, from 1.
    """


class BrokenRuleError(RuleError):
    """A tree is not proven to keep its rules; the message names the rule, and a state."""
