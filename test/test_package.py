"""What is installed is whole, and says of itself what is true."""

from __future__ import annotations

import ast
import doctest
import importlib
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import pytest
import yaml

import rebt_ros.errors

PACKAGE: Final = "rebt_ros"
CHECKOUT: Final = Path(__file__).resolve().parents[1]
INSTALLED: Final = Path(rebt_ros.errors.__file__).parent
SOURCES: Final = sorted(path.relative_to(CHECKOUT) for path in (CHECKOUT / PACKAGE).rglob("*.py"))
CORE: Final = [path for path in SOURCES if path.parts[1] not in {"commands", "ros"}]

#: Import name to the name in package.xml and in setup.py; ROS packages have one name.
DECLARED_AS: Final = {
    "joblib": ("python3-joblib", "joblib"),
    "networkx": ("python3-networkx", "networkx"),
    "numpy": ("python3-numpy", "numpy"),
    "py_trees": ("py_trees", "py_trees"),
    "pyeda": (None, "pyeda"),  # has no rosdep key
    "rosbags": ("python3-rosbags-pip", "rosbags"),
    "scipy": ("python3-scipy", "scipy"),
    "sklearn": ("python3-sklearn", "scikit-learn"),
    "yaml": ("python3-yaml", "pyyaml"),
}

#: Imported only where they are installed.
OPTIONAL: Final = {"aiohttp", "distributed", "imblearn", "matplotlib", "zmq"}

needs_installation = pytest.mark.skipif(
    INSTALLED == CHECKOUT / PACKAGE, reason="run from the checkout, not by 'make test'"
)


def _manifest() -> ElementTree.Element:
    return ElementTree.parse(CHECKOUT / "package.xml").getroot()


def _setup_arguments() -> dict[str, object]:
    """The literal arguments of setup.py's call."""
    tree = ast.parse((CHECKOUT / "setup.py").read_text(encoding="utf-8"))
    call = next(
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "setup"
    )
    return {
        keyword.arg: keyword.value.value
        if isinstance(keyword.value, ast.Constant)
        else ast.unparse(keyword.value)
        for keyword in call.keywords
        if keyword.arg
    }


