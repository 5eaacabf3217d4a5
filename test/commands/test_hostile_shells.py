"""Commands and nodes where the terminal, the home or the paths are not what one expects."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
import warm_processes
from warm_processes import HOME

ROWS = "".join(
    f"{x / 10},{'no' if x % 3 else 'yes'},{'go' if x < 20 else 'turn'}\n" for x in range(40)
)
COMMANDS = (
    "check",
    "demo",
    "describe",
    "experiment",
    "explain",
    "export",
    "generate",
    "inspect",
    "learn",
    "replay",
    "revise",
    "show",
    "simulate",
    "suggest_rules",
    "trial",
)
NODES = ("demonstrator", "executor", "learner", "recorder", "robot", "studio", "synthetic_robot")


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return _table(tmp_path)


def _table(directory: Path) -> Path:
    # The action is one that no narrow encoding knows.
    path = directory / "table.csv"
    path.write_text(f"front,docked,action\n{ROWS}".replace("turn", "dreh … ≤"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A table and what was learned from it, which tests leave as they are."""
    directory = tmp_path_factory.mktemp("learned")
    table = _table(directory)
    assert _run("learn", table, "--out", directory).returncode == 0
    return table, directory / "tree.json"


def _run(
    command: str, *arguments: object, shell: str = "", **variables: str | None
) -> subprocess.CompletedProcess[str]:
    module = f"rebt_ros.commands.{command}"
    if not shell and not variables:
        return warm_processes.run(module, *arguments)
    return _python("-m", module, *arguments, shell=shell, **variables)


def _python(
    *arguments: object, shell: str = "", **variables: str | None
) -> subprocess.CompletedProcess[str]:
    environment = dict(os.environ, PYTHONPATH=str(HOME)) | {
        name: value for name, value in variables.items() if value is not None
    }
    for name in [name for name, value in variables.items() if value is None]:
        environment.pop(name, None)
    start = [sys.executable, *map(str, arguments)]
    if shell:
        start = ["sh", "-c", f'exec "$@" {shell}', "sh", *start]
    return subprocess.run(
        start,
        env=environment,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=300,
        check=False,
    )


#: Runs modules, each in a process of its own that has imported already what they share.
_TOGETHER = """
import gc, importlib, json, os, runpy, sys
directory, calls = sys.argv[1], json.loads(sys.argv[2])
for module, *_ in calls:
    importlib.import_module(module)
# Else each of them, as it ends, looks through all that was imported.
gc.freeze()
codes = []
for place, (module, *arguments) in enumerate(calls):
    child = os.fork()
    if not child:
        sys.argv = [module, *arguments]
        del sys.modules[module]
        for stream in (1, 2):
            path = os.path.join(directory, f"{place}.{stream}")
            os.dup2(os.open(path, os.O_CREAT | os.O_WRONLY), stream)
        runpy.run_module(module, run_name="__main__")
        sys.exit()
    codes.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
print(json.dumps(codes))
"""


def _together(
    directory: Path, *calls: Sequence[object], **variables: str | None
) -> list[subprocess.CompletedProcess[str]]:
    """Runs commands one after the other, all where the environment is the same."""
    called = [[f"rebt_ros.commands.{name}", *map(str, arguments)] for name, *arguments in calls]
    directory.mkdir()
    done = _python("-c", _TOGETHER, directory, json.dumps(called), **variables)
    assert (done.returncode, done.stderr) == (0, "")

    def said(place: int, stream: int) -> str:
        return (directory / f"{place}.{stream}").read_text(errors="replace")

    return [
        subprocess.CompletedProcess(called[place], code, said(place, 1), said(place, 2))
        for place, code in enumerate(json.loads(done.stdout))
    ]


