"""What is fuzzed: readers of the package, and how an input for each is made."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, Final
from xml.etree import ElementTree

from fuzz import corpus
from fuzz.mutation import mutated_bytes, mutated_json, mutated_text
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.runtime import TreeRuntime, executable
from rebt_ros.drawing.dot import render_dot
from rebt_ros.drawing.svg import render_svg
from rebt_ros.drawing.text import render_text
from rebt_ros.robot_file.reading import read_robot_file
from rebt_ros.robot_file.robot_file import RobotFile
from rebt_ros.storage.bag_metadata import NAME as METADATA
from rebt_ros.storage.input_options import InputOptions
from rebt_ros.storage.inputs import Loaded, load
from rebt_ros.storage.text import read_text
from rebt_ros.study.simulator.configuration import as_behavior_tree
from rebt_ros.study.simulator.configuration_file import parse_config

#: Bytes of a record of a recording, without the values of the state: stamp, channel, action, last
#: action and checksum.
_RECORD: Final = 24


@dataclass(frozen=True, slots=True)
class Target:
    """A reader that must take or refuse, with one sentence, whatever it is given."""

    name: str
    make: Callable[[Random], Any]
    """Makes an input."""
    read: Callable[[Any], object]
    """Reads it; may raise nothing but a `RebtError`."""


def target(name: str, directory: Path) -> Target:
    """The target of that name.

    Args:
        name: One of `NAMES`.
        directory: An empty one, for the files of the inputs.
    """
    return _MAKERS[name](directory)


def _document(random: Random) -> str:
    text = random.choice(corpus.documents())
    if random.random() < 0.3:
        return mutated_text(random, text, [other.encode() for other in corpus.documents()])
    return mutated_json(random, text)


def _read_document(text: str) -> None:
    """Reads a document; one that is taken must bear everything that is done with documents."""
    learned = loads(text)
    again = dumps(learned)
    assert loads(again) == learned
    again.encode()
    runtime = TreeRuntime(learned, tree=executable(learned.tree))
    for value in (0.0, 1.0):
        runtime.tick([value] * len(learned.features))
    runtime.halt()
    assert all(line.isprintable() for line in render_text(learned).split("\n"))
    render_dot(learned).encode()
    picture = ElementTree.fromstring(render_svg(learned))
    assert not [one.tag for one in picture.iter() if one.tag.endswith(("script", "foreignObject"))]


def _experiment(random: Random) -> str:
    text = random.choice(corpus.experiments())
    return mutated_text(random, text) if random.random() < 0.3 else mutated_json(random, text)


def _read_experiment(text: str) -> None:
    as_behavior_tree(parse_config(text, "input").root)


def _of_files(
    name: str,
    directory: Path,
    seeds: tuple[bytes, ...],
    file: str,
    count: Callable[[Path, int, int], int],
) -> Target:
    """A target whose inputs are single files.

    Args:
        name: Of the target.
        directory: For the files.
        seeds: Valid inputs.
        file: Name of the files.
        count: Tells how much there is in a file, without its reader: given that, how many features
            were read, and what the reader says.
    """
    path = directory / name / file

    def make(random: Random) -> Path:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(mutated_bytes(random, random.choice(seeds), seeds))
        return path

    def read(one: Path) -> None:
        loaded = load([one])
        _check_accounts(loaded)
        [account] = loaded.accounts.values()
        [shown] = loaded.demonstrations
        assert account.stated == count(one, len(shown.features), account.stated), account

    return Target(name, make, read)


def _records(path: Path, features: int, _: int) -> int:
    """How many records there are in a recording by its size, a part of one included."""
    data = path.read_bytes()
    return -(-(len(data) - data.index(b"\n") - 1) // (_RECORD + 8 * features))


def _lines(path: Path, _: int, stated: int) -> int:
    """How many rows, and lines that are none, a table has by its line ends.

    Args:
        path: The table.
        stated: What its reader says, which is believed where quotes hide line ends.
    """
    text = read_text(path).replace("\ufeff", "")
    if set("\"'") & set(text):
        return stated
    head = re.match(r"(?:sep=[,;|\t ]\r?\n)?(?:#[^\n]*\n)*", text, re.IGNORECASE)
    assert head is not None
    lines = sum(map(bool, re.split(r"\r\n|\r|\n", text[head.end() :])))
    # One of them may name the columns.
    return lines - 1 if stated == lines - 1 else lines


def _bags(directory: Path, name: str = "bags", robot: RobotFile | None = None) -> Target:
    """A target whose inputs are bags: a directory, at times a single file of messages.

    Args:
        directory: For the files.
        name: Of the target.
        robot: Where features and actions are in messages; None where they are arrays and words.
    """
    seeds = corpus.bags(directory / "seeds")
    files = {seed: {one.name: one.read_bytes() for one in seed.iterdir()} for seed in seeds}
    path = directory / "bags"
    lists = {"sound": True}

    def make(random: Random) -> Path:
        seed = random.choice(seeds)
        content = dict(files[seed])
        others = [data for name, data in content.items() if name != METADATA]
        changed = random.choice((METADATA, *content))
        content[changed] = mutated_bytes(random, content[changed], others)
        lists.update(sound=changed != METADATA)
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir()
        for name, data in content.items():
            (path / name).write_bytes(data)
        (storage,) = content.keys() - {METADATA}
        alone = changed == storage and random.random() < 0.3
        return path / storage if alone and not storage.endswith(".zstd") else path

    def read(one: Path) -> None:
        loaded = load([one], InputOptions(skip_bad=True, sample_rate=10.0, robot=robot))
        _check_accounts(loaded)
        if one.is_dir() and lists["sound"]:
            # Its metadata tell how many messages there were.
            [account] = loaded.accounts.values()
            assert account.read + sum(account.left_out.values()) == account.stated or loaded.notes
        # Every seed has as many, whatever a mutated file says itself.
        for account in loaded.accounts.values():
            found = account.read + sum(account.left_out.values())
            assert found >= 2 * corpus.MESSAGES or loaded.notes, (found, one)

    return Target(name, make, read)


def _robot_bags(directory: Path) -> Target:
    """The same bags, read as a robot file says."""
    file = directory / "robot.yaml"
    file.write_text(
        "state: {x: '/state.data[0]', y: '/state.data[1]'}\nactions: {action: /action.data}\n"
    )
    return _bags(directory, "robot_bags", read_robot_file(file))


def _check_accounts(loaded: Loaded) -> None:
    """Whatever is accepted is accounted for: nothing is missing without a note."""
    for account in loaded.accounts.values():
        assert account.rows >= 0
        assert account.read >= 0
        assert not account.missing or any("says that it holds" in one for one in loaded.notes)


_MAKERS: Final[dict[str, Callable[[Path], Target]]] = {
    "documents": lambda _: Target("documents", _document, _read_document),
    "recordings": lambda directory: _of_files(
        "recordings", directory, corpus.recordings(directory / "seeds"), "input.rec", _records
    ),
    "tables": lambda directory: _of_files(
        "tables", directory, corpus.tables(), "input.csv", _lines
    ),
    "experiments": lambda _: Target("experiments", _experiment, _read_experiment),
    "bags": _bags,
    "robot_bags": _robot_bags,
}
NAMES: Final = tuple(_MAKERS)
