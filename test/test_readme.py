from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import rebt_ros

_README = Path(__file__).resolve().parents[1] / "README.md"

#: Wall following of a SCITOS G5 robot (UCI Machine Learning Repository).
_SCITOS = Path(__file__).resolve().parents[2] / "shared" / "data" / "scitos_g5_24.csv"


def _python_blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", _README.read_text(encoding="utf-8"), re.DOTALL)


def _run(program: str, folder: Path) -> str:
    # The package under test, installed or not.
    home = str(Path(rebt_ros.__file__).parents[1])
    path = os.pathsep.join(filter(None, (home, os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_learning_and_replaying_works_as_the_readme_says(tmp_path: Path) -> None:
    [program] = [one for one in _python_blocks() if "rebt_ros.replay" in one]
    rows = "\n".join(f"{x / 10},{'go' if x < 12 else 'stop'}" for x in range(24))
    table = f"x,action\n{rows}\n"
    for name in ("my_bag", "another.mcap"):
        program = program.replace(name, name.split(".")[0] + ".csv")
        (tmp_path / (name.split(".")[0] + ".csv")).write_text(table)
    agreement, replayed = _run(program, tmp_path).splitlines()
    assert 0 <= float(agreement) <= 1
    assert replayed == "action 1.0"


@pytest.mark.skipif(importlib.util.find_spec("gymnasium") is None, reason="needs gymnasium")
def test_the_policy_drives_an_environment_as_the_readme_says(tmp_path: Path) -> None:
    [program] = [one for one in _python_blocks() if "gymnasium" in one]
    assert int(_run(program, tmp_path).split()[0]) >= 100


@pytest.mark.skipif(not _SCITOS.is_file(), reason="needs ../shared/data")
def test_the_tree_in_the_readme_is_what_the_command_prints(tmp_path: Path) -> None:
    shown = _README.read_text(encoding="utf-8").split("```")[1].strip()
    command, _, excerpt = shown.partition("\n")
    assert command == "$ ros2 run rebt_ros learn scitos_g5_24.csv --no-header"
    program = (
        "from rebt_ros.commands import learn\n"
        f"learn.main([{str(_SCITOS)!r}, '--no-header', '--out', 'out'])"
    )
    # The sentence is wrapped in the README.
    printed = " ".join(_run(program, tmp_path).split())
    assert " ".join(excerpt.split()) in printed


def test_percentages_in_the_readme_are_those_of_the_pages_that_it_names() -> None:
    bullets = re.split(r"^- (?=\*\*)", _README.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    checked = 0
    for bullet in bullets:
        pages = re.findall(r"\]\((docs/\w+\.md)\)", bullet)
        said = "".join((_README.parent / page).read_text(encoding="utf-8") for page in pages)
        for figure in re.findall(r"(\d+) %", bullet) if pages else ():
            assert re.search(rf"\b{figure}\b", said), (figure, pages)
            checked += 1
    assert checked >= 3
