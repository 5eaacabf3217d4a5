"""Why an executor's last tick did what it did."""

from __future__ import annotations

from rebt_ros.live.last_tick import LastTick
from rebt_ros.verification.acting import Outcome
from rebt_ros.verification.explaining import explain_tick
from rebt_ros.verification.explanation_text import lines


def explained(tick: LastTick) -> str:
    """Which branch acted and why, in lines; see docs/rules.md.

    Raises:
        RuleError: The tree cannot be explained.
    """
    outcomes = {place: Outcome[status] for place, status in tick.outcomes.items()}
    found = explain_tick(tick.learned, outcomes)
    text: list[str] = []
    for explanation in found:
        if len(found) > 1:
            text.append(f"Channel {explanation.channel}:")
        text += lines(tick.learned, tick.values, explanation)
    return "\n".join(text)
