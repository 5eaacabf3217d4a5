"""Files of rules."""

from __future__ import annotations

from pathlib import Path

from rebt_ros.storage.text import read_text
from rebt_ros.verification.rules import RuleSet
from rebt_ros.verification.rules_file import loads


def read_rules(path: str | Path) -> RuleSet:
    """Reads a file of rules.

    Raises:
        InputError: There is no such text file.
        RuleError: It is malformed.
    """
    return loads(read_text(Path(path)), str(path))
