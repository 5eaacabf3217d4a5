"""The tasks by their names; those whose packages are missing are known but cannot be had."""

from __future__ import annotations

import importlib
from importlib.util import find_spec

from driving import shared
from driving.task import Task
from rebt_ros.errors import OptionError

_HOMES = {
    "robot": "robot.Drive",
    "shuttle": "memory.Shuttle",
    "carry": "memory.Carry",
    "bell": "memory.Bell",
    "knock": "memory.Knock",
    "cartpole": "control.CartPole",
    "mountaincar": "control.MountainCar",
    "acrobot": "control.Acrobot",
    "lander": "lander.Lander",
    "ice": "grids.Ice",
    "taxi": "grids.Taxi",
    "empty": "grids.Empty",
    "doorkey": "grids.DoorKey",
    "wall": "wheels.Wall",
    "vacuum": "wheels.Vacuum",
    "parking": "wheels.Parking",
    "follow": "wheels.Follow",
    "fetch": "wheels.Fetch",
    "pendulum": "chores.Pendulum",
    "thermostat": "chores.Thermostat",
    "elevator": "chores.Elevator",
    "sorter": "chores.Sorter",
    "crossing": "chores.Crossing",
    "guard": "errands.Guard",
    "compass": "errands.Compass",
    "waiter": "errands.Waiter",
    "mower": "errands.Mower",
    "belt": "errands.Belt",
    "forage": "errands.Forage",
}
NAMES = tuple(_HOMES)
#: What is driven unless tasks are named: of `knock` it is known that nobody learns it.
USUAL = tuple(name for name in NAMES if name != "knock")

_NEEDED = {
    "control": ("gymnasium",),
    "lander": ("gymnasium", "Box2D"),
    "grids": ("gymnasium", "minigrid"),
}
#: Their tasks are in one file, which imports all of them.
_NEEDED_BY_SHARED = ("gymnasium", "Box2D", "minigrid")


def task_named(name: str) -> Task:
    """A task, before its first episode.

    Raises:
        OptionError: There is no such task, or it needs a package that is not installed.
    """
    if missing := missing_for(name):
        raise OptionError(
            f"the task {name!r} needs {' and '.join(missing)}: "
            "pip install 'gymnasium[box2d]' minigrid."
        )
    if name.startswith(shared.PREFIX):
        return _shared(name)
    if name not in _HOMES:
        raise OptionError(f"there is no task {name!r}: choose of {', '.join(NAMES)}.")
    module, _, kind = _HOMES[name].partition(".")
    task: Task = getattr(importlib.import_module(f"driving.{module}"), kind)()
    return task


def missing_for(name: str) -> tuple[str, ...]:
    """The packages that a task needs and that are not installed."""
    if name.startswith(shared.PREFIX):
        return tuple(one for one in _NEEDED_BY_SHARED if find_spec(one) is None)
    module, _, _ = _HOMES.get(name, "").partition(".")
    return tuple(one for one in _NEEDED.get(module, ()) if find_spec(one) is None)


def _shared(name: str) -> Task:
    if not shared.is_there():
        raise OptionError(f"the task {name!r} needs ../shared/closed_loop, which is not there.")
    if name not in shared.names():
        raise OptionError(f"there is no task {name!r}: choose of {', '.join(shared.names())}.")
    return shared.shared_task(name)
