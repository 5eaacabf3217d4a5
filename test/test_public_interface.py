"""What `import rebt_ros` offers: all that its functions take and give, under names that stay."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import subprocess
import sys
import typing
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import rebt_ros

_CHECKOUT = Path(rebt_ros.__file__).resolve().parents[1]

#: What a tree was made of is there to be looked into, by those who know the modules.
_INNER = frozenset({rebt_ros.Learning, rebt_ros.RobotFile})


def _classes_in(hint: object) -> Iterator[type]:
    if inspect.isclass(hint) and hint.__module__.split(".")[0] == "rebt_ros":
        yield hint
    for argument in typing.get_args(hint):
        # Callable has a list of its parameters.
        for one in argument if isinstance(argument, list) else [argument]:
            yield from _classes_in(one)


def _annotated(offered: object) -> Iterator[object]:
    """The functions and classes whose annotations a user meets."""
    if inspect.isfunction(offered):
        yield offered
    elif inspect.isclass(offered) and not issubclass(offered, Enum | Exception):
        yield offered
        for name, member in vars(offered).items():
            if name == "__init__" or not name.startswith("_"):
                function = member.fget if isinstance(member, property) else member
                if inspect.isfunction(function):
                    yield function


def _needed() -> dict[type, str]:
    """Classes that parameters, results and their fields hold, and where."""
    needed: dict[type, str] = {}
    waiting = [getattr(rebt_ros, name) for name in rebt_ros.__all__]
    while waiting:
        offered = waiting.pop()
        for one in () if offered in _INNER else _annotated(offered):
            names = vars(importlib.import_module(one.__module__))
            for hint in typing.get_type_hints(one, dict(names)).values():
                for found in _classes_in(hint):
                    if found not in needed:
                        needed[found] = f"{one.__module__}.{one.__qualname__}"
                        waiting.append(found)
    return needed


def test_every_type_that_parameters_and_results_need_is_exported() -> None:
    offered = [getattr(rebt_ros, name) for name in rebt_ros.__all__]
    needed = _needed()
    assert rebt_ros.Reductions in needed
    assert rebt_ros.Span in needed
    assert {one.__name__: where for one, where in needed.items() if one not in offered} == {}


def test_no_module_has_the_name_of_what_is_exported() -> None:
    modules = {module.name for module in pkgutil.iter_modules(rebt_ros.__path__)}
    assert not modules & set(rebt_ros.__all__)


def test_what_is_exported_stays_after_all_modules_were_imported() -> None:
    program = """if True:
        import importlib, pkgutil, rebt_ros
        before = {name: getattr(rebt_ros, name) for name in rebt_ros.__all__}
        for module in pkgutil.iter_modules(rebt_ros.__path__, "rebt_ros."):
            if module.name != "rebt_ros.ros":
                importlib.import_module(module.name)
        assert before == {name: getattr(rebt_ros, name) for name in rebt_ros.__all__}
    """
    subprocess.run([sys.executable, "-c", program], cwd=_CHECKOUT, check=True)


def test_dir_and_help_name_what_is_exported() -> None:
    assert dir(rebt_ros) == sorted(rebt_ros.__all__)
    text = subprocess.run(
        [sys.executable, "-m", "pydoc", "rebt_ros"],
        cwd=_CHECKOUT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert [name for name in rebt_ros.__all__ if name not in text] == []


def test_an_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(rebt_ros, "no_such_name")


def test_names_that_programs_outside_import_are_those_of_the_rooms() -> None:
    from rebt_ros.simulation.episode import Episode
    from rebt_ros.simulation.robot import Robot

    from rebt_ros.options import Use

    assert Use is rebt_ros.Use
    assert isinstance(rebt_ros.Provenance.uses_last_action, property)
    assert Episode.__module__ == "rebt_ros.simulated_robot.episode"
    assert Robot.__module__ == "rebt_ros.simulated_robot.robot"
