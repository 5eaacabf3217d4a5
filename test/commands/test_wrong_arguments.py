"""Arguments that make no sense are refused in words of their own, before anything is done."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from rebt_ros.commands import experiment, generate, learn, simulate

COMMANDS: Mapping[str, Callable[[list[str]], None]] = {
    "experiment": experiment.main,
    "generate": generate.main,
    "learn": learn.main,
    "simulate": simulate.main,
}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("learn x.csv --max-depth 3.5", "'3.5' is neither a whole number nor auto"),
        ("learn x.csv --max-depth many", "'many' is neither a whole number nor auto"),
        ("learn x.csv --ccp-alpha small", "'small' is neither a number nor auto"),
        ("learn x.csv --reaction-time 0,3", "'0,3' is neither a number nor auto"),
        ("learn x.csv --history lat", "'lat' is none of auto, none, previous, last"),
        ("learn x.csv --root priority", "'priority' is none of "),
        ("learn x.csv --psa yes", "'yes' is none of auto, always, never"),
        ("learn x.csv --psa-as choice", "'choice' is none of "),
        ("learn x.csv --differences no", "'no' is none of auto, always, never"),
        ("learn x.csv --upsample smote", "'smote' is none of none, svm-smote"),
        ("learn x.csv --rows action", "'action' is none of event, sample"),
        ("learn x.csv --unit left:m", "'left:m' is not FEATURE=UNIT"),
        ("learn x.csv --out FILE", "is no directory: name another place"),
        ("learn x.csv --out FILE/learned", "is no directory: name another place"),
        ("simulate x.json --out FILE", "is no directory: name another place"),
        ("simulate x.json --bag rosbag", "'rosbag' is none of "),
        ("generate 3 --out FILE", "is no directory: name another place"),
        ("experiment DIRECTORY/nowhere", "nowhere is no directory: name one of configuration"),
    ],
)
def test_what_an_argument_cannot_be_is_said_in_words(
    line: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    line = line.replace("FILE", str(file)).replace("DIRECTORY", str(tmp_path))
    command, *arguments = line.split()
    with pytest.raises(SystemExit) as ended:
        COMMANDS[command](arguments)
    assert ended.value.code in (1, 2)
    output = capsys.readouterr()
    assert said in output.err
    assert not output.out
    # Names of Python are no words of a user.
    assert "_" not in output.err.splitlines()[-1].replace(str(tmp_path), "")