def _imported_packages() -> set[str]:
    names: set[str] = set()
    for path in SOURCES:
        for node in ast.walk(ast.parse((CHECKOUT / path).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names.update(alias.name.split(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names.add(node.module.split(".")[0])
    return names - sys.stdlib_module_names - OPTIONAL - {PACKAGE, "__future__"}


def _module_name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_every_imported_package_is_declared_in_package_xml() -> None:
    depends = {element.text for element in _manifest().iter("exec_depend")}
    keys = {name: DECLARED_AS.get(name, (name, name))[0] for name in _imported_packages()}
    assert {name: key for name, key in keys.items() if key and key not in depends} == {}


def test_setup_py_declares_what_is_imported_from_pypi_and_no_ros() -> None:
    declared = set(re.findall(r"'([\w-]+)>=", str(_setup_arguments()["install_requires"])))
    imported = _imported_packages() & DECLARED_AS.keys()
    assert {DECLARED_AS[name][1] for name in imported} - declared == set()
    assert declared <= {name for _, name in DECLARED_AS.values()}


def _bounds() -> dict[str, str]:
    """The lower bound of every requirement in setup.py that has one, extras included."""
    text = (CHECKOUT / "setup.py").read_text(encoding="utf-8")
    found = re.findall(r'"([\w-]+)>=([\d.]+)"', text)
    # The extra for clusters needs a newer joblib than the rest.
    return dict(reversed(found))


def _pins(file: str) -> dict[str, str]:
    lines = (CHECKOUT / ".ci" / file).read_text(encoding="utf-8").splitlines()
    return dict(line.split("==") for line in lines if not line.startswith("#"))


def _release(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version.partition(".post")[0])]


def test_the_lowest_versions_that_are_tested_are_those_that_setup_py_allows() -> None:
    pins, bounds = _pins("lowest.txt"), _bounds()
    # Not a part of what is tested with the lowest versions; see setup.sh.
    assert bounds.keys() - pins.keys() == {"distributed", "minigrid"}
    assert pins.keys() <= bounds.keys()
    for name, pin in pins.items():
        assert (pin + ".").startswith(bounds[name] + "."), name


def test_the_bounds_admit_what_ubuntu_and_jazzy_ship() -> None:
    pins, bounds = _pins("jazzy.txt"), _bounds()
    assert pins.keys() <= bounds.keys()
    assert {"numpy", "scikit-learn", "networkx", "py_trees"} <= pins.keys()
    assert [name for name, pin in pins.items() if _release(pin) < _release(bounds[name])] == []


def test_the_version_is_the_same_everywhere() -> None:
    version = _manifest().findtext("version")
    assert _setup_arguments()["version"] == version
    changelog = (CHECKOUT / "CHANGELOG.rst").read_text(encoding="utf-8")
    newest = re.search(r"^(\d+\.\d+\.\d+|Forthcoming)", changelog, re.MULTILINE)
    assert newest is not None
    assert newest[1] in {version, "Forthcoming"}


def test_colcon_will_take_it_for_an_ament_python_package() -> None:
    # colcon falls back to plain Python, silently, when the manifest does not parse.
    catkin_pkg = pytest.importorskip("catkin_pkg.package")
    package = catkin_pkg.parse_package(str(CHECKOUT / "package.xml"))
    assert package.name == PACKAGE
    assert package.get_build_type() == "ament_python"


def test_every_directory_of_modules_is_a_package() -> None:
    # setup.py leaves a directory without __init__.py out, and nobody notices in the checkout.
    assert [path for path in SOURCES if not (CHECKOUT / path.parent / "__init__.py").exists()] == []


@needs_installation
def test_the_tests_run_on_the_installed_package_and_it_is_complete() -> None:
    prefix = CHECKOUT / "install" / PACKAGE
    assert INSTALLED.is_relative_to(prefix)
    shipped = sorted(
        path.relative_to(CHECKOUT)
        for path in (CHECKOUT / PACKAGE).rglob("*")
        if path.suffix in {".py", ".json", ".html", ".css", ".js"} or path.name == "py.typed"
    )
    assert [path for path in shipped if not (INSTALLED.parent / path).is_file()] == []
    assert [
        path.relative_to(INSTALLED.parent)
        for path in INSTALLED.rglob("*.py")
        if path.relative_to(INSTALLED.parent) not in SOURCES
    ] == []


@needs_installation
def test_ros2_run_finds_an_executable_for_every_entry_point() -> None:
    ament_index_python = pytest.importorskip("ament_index_python")
    prefix = Path(ament_index_python.get_package_prefix(PACKAGE))
    names = metadata.distribution(PACKAGE).entry_points.select(group="console_scripts").names
    assert {"demo", "demonstrator", "executor", "learn", "learner", "recorder", "replay"} <= names
    found = {path.name for path in (prefix / "lib" / PACKAGE).iterdir() if path.is_file()}
    assert found == names


@needs_installation
def test_every_entry_point_can_be_loaded() -> None:
    for entry_point in metadata.distribution(PACKAGE).entry_points.select(group="console_scripts"):
        assert callable(entry_point.load()), entry_point


@needs_installation
def test_every_node_begins_where_signals_are_heard_at_once() -> None:
    scripts = metadata.distribution(PACKAGE).entry_points.select(group="console_scripts")
    nodes = {one.name for one in scripts if one.value.startswith(f"{PACKAGE}.ros.")}
    begun = (
        path
        for path in SOURCES
        if path.parent.parent.name == "ros" and "\ndef main(" in path.read_text(encoding="utf-8")
    )
    assert nodes == {path.parent.name if path.stem == "node" else path.stem for path in begun}
    assert {one.module for one in scripts if one.name in nodes} == {f"{PACKAGE}.ros.entry"}


@needs_installation
def test_the_parameter_files_are_installed() -> None:
    ament_index_python = pytest.importorskip("ament_index_python")
    share = Path(ament_index_python.get_package_share_directory(PACKAGE))
    shipped = {path.name for path in (CHECKOUT / "config").iterdir()}
    assert {path.name for path in (share / "config").glob("*")} == shipped
    assert {"executor.yaml", "learner.yaml", "recorder.yaml", "sros2_policy.xml"} <= shipped


@pytest.mark.parametrize("path", CORE, ids=_module_name)
def test_the_examples_in_docstrings_are_true(path: Path) -> None:
    results = doctest.testmod(importlib.import_module(_module_name(path)))
    assert results.failed == 0


def _first_line(line: str, blocking: tuple[str, str] | None) -> str:
    """What setup.py, which cannot be imported, writes in place of the first line of a script."""
    tree = ast.parse((CHECKOUT / "setup.py").read_text(encoding="utf-8"))
    functions = [
        one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name == "_first_line"
    ]
    namespace: dict[str, object] = {}
    exec(compile(ast.Module(functions, []), "setup.py", "exec"), namespace)
    written = namespace["_first_line"](line, blocking)  # type: ignore[operator]
    assert isinstance(written, str)
    return written


@pytest.mark.parametrize("blocking", [None, ("/usr/bin/env", "--block-signal=INT,TERM")])
def test_an_executable_starts_where_the_path_of_the_interpreter_has_blanks(
    tmp_path: Path, blocking: tuple[str, str] | None
) -> None:
    directory = tmp_path / "my ws, # and %"
    directory.mkdir()
    interpreter = directory / "python"
    interpreter.symlink_to(sys.executable)
    script = directory / "script"
    begin = _first_line(f'#!"{interpreter}"', blocking)
    script.write_text(f"{begin}\nimport sys\nprint(sys.argv[1:])\n")
    script.chmod(0o755)
    done = subprocess.run([script, "a b"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "['a b']\n", "")
    plain = f"#!{sys.executable}"
    assert _first_line(plain, None) == plain


def test_what_is_sourced_works_where_the_path_of_the_interpreter_has_blanks(tmp_path: Path) -> None:
    makefile = (CHECKOUT / "Makefile").read_text()
    quoted = next(line for line in makefile.splitlines() if line.startswith("QUOTED := "))
    command = quoted.removeprefix("QUOTED := ").replace("$$", "$")
    interpreter = tmp_path / "my python"
    interpreter.symlink_to(sys.executable)
    script = tmp_path / "local_setup.sh"
    # As colcon writes it.
    script.write_text(
        f'_colcon_python_executable="{interpreter}"\n'
        """_commands="$($_colcon_python_executable -c 'print(1 + 1)')"\necho "$_commands"\n"""
    )
    subprocess.run(f"{command} {script}", shell=True, check=True)
    done = subprocess.run(["sh", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "2\n", "")


@pytest.mark.parametrize("value", ["/my ws #1/it's, %é/robot.yaml", True, 0.5, 3])
def test_the_demo_gives_nodes_their_parameters_whatever_is_in_a_path(value: object) -> None:
    demo = pytest.importorskip("rebt_ros.commands.demo")
    given = demo._yaml(Path(value) if isinstance(value, str) else value)
    assert yaml.safe_load(given) == value


@needs_installation
def test_the_demo_finds_its_files_where_nothing_was_sourced() -> None:
    environment = {
        name: value
        for name, value in os.environ.items()
        if "PYTHON" not in name and "AMENT" not in name
    }
    code = "from rebt_ros.commands import demo; print(demo._shared_files())"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        capture_output=True,
        text=True,
        env=environment | {"PYTHONPATH": str(INSTALLED.parent)},
        check=False,
    )
    assert Path(done.stdout.strip()) == INSTALLED.parents[3] / "share" / PACKAGE, done.stderr


@needs_installation
@pytest.mark.parametrize("command", ["learn", "show", "recorder"])
def test_an_executable_finds_its_package_where_nothing_was_sourced(command: str) -> None:
    executable = INSTALLED.parents[2] / PACKAGE / command
    environment = {
        name: value
        for name, value in os.environ.items()
        if "PYTHON" not in name and "AMENT" not in name
    }
    done = subprocess.run(
        [executable, "--help"], capture_output=True, text=True, env=environment, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
