"""Files of rules."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.text import read_text
from rebt_ros.verification.robot_rules import rules_of, together
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.rules_file import loads


def rules_for(rules: RuleSet | str | Path | None, robot: RobotFile | None = None) -> RuleSet | None:
    """Rules, or those of a file, if any are given, and those of a robot file, if it has some.

    Raises:
        InputError: There is no such text file.
        RuleError: It is malformed.
    """
    given = rules if isinstance(rules, RuleSet) else read_rules(rules) if rules else None
    return together(given, rules_of(robot))


def read_rules(path: str | Path) -> RuleSet:
    """Reads a file of rules.

    Raises:
        InputError: There is no such text file.
        RuleError: It is malformed.
    """
    return loads(read_text(Path(path)), str(path))
