"""The layers of the package, as rules that fail.

Every module's imports are read from its syntax tree, also those inside functions and those for
type checkers, so that a rule holds on paths which no test takes.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache, cached_property
from pathlib import Path
from typing import Final

import pytest

PACKAGE: Final = "rebt_ros"
CHECKOUT: Final = Path(__file__).resolve().parents[1]

#: From the top down.  A module imports from its own unit and from lower layers; the units that
#: share a layer know nothing of each other.
LAYERS: Final = (
    {"commands"},
    {"ros"},
    {"live"},
    {"studio"},
    {PACKAGE},  # rebt_ros/__init__.py, the public interface
    {"offline", "study", "options", "simulation"},
    {"inspection", "learning", "trial"},
    {"storage", "simulated_robot", "drawing", "beyond_the_paper", "export", "verification"},
    {"paper"},
    {"decision_tree"},
    {"behavior_tree"},
    {"robot_file"},
    {"demonstration"},
    {"logic", "message_path", "workers"},
    {"errors", "arrays", "streams", "codec"},
)
DEPTH: Final = {unit: depth for depth, units in enumerate(LAYERS) for unit in units}

#: The files and directories of the repository that git may track.
TOP_LEVEL: Final = frozenset(
    {
        ".ci",
        ".dockerignore",
        ".editorconfig",
        ".gitattributes",
        ".gitignore",
        ".ruff.toml",
        "CHANGELOG.rst",
        "CONTRIBUTING.md",
        "Dockerfile",
        "LICENSE",
        "Makefile",
        "QUALITY_DECLARATION.md",
        "README.md",
        "config",
        "doc",
        "docs",
        "package.xml",
        PACKAGE,
        "resource",
        "rosdoc2.yaml",
        "setup.cfg",
        "setup.py",
        "test",
    }
)

#: Top-level packages of ROS, and the modules that may know them.
ROS: Final = frozenset(
    {
        "action_msgs",
        "ament_index_python",
        "builtin_interfaces",
        "diagnostic_msgs",
        "geometry_msgs",
        "launch",
        "launch_ros",
        "nav_msgs",
        "rcl_interfaces",
        "rclpy",
        "ros2cli",
        "rosidl_runtime_py",
        "sensor_msgs",
        "std_msgs",
        "std_srvs",
        "test_msgs",
    }
)
ROS_HOMES: Final = ("rebt_ros.ros", "rebt_ros.ros.*", "rebt_ros.commands.demo*")

#: Libraries with a home: the only modules that import them.
HOMES: Final = {
    "aiohttp": ("rebt_ros.ros.studio.server",),
    "apsw": ("rebt_ros.storage.bag_safety",),
    "distributed": ("rebt_ros.workers",),
    "imblearn": ("rebt_ros.decision_tree.svm_smote",),
    "jsonschema": (),
    "joblib": ("rebt_ros.commands.bench_*", "rebt_ros.workers"),
    "matplotlib": ("rebt_ros.drawing.*",),
    "networkx": ("rebt_ros.paper.lat_*", "rebt_ros.study.edit_distance.networkx_worker"),
    "py_trees": (
        "rebt_ros.behavior_tree.runtime",
        "rebt_ros.learning.py_trees_form",
        "rebt_ros.live.action_results",
        "rebt_ros.live.long_command",
        "rebt_ros.ros.*",
        "rebt_ros.study.simulator.py_trees_form",
    ),
    "pyeda": ("rebt_ros.logic.minimize",),
    "rosbags": ("rebt_ros.storage", "rebt_ros.storage.*"),
    "scipy": (
        "rebt_ros.learning.mistakes",
        "rebt_ros.study.edit_distance.integer_program",
        "rebt_ros.study.edit_distance.relaxation",
        "rebt_ros.verification.linear_bounds",
    ),
    "sklearn": ("rebt_ros.decision_tree", "rebt_ros.decision_tree.*"),
    "yaml": (
        "rebt_ros.robot_file.*",
        "rebt_ros.ros.parameter_files",
        "rebt_ros.storage.bag_metadata",
        "rebt_ros.verification.rules_file",
    ),
    "zmq": ("rebt_ros.live.groot2_server",),
}

#: Run code that comes from data, or read formats that do.
DANGEROUS_NAMES: Final = frozenset({"eval", "exec", "__import__"})
DANGEROUS_MODULES: Final = frozenset({"dill", "marshal", "pickle", "shelve"})


@dataclass(frozen=True)
class Module:
    """A module of the package."""

    name: str
    path: Path

    @property
    def unit(self) -> str:
        """The subpackage or top-level module that it belongs to."""
        parts = self.name.split(".")
        return parts[1] if len(parts) > 1 else PACKAGE

    @property
    def is_core(self) -> bool:
        return self.unit not in {"commands", "ros"}

    @cached_property
    def parts(self) -> tuple[ast.AST, ...]:
        """All nodes of its syntax tree."""
        return tuple(ast.walk(ast.parse(self.path.read_text(encoding="utf-8"), str(self.path))))

    @cached_property
    def imports(self) -> tuple[tuple[int, str], ...]:
        """Line and absolute dotted name of everything that is imported.

        ``from a import b`` is ``a.b``, whether b is a module or not.
        """
        found: list[tuple[int, str]] = []
        for node in self.parts:
            if isinstance(node, ast.Import):
                found += [(node.lineno, alias.name) for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                base = self._absolute(node)
                found += [(node.lineno, f"{base}.{alias.name}") for alias in node.names]
        return tuple(found)

    def _absolute(self, node: ast.ImportFrom) -> str:
        if not node.level:
            return node.module or ""
        parents = self.name.split(".")
        if self.path.name != "__init__.py":
            parents = parents[:-1]
        parents = parents[: len(parents) - (node.level - 1)]
        return ".".join([*parents, node.module] if node.module else parents)

    def is_one_of(self, patterns: tuple[str, ...]) -> bool:
        return any(fnmatch(self.name, pattern) for pattern in patterns)

    def __str__(self) -> str:
        return str(self.path.relative_to(CHECKOUT))


def _module(path: Path) -> Module:
    parts = list(path.relative_to(CHECKOUT).with_suffix("").parts)
    return Module(".".join(parts[:-1] if parts[-1] == "__init__" else parts), path)


MODULES: Final = [_module(path) for path in sorted((CHECKOUT / PACKAGE).rglob("*.py"))]
CORE: Final = [module for module in MODULES if module.is_core]


def _unit_of(name: str) -> str | None:
    """The unit of an imported name; None where it is not ours."""
    parts = name.split(".")
    if parts[0] != PACKAGE:
        return None
    # ``from rebt_ros import learn`` takes a name from the public interface.
    return parts[1] if len(parts) > 1 and _is_unit(parts[1]) else PACKAGE


@cache
def _is_unit(name: str) -> bool:
    source = CHECKOUT / PACKAGE / name
    return source.is_dir() or source.with_suffix(".py").is_file()


def _run(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_there_are_modules_to_look_at() -> None:
    assert {"logic", "ros", "commands"} <= {module.unit for module in MODULES}


def test_every_module_has_a_layer() -> None:
    assert [str(module) for module in MODULES if module.unit not in DEPTH] == []


def test_imports_go_downwards_only() -> None:
    upwards = [
        f"{module}:{line}: {module.unit} imports {name}"
        for module in MODULES
        for line, name in module.imports
        if (unit := _unit_of(name)) is not None
        and unit != module.unit
        and DEPTH.get(unit, 0) <= DEPTH.get(module.unit, 0)
    ]
    assert upwards == []


#: Modules on the longest way from an import to what it leads to.
LONGEST_CHAIN: Final = 12


def test_no_chain_of_imports_is_longer_than_twelve_modules() -> None:
    assert max(map(_chain, MODULES), key=len, default=[])[LONGEST_CHAIN:] == []


def _chain(module: Module) -> list[str]:
    """The longest way down from a module."""
    return list(_longest(module.name))


@cache
def _longest(name: str) -> tuple[str, ...]:
    own = {module.name: module for module in MODULES}
    below = {
        target
        for _, full in own[name].imports
        for target in (full, full.rpartition(".")[0])
        if target in own
        and target not in (name, PACKAGE)
        and own[target].path.name != "__init__.py"
    }
    return (name, *max(map(_longest, sorted(below)), key=len, default=()))


def test_replay_starts_without_scikit_learn() -> None:
    _run("import sys; sys.modules['sklearn'] = None; import rebt_ros.commands.replay")


def test_only_the_shells_know_ros() -> None:
    strays = [
        f"{module}:{line}: {name}"
        for module in MODULES
        for line, name in module.imports
        if name.split(".")[0] in ROS and not module.is_one_of(ROS_HOMES)
    ]
    assert strays == []


@pytest.mark.parametrize("library", sorted(HOMES))
def test_a_library_is_imported_in_its_home_only(library: str) -> None:
    strays = [
        f"{module}:{line}: {name}"
        for module in MODULES
        for line, name in module.imports
        if name.split(".")[0] == library and not module.is_one_of(HOMES[library])
    ]
    assert strays == []


def test_endpoints_of_the_executor_have_no_events() -> None:
    homes = [
        module.name
        for module in MODULES
        for node in module.parts
        if (isinstance(node, ast.keyword) and node.arg == "event_callbacks")
        or (
            module.name.startswith("rebt_ros.ros.executor.")
            and isinstance(node, ast.Attribute)
            and node.attr in {"create_publisher", "create_subscription"}
        )
    ]
    assert set(homes) == {"rebt_ros.ros.quiet_events"}


def test_the_top_level_holds_nothing_unexpected() -> None:
    if not (CHECKOUT / ".git").exists():
        pytest.skip("needs a git checkout")
    listed = subprocess.run(
        ["git", "-C", str(CHECKOUT), "ls-files", "-z"], capture_output=True, text=True, check=True
    )
    tracked = {name.split("/")[0] for name in listed.stdout.split("\0") if name}
    assert tracked == TOP_LEVEL


def test_no_data_is_run_as_code() -> None:
    assert [
        f"{module}:{line}: {what}" for module in MODULES for line, what in _dangers(module)
    ] == []


def _dangers(module: Module) -> Iterator[tuple[int, str]]:
    for line, name in module.imports:
        if name.split(".")[0] in DANGEROUS_MODULES:
            yield line, name
    for node in module.parts:
        if isinstance(node, ast.Name) and node.id in DANGEROUS_NAMES:
            yield node.lineno, node.id
        elif (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and (node.value.id, node.attr) in {("yaml", "load"), ("yaml", "unsafe_load")}
        ):
            yield node.lineno, f"yaml.{node.attr}"


def test_the_core_prints_nothing() -> None:
    printing = [
        f"{module}:{node.lineno}"
        for module in CORE
        for node in module.parts
        if isinstance(node, ast.Name) and node.id == "print"
    ]
    assert printing == []


#: A module that is None in sys.modules cannot be imported, as if it were not installed.
WITHOUT_ROS: Final = f"import importlib, sys; sys.modules.update(dict.fromkeys({sorted(ROS)}));"


#: What needs ROS, and what is no command.
_NO_OFFLINE_COMMANDS: Final = frozenset({"__init__", "asking", "demo", "progress", "shell"})


def test_the_core_and_offline_commands_run_where_ros_is_not_installed() -> None:
    offline = [
        module
        for module in MODULES
        if module.unit == "commands" and module.path.stem not in _NO_OFFLINE_COMMANDS
    ]
    assert len(offline) > 10
    # The commands first, as each is started with nothing but what it imports itself.
    names = [module.name for module in (*offline, *CORE)]
    _run(f"{WITHOUT_ROS} [importlib.import_module(name) for name in {names}]")


@pytest.mark.parametrize(
    ("node", "needed"),
    # A studio makes trees of the levels of decision trees, and grows none.
    [("recorder.node", set()), ("executor.node", set()), ("studio.node", {"pyeda"})],
)
def test_nodes_of_the_robot_load_nothing_that_only_learning_needs(
    node: str, needed: set[str]
) -> None:
    loaded = _run(f"import sys, rebt_ros.ros.{node}; print(*sys.modules)").split()
    heavy = {"distributed", "imblearn", "jsonschema", "pyeda", "rosbags", "scipy", "sklearn"}
    assert heavy & {name.split(".")[0] for name in loaded} == needed
