"""Gymnasium's lunar lander, which needs Box2D, with its own expert."""

from __future__ import annotations

from gymnasium.envs.box2d.lunar_lander import heuristic

from driving.control import Control


class Lander(Control):
    """Lands softly between two flags, with 200 points or more within 1000 steps."""

    name, environment = "lander", "LunarLander"
    features = ("x", "y", "v_x", "v_y", "angle", "spin", "left_leg", "right_leg")
    actions = ("none", "left_engine", "main_engine", "right_engine")
    most_steps = 1000

    @property
    def success(self) -> bool:
        return self.over and self._total >= 200

    def expert(self) -> str:
        """Gymnasium's own."""
        number: int = heuristic(self.world, self.observed)  # type: ignore[no-untyped-call]
        return self.actions[number]
