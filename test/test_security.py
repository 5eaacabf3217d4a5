"""Nothing that comes from outside is run, formats text, or names a file elsewhere.

What bags can do is in storage/test_hostile_bags.py, malformed input of all kinds in test_fuzz.py,
and the rule that no module evaluates or unpickles data in test_architecture.py.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import strategies as some
from fuzz import corpus
from fuzz.mutation import TEXTS
from hypothesis import given
from hypothesis import strategies as st
from test_architecture import MODULES, Module

from rebt_ros.behavior_tree.document import MOST_VALUES, dumps, loads
from rebt_ros.behavior_tree.learned_tree import LearnedTree, Suggestion, SuggestionKind
from rebt_ros.demonstration.demonstration import Row
from rebt_ros.demonstration.schema import Feature
from rebt_ros.errors import DocumentError, RebtError
from rebt_ros.offline.level_files import channel_directories, write_behavior_tree
from rebt_ros.storage.recording import RecordingWriter, read_recording

# --- what the source says ---------------------------------------------------------------------

#: Functions that start a shell, load code, or read formats that hold objects.
FORBIDDEN_CALLS = frozenset(
    {
        *("os.system", "os.popen", "os.execv", "os.execvp", "subprocess.getoutput"),
        *("np.load", "numpy.load", "joblib.load", "code.interact", "globals", "locals"),
        *("runpy.run_path", "runpy.run_module", "tempfile.mktemp", "compile", "input"),
        *("yaml.load", "yaml.unsafe_load", "yaml.full_load"),
    }
)


def _calls(module: Module) -> Iterator[tuple[ast.Call, str]]:
    for node in module.parts:
        if isinstance(node, ast.Call):
            yield node, ast.unparse(node.func)


def test_no_shell_is_started_and_no_code_loaded() -> None:
    assert [
        f"{module}:{call.lineno}: {name}"
        for module in MODULES
        for call, name in _calls(module)
        if name in FORBIDDEN_CALLS or any(one.arg == "shell" for one in call.keywords)
    ] == []


def test_what_formats_text_is_written_in_the_source() -> None:
    """No template comes from elsewhere, so that none can look into objects."""

    def constant(node: ast.expr) -> bool:
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        return is_text or (isinstance(node, ast.Name) and node.id.isupper())

    strays = []
    for module in MODULES:
        for call, _ in _calls(module):
            function = call.func
            if isinstance(function, ast.Attribute) and function.attr in {"format", "format_map"}:
                strays += [] if constant(function.value) else [f"{module}:{call.lineno}"]
        for node in module.parts:
            # A remainder of numbers looks the same; texts on its left are what matters.
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
                strays += (
                    [f"{module}:{node.lineno}"] if isinstance(node.left, ast.JoinedStr) else []
                )
    assert strays == []


# --- names that are used as names of files ----------------------------------------------------

hostile_names = st.sampled_from([one for one in TEXTS if one != "\ud800"]) | some.names


def _inside(directory: Path) -> set[str]:
    return {str(path.relative_to(directory)) for path in directory.rglob("*") if not path.is_dir()}


@given(st.lists(hostile_names, min_size=2, max_size=5, unique=True))
def test_channels_name_directories_of_one_level_each_its_own(channels: list[str]) -> None:
    learnings = [SimpleNamespace(table=SimpleNamespace(channel=one)) for one in channels]
    found = [path for path, _ in channel_directories(learnings)]  # type: ignore[arg-type]
    assert len(set(found)) == len(channels)
    for path in found:
        assert path.parts[:-1] == ("channels",)
        assert path.name.isascii()
        assert path.name.replace("_", "").replace("-", "").isalnum() or set(path.name) <= set("_-")
        assert len(path.name) < 200


@pytest.mark.parametrize("name", [one for one in TEXTS if one != "\ud800"], ids=ascii)
def test_what_a_tree_calls_its_parts_is_no_path(name: str, tmp_path: Path) -> None:
    action = replace(some.ACTIONS[0], label=name, channel=name)
    suggestion = Suggestion(name, SuggestionKind.PSA, 1, action)
    features = (Feature(name),)
    learned = LearnedTree(features, (action,), action, some.PROVENANCE, (suggestion,))
    write_behavior_tree(tmp_path / "out", loads(dumps(learned)))
    assert _inside(tmp_path) - {"out/tree.png"} == {
        *("out/tree.json", "out/tree.svg", "out/tree.dot"),
    }


@pytest.mark.parametrize("name", [one for one in TEXTS if one != "\ud800"], ids=ascii)
def test_what_topics_and_values_are_called_is_no_path(name: str, tmp_path: Path) -> None:
    features = (Feature(name, topic=name, index=0),)
    label = name if name and name.isprintable() else "go"
    with RecordingWriter(tmp_path / "out", features, (name,)) as writer:
        writer.write(Row(1, name, label, None, (0.5,)))
    (written,) = _inside(tmp_path)
    assert (tmp_path / written).parent == tmp_path / "out"
    if not set("\r\n") & set(name):
        assert len(read_recording(tmp_path / written).demonstration) == 1


@pytest.mark.parametrize("name", ["a\0b", "x" * 5000, "/proc/self/mem", "\ud800"])
def test_a_path_that_no_file_can_have_is_a_user_s_mistake(name: str, tmp_path: Path) -> None:
    from rebt_ros.storage.inputs import load
    from rebt_ros.storage.tree_file import read_tree

    path = Path(name) if os.path.isabs(name) else tmp_path / name
    for read in (lambda: load([path]), lambda: read_tree(path)):
        with pytest.raises(RebtError) as raised:
            read()
        assert str(raised.value).endswith(".")


# --- documents --------------------------------------------------------------------------------


def test_a_document_of_too_many_values_is_refused_before_it_is_read() -> None:
    text = dumps(corpus.simple())
    assert sum(map(text.count, ",[{")) < 100
    with pytest.raises(DocumentError, match=f"at most {MOST_VALUES} are read"):
        loads(text[:-1] + ', "more": [' + "0," * MOST_VALUES + "0]}")
