"""The rules that every tree must keep before it drives."""

from __future__ import annotations

from collections.abc import Callable

from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import DocumentError
from rebt_ros.live.keeping_rules import kept
from rebt_ros.offline.rules_files import rules_for
from rebt_ros.ros.executor.settings import ExecutorSettings
from rebt_ros.verification.errors import RuleError


def rule_check(settings: ExecutorSettings) -> Callable[[LearnedTree], None]:
    """What raises DocumentError for a tree that is not proven to keep the executor's rules.

    Raises:
        RebtError: The file of rules cannot be used.
    """
    rules = rules_for(settings.rules_file, settings.robot)
    reported = bool(settings.action_result_topic)

    def check(learned: LearnedTree) -> None:
        try:
            kept(learned, rules, action_results=reported)
        except RuleError as err:
            raise DocumentError(str(err)) from err

    return check