ENCODINGS: list[dict[str, str | None]] = [
    {"PYTHONIOENCODING": "ascii"},
    {"PYTHONIOENCODING": "latin-1"},
    {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    {"HOME": None},
]


@dataclass(frozen=True)
class Said:
    """What commands said where the environment is not what one expects."""

    helps: Sequence[subprocess.CompletedProcess[str]]
    work: Sequence[subprocess.CompletedProcess[str]]
    out: Path
    """Where they wrote."""


@pytest.fixture(scope="module", params=ENCODINGS, ids=str)
def said(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Said:
    directory = tmp_path_factory.mktemp("environment")
    table, out = _table(directory), directory / "out"
    tree = out / "tree.json"
    helps = [(command, "--help") for command in COMMANDS]
    work = [("learn", table, "--out", out), ("replay", tree, table), ("show", tree)]
    done = _together(directory / "said", *helps, *work, **request.param)
    return Said(done[: len(helps)], done[len(helps) :], out)


def test_learn_replay_and_show_write_what_the_terminal_can_show(said: Said) -> None:
    for done in said.work:
        assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr
        assert done.stdout
    assert "dreh … ≤" in (said.out / "tree.txt").read_text(encoding="utf-8")


def test_every_command_has_help_for_every_terminal(said: Said) -> None:
    for done in said.helps:
        assert (done.returncode, done.stderr) == (0, ""), done.args
        assert "usage" in done.stdout


@pytest.mark.parametrize("command", ["export", "learn", "replay", "show"])
def test_a_command_whose_output_is_closed_does_its_work(
    command: str, learned: tuple[Path, Path], tmp_path: Path
) -> None:
    table, tree = learned
    inputs = {"learn": (table, "--out", tmp_path), "replay": (tree, table)}
    arguments = inputs.get(command, (tree,))
    for shell in (">&-", ">&- 2>&-"):
        done = _run(command, *arguments, shell=shell)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
@pytest.mark.parametrize("command", ["export", "learn", "replay", "show"])
def test_a_command_whose_output_is_full_says_so(
    command: str, learned: tuple[Path, Path], tmp_path: Path
) -> None:
    table, tree = learned
    inputs = {"learn": (table, "--out", tmp_path), "replay": (tree, table)}
    done = _run(command, *inputs.get(command, (tree,)), shell=">/dev/full")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"{command}: the output cannot be written (No space left on device)."
    )
    assert "Traceback" not in done.stderr


def test_a_link_to_an_input_is_the_input(table: Path, tmp_path: Path) -> None:
    link = tmp_path / "a link with blanks, # and %.csv"
    link.symlink_to(table)
    done = _run("learn", link, "--out", tmp_path / "ä # % out")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "ä # % out" / "tree.json").is_file()


@pytest.mark.parametrize("out", ["", "  "])
def test_a_directory_without_a_name_is_refused(out: str, table: Path) -> None:
    done = _run("learn", table, "--out", out)
    assert done.returncode == 2
    assert "a directory needs a name" in done.stderr


def test_a_file_in_place_of_the_directory_is_named(table: Path) -> None:
    done = _run("learn", table, "--out", table)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert str(table) in done.stderr


def test_show_writes_each_kind_of_file_and_refuses_others(
    learned: tuple[Path, Path], tmp_path: Path
) -> None:
    table, tree = learned
    for suffix, begins in ((".svg", "<?xml"), (".DOT", "digraph"), (".txt", "[o] Selector")):
        path = tmp_path / f"shown{suffix}"
        done = _run("show", tree, "--out", path)
        assert done.returncode == 0, done.stderr
        assert path.read_text(encoding="utf-8").startswith(begins)
    done = _run("show", tree, "--out", tmp_path / "shown.gif")
    assert done.returncode == 1
    assert "ends in .svg, .png, .dot, .txt" in done.stderr
    done = _run("show", table)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr


def _node(node: str, *arguments: str, shell: str = "") -> subprocess.CompletedProcess[str]:
    start = [sys.executable, "-m", "rebt_ros.ros.entry", node, *arguments]
    if shell:
        start = ["sh", "-c", f'exec "$@" {shell}', "sh", *start]
    environment = dict(os.environ, PYTHONPATH=str(HOME), PYTHONIOENCODING="ascii")
    return subprocess.run(
        start, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize("node", NODES)
def test_every_node_answers_a_call_for_help_and_what_it_does_not_understand(node: str) -> None:
    done = _node(node, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: {node} [--ros-args")
    done = _node(node, "rate:=5")
    assert done.returncode == 1
    assert "the argument 'rate:=5' is not understood" in done.stderr + done.stdout
    assert "Traceback" not in done.stderr
