"""A scripted driver, as careful as a good human one."""

from __future__ import annotations

from collections.abc import Sequence

from rebt_ros.simulated_robot.robot import Action, State

_FULL_BATTERY = 0.95
_BLOCKED = 0.4
_BESIDE = 0.6
_AIMED = 0.25

#: Demonstrations after which what is learned from them drives as well.
ENOUGH = 6


def decide(state: Sequence[float]) -> str:
    """What the demonstrator does in a state.

    It looks at nothing but the state and still never turns to and fro: it passes what stands in
    its way on the left, and does not turn back to the right as long as that thing is beside it.
    """
    now = State(*state)
    if now.docked and now.battery < _FULL_BATTERY:
        return Action.CHARGE
    if now.front < _BLOCKED:
        return Action.TURN_LEFT
    if now.target_bearing > _AIMED:
        return Action.TURN_LEFT
    if now.target_bearing < -_AIMED and now.right > _BESIDE:
        return Action.TURN_RIGHT
    return Action.GO
