"""What was never shown is suggested as rules, which what was shown keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import strategies as some
from hypothesis import HealthCheck, given, settings

from rebt_ros.commands import suggest_rules as command
from rebt_ros.demonstration.table import DemonstrationTable
from rebt_ros.verification import suggesting_rules
from rebt_ros.verification.proof import check
from rebt_ros.verification.resolving import demands
from rebt_ros.verification.rules_file import loads
from rebt_ros.verification.suggesting_rules import suggested_rules
from rebt_ros.verification.verdict import verdicts


def rows(count: int) -> DemonstrationTable:
    """Goes where nothing is near, and turns elsewhere."""
    distances = np.linspace(0.0, 1.0, count)
    states = [(one, 0.5, index % 2, index % 3) for index, one in enumerate(distances)]
    return some.table(states, [0 if one > 0.3 else 2 for one in distances])


def test_the_strongest_rule_says_below_what_an_action_was_never_shown() -> None:
    first, *_ = suggested_rules(rows(200))
    assert (first.action, first.when) == ("go", "distance < 0.301")
    assert (first.support, first.rows) == (60, 200)
    assert 0 <= first.margin < 0.01


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(some.tables())
def test_every_suggestion_can_be_read_and_no_row_breaks_it(table: DemonstrationTable) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suggesting_rules, "_FEWEST_ROWS", 1)
        found = suggested_rules(table)
    learned = some.learned(some.action("go"))
    for one in found:
        asked = demands(loads(f"rules:\n- never: {one.action}\n  when: {one.when}\n"), learned)
        coverage = verdicts(check(learned, asked, [table]), asked)[0].coverage
        assert (coverage.rows, coverage.breaking) == (one.support, 0)


def test_the_command_writes_a_file_of_rules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = rows(200)
    path = tmp_path / "shown.csv"
    lines = [
        f"{distance},{'go' if code == 0 else 'turn'}"
        for (distance, *_), code in zip(table.states, table.chosen, strict=True)
    ]
    path.write_text("\n".join(["distance,action", *lines]))
    command.main([str(path), "--most", "2"])
    out = capsys.readouterr().out
    assert "# Never shown in 60 of 200 rows, which have other actions" in out
    rules = loads(out).rules
    assert str(rules[0]) == "never go when distance < 0.301"
    assert str(rules[1]).startswith("never turn when distance > 0.")


def test_where_everything_was_shown_everywhere_nothing_is_suggested(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "shown.csv"
    lines = [f"{number % 2},{'go' if number // 2 % 2 else 'turn'}" for number in range(40)]
    path.write_text("\n".join(["near,action", *lines]))
    command.main([str(path)])
    assert loads(capsys.readouterr().out).rules == ()
