"""A learned policy that was saved: it comes back, and can be changed, without learning again."""

from __future__ import annotations

import contextlib
import json
import sys
import time
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rebt_ros
from rebt_ros.behavior_tree import nodes, paths
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.learned_tree import Figures, Root
from rebt_ros.commands.revise import main as revise_command
from rebt_ros.demonstration.demonstration import Demonstration, Row, RowKind
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.demonstration.table import tabulate
from rebt_ros.errors import InputError, OptionError, RebtError
from rebt_ros.export.btcpp import to_btcpp
from rebt_ros.learning import evaluation, pipeline
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.learning_file import Saved, load_learning, restored, saved, write_learning
from rebt_ros.learning.options import LearnOptions, PsaChoice, Use
from rebt_ros.learning.pipeline import learn_from, summary_sentence
from rebt_ros.offline import level_files, result
from rebt_ros.storage.atomic import StorageError, write_text_atomically

SHARED = Path(__file__).resolve().parents[2].parent / "shared"

#: Options that differ in what is kept of them.
OPTIONS = {
    "default": LearnOptions(),
    "paper": LearnOptions.paper(),
    "history": LearnOptions(history="previous", differences=Use.ALWAYS, lags=1),
    "psa": LearnOptions(psa=Use.ALWAYS, delta=0.9, psa_choice=PsaChoice.PARALLEL),
    "without all rows": LearnOptions(refit=False, root=Root.PARALLEL, units={"x": "m"}),
}


def demonstration(name: str, seed: int, rows: int = 80) -> Demonstration:
    random = np.random.default_rng(seed)
    features = (
        Feature("x"),
        Feature("y"),
        Feature("on", FeatureKind.BINARY),
        Feature("where", FeatureKind.CATEGORICAL, ("hall", "yard")),
    )

    def row(t: int) -> Row:
        x, y = random.uniform(-1, 1, 2)
        on, where = random.integers(2), random.integers(2)
        label = "stop" if on and where else "go" if x < y else "turn" if t % 3 else "wait"
        state = (x, np.nan if t % 17 == 5 else y, on, where)
        return Row(t * 100_000_000, "action", label, None, state)

    return Demonstration.from_rows(name, features, map(row, range(rows)), RowKind.SAMPLE)


def learned(options: LearnOptions = OPTIONS["default"]) -> Learning:
    """What is learned with these options; by default always the same, as no verb changes it."""
    return by_default() if options is OPTIONS["default"] else learned_anew(options)


@cache
def by_default() -> Learning:
    return learned_anew(OPTIONS["default"])


def learned_anew(options: LearnOptions) -> Learning:
    shown = [demonstration("one", 1), demonstration("two", 2), demonstration("three", 3)]
    return learn_from(tabulate(shown)[0], options)


def again(learning: Learning) -> Learning:
    kept = saved(learning)
    assert kept is not None
    return restored(Saved(json.loads(json.dumps(kept.words)), kept.arrays))


def assert_alike(mine: Learning, other: Learning) -> None:
    assert dumps(mine.learned) == dumps(other.learned)
    assert mine.plain == other.plain
    assert mine.report == other.report
    assert mine.notes == other.notes
    assert mine.options == other.options
    assert mine.decision_tree.tree == other.decision_tree.tree


@pytest.mark.parametrize("options", OPTIONS)
def test_what_was_saved_comes_back_with_all_its_levels(options: str) -> None:
    mine = learned(OPTIONS[options])
    other = again(mine)
    assert_alike(mine, other)
    assert other.levels.chosen == mine.levels.chosen
    for number in range(len(mine.levels.ccp_alphas)):
        assert_alike(mine.level(number), other.level(number))


def test_attaching_and_taking_off_leave_the_tree_as_it_was() -> None:
    mine = again(learned())
    assert mine.learned.suggestions
    first = mine.learned.suggestions[0].id
    attached = mine.with_attached(first)
    assert [one.attached for one in attached.learned.suggestions].count(True) == 1
    assert nodes.size(attached.learned.tree) > nodes.size(mine.learned.tree)
    assert_alike(attached.without(first), mine)
    everything = mine.with_attached("all")
    assert all(one.attached for one in everything.learned.suggestions)
    assert_alike(everything.without("all"), mine)
    assert_alike(again(attached), attached)
    with pytest.raises(OptionError, match="there is no suggestion 'psa-99'"):
        mine.with_attached("psa-99")
    with pytest.raises(OptionError, match=f"suggestion '{first}' is not attached: none is"):
        mine.without(first)


def test_options_that_attach_are_the_same_as_attaching_later() -> None:
    first = learned().learned.suggestions[0].id
    at_once = learned(LearnOptions(attach=(first,)))
    assert_alike(at_once, learned().with_attached(first))
    assert_alike(at_once.without(first), learned())


def test_psa_nodes_are_resolved_one_way_and_the_other() -> None:
    mine = again(learned(LearnOptions(psa=Use.ALWAYS, delta=0.9)))

    def groups(learning: Learning) -> int:
        tree = learning.learned.tree
        return sum(isinstance(node, nodes.ParallelSelector) for node in nodes.walk(tree))

    assert groups(mine)
    parallel = mine.resolved(PsaChoice.PARALLEL)
    assert not groups(parallel)
    assert_alike(parallel.resolved(None), mine)
    assert parallel.resolved(PsaChoice.SELECTOR).learned != parallel.learned


def test_another_level_has_nothing_attached_and_unknown_ones_are_refused() -> None:
    mine = again(learned()).with_attached("all")
    last = len(mine.levels.ccp_alphas) - 1
    smallest = mine.level(last)
    assert isinstance(smallest.learned.tree, nodes.Action)
    assert smallest.learned.provenance.late_rows == mine.learned.provenance.late_rows
    with pytest.raises(OptionError, match=f"there is no pruning level {last + 1}: choose one of 0"):
        mine.level(last + 1)


def test_a_row_is_explained_by_the_branch_that_acts_and_the_rows_that_taught_it() -> None:
    mine = learned()
    other = again(mine)
    chosen = evaluation.teacher_forced_choices(mine.learned.tree, mine.table)
    for row in range(0, len(mine.table), 23):
        explanation = other.explain(row)
        assert explanation.action == nodes.Action(mine.table.actions[chosen[row]], "action")
        assert explanation.support is not None
        assert explanation.support.rows == sum(count for _, count in explanation.support.actions)
        assert explanation.support.demonstrations
        assert explanation.support == mine.explain(row).support
    with pytest.raises(OptionError, match="there is no row 240: choose one of 0 to 239"):
        other.explain(len(mine.table))


def test_an_edited_tree_is_saved_as_it_is() -> None:
    mine = learned()
    path, _ = next(
        (path, node)
        for path, node in paths.walk(mine.learned.tree)
        if isinstance(node, nodes.Condition)
    )
    edited = mine.edited(lambda tree: paths.removed(tree, path))
    assert nodes.size(edited.learned.tree) < nodes.size(mine.learned.tree)
    assert_alike(again(edited), edited)
    first = mine.learned.suggestions[0].id
    assert_alike(edited.with_attached(first).without(first), edited)
    with pytest.raises(ValueError, match="'fly' on 'action' is not declared"):
        mine.edited(lambda tree: nodes.Action("fly", "action"))


def _figures(learning: Learning) -> Figures:
    return loads(dumps(learning.learned)).provenance.figures


def test_a_tree_that_does_something_else_claims_no_figures_of_the_tree_before() -> None:
    mine = again(learned())
    before = _figures(mine)
    assert before.own_history_agreement is not None
    removed = mine.edited(lambda tree: paths.removed(tree, (0,)))
    attached = mine.with_attached("all")
    for changed in (removed, attached, attached.edited(lambda tree: paths.removed(tree, (1,)))):
        assert _figures(changed) == Figures(None, None, None, before.held_out_rows)
        assert "what was attached or edited changes what it does" in (
            summary_sentence(changed.learned)
        )
        assert _figures(again(changed)) == _figures(changed)
    assert pipeline._pooled([before, _figures(removed)]) == (
        Figures(None, None, None, 2 * before.held_out_rows)
    )
    unjudged = Figures(0, None, None, 0)
    assert pipeline._pooled([before, unjudged]) == before
    assert _figures(attached.without("all")) == before
    assert _figures(attached.level(1)).own_history_agreement is not None


def test_a_tree_that_does_the_same_keeps_its_figures() -> None:
    mine = again(learned())
    same = mine.edited(lambda tree: nodes.Selector((*nodes.children(tree), *nodes.children(tree))))
    assert same.learned.tree != mine.learned.tree
    assert _figures(same) == _figures(mine)


@pytest.mark.skipif(not SHARED.exists(), reason="third-party data is not beside the checkout")
def test_all_verbs_take_less_time_than_learning_and_fit_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = SHARED / "data" / "scitos_g5_24.csv"
    begin = time.process_time()
    rebt_ros.learn(table, out=tmp_path)
    took = time.process_time() - begin
    # Whoever fits a tree from here on ends with an error.
    monkeypatch.setitem(sys.modules, "sklearn.tree", None)
    begin = time.process_time()
    mine = load_learning(tmp_path)
    changed = mine.with_attached("all").without("all").resolved(PsaChoice.SELECTOR)
    smaller = changed.level(min(3, len(mine.levels.ccp_alphas) - 1))
    assert loads(dumps(smaller.learned)) == smaller.learned
    assert time.process_time() - begin < took


def test_learning_from_files_writes_it_and_large_tables_say_that_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "table.csv"
    rows = (f"{t % 7},{t % 5},{'go' if t % 7 < 3 else 'turn'}\n" for t in range(90))
    table.write_text("x,y,action\n" + "".join(rows))
    result = rebt_ros.learn(table, out=tmp_path / "out")
    assert dumps(rebt_ros.load_learning(tmp_path / "out").learned) == dumps(result.learned)
    monkeypatch.setattr("rebt_ros.learning.learning_file.MOST_VALUES", 100)
    result = rebt_ros.learn(table, out=tmp_path / "out")
    assert "there is no learning.npz, as the table is too large for it" in result.notes
    assert not (tmp_path / "out" / "learning.npz").exists()
    with pytest.raises(InputError, match="is not written for more than 100 values"):
        load_learning(tmp_path / "out")


def test_of_several_channels_one_is_to_be_named(tmp_path: Path) -> None:
    for channel in ("arm", "base"):
        directory = tmp_path / "channels" / channel
        directory.mkdir(parents=True)
        write_learning(directory, learned())
    with pytest.raises(InputError) as caught:
        load_learning(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path} has a tree for each of several channels: name one, "
        f"{tmp_path}/channels/arm, {tmp_path}/channels/base."
    )
    load_learning(tmp_path / "channels" / "base")


# --- files that are none ------------------------------------------------------------------------


def broken(directory: Path, how: str) -> Path:
    path = directory / "learning.npz"
    write_learning(directory, learned())
    data = path.read_bytes()
    match how:
        case "missing":
            path.unlink()
        case "empty":
            path.write_bytes(b"")
        case "cut":
            path.write_bytes(data[: len(data) // 2])
        case "text":
            path.write_text("x,y\n")
        case "another zip":
            with zipfile.ZipFile(path, "w") as members:
                members.writestr("words.npy", "no array")
        case "a pickle":
            np.savez(path, words=np.array([{"version": 1}], dtype=object))
    return path


@pytest.mark.parametrize("how", ["missing", "empty", "cut", "text", "another zip", "a pickle"])
def test_what_is_no_such_file_is_refused_in_one_sentence(how: str, tmp_path: Path) -> None:
    path = broken(tmp_path, how)
    with pytest.raises(InputError, match=str(path)) as caught:
        load_learning(tmp_path)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_another_version_is_refused() -> None:
    kept = saved(learned())
    assert kept is not None
    with pytest.raises(InputError, match="of version 1, where 2 is read: learn again"):
        restored(Saved(kept.words | {"version": 1}, kept.arrays))


@settings(max_examples=60)
@given(st.data())
def test_parts_that_do_not_fit_are_refused_and_never_crash(data: st.DataObject) -> None:
    kept = SAVED
    words: dict[str, Any] = dict(kept.words)
    arrays = dict(kept.arrays)
    if data.draw(st.booleans(), label="array"):
        name = data.draw(st.sampled_from(sorted(arrays)))
        array = arrays[name].copy()
        how = data.draw(st.sampled_from(["cut", "large", "small", "kind", "gone"]))
        match how:
            case "cut":
                arrays[name] = array[:-1]
            case "gone":
                del arrays[name]
            case "kind":
                arrays[name] = array.astype(str)
            case _ if array.size:
                place = data.draw(st.integers(0, array.size - 1))
                array.flat[place] = 2**40 if how == "large" else -(2**40)
                arrays[name] = array
    else:
        name = data.draw(st.sampled_from(sorted(words)))
        words[name] = data.draw(
            st.none() | st.integers() | st.text(max_size=3) | st.lists(st.integers(), max_size=2)
        )
    # It may still fit; what else than InputError it raises fails the test.
    with contextlib.suppress(InputError):
        restored(Saved(words, arrays)).level(0)


SAVED = saved(learned()) or Saved({}, {})


# --- the command --------------------------------------------------------------------------------


def revise(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    revise_command([str(argument) for argument in arguments])
    return capsys.readouterr().out


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_revise_lists_what_can_be_changed_and_changes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = learned()
    write_learning(tmp_path, mine)
    first = mine.learned.suggestions[0].id
    listed = revise(capsys, tmp_path)
    assert f"--attach {first}" in listed
    assert "(taken)" in listed
    assert [path.name for path in tmp_path.iterdir()] == ["learning.npz"]
    revise(capsys, tmp_path, "--attach", first, "--out", tmp_path / "other")
    attached = loads((tmp_path / "other" / "tree.json").read_text())
    assert attached == mine.with_attached(first).learned
    assert "attached" in revise(capsys, tmp_path / "other")
    revise(capsys, tmp_path / "other" / "learning.npz", "--detach", "all")
    assert loads((tmp_path / "other" / "tree.json").read_text()) == mine.learned
    with pytest.raises(SystemExit):
        revise(capsys, tmp_path, "--level", "999")
    assert capsys.readouterr().err.startswith("revise: there is no pruning level 999")


@pytest.mark.parametrize("fails", ["tree.dot", "summary.json"])
def test_where_not_all_files_can_be_written_none_is_of_a_tree_before(
    fails: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(path: Path, text: str) -> None:
        if path.name == fails:
            raise StorageError(f"{path} cannot be written.")
        write_text_atomically(path, text)

    table, out = tmp_path / "table.csv", tmp_path / "out"

    def files(at: int) -> dict[str, bytes]:
        """What there is after learning to stop from a state on."""
        rows = (f"{t % 10},{'go' if t % 10 < at else 'stop'}\n" for t in range(60))
        table.write_text("x,label\n" + "".join(rows))
        with contextlib.suppress(StorageError):
            rebt_ros.learn(table, out=out)
        return {one.name: one.read_bytes() for one in out.iterdir()}

    before = files(3)
    for module in (level_files, result):
        monkeypatch.setattr(module, "write_text_atomically", write)
    left = files(6)
    assert {"tree.json", "tree.svg", "learning.npz"} <= left.keys() < before.keys()
    assert not [name for name, data in left.items() if data == before[name]]


@pytest.mark.usefixtures("matplotlib_is_missing")
def test_revise_exports_again_what_was_exported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = learned()
    write_learning(tmp_path, mine)
    exported = tmp_path / "btcpp.xml"
    revise(capsys, tmp_path, "--attach", mine.learned.suggestions[0].id)
    assert not exported.exists()
    for suggestion in mine.learned.suggestions:
        exported.write_text("of a tree before")
        out = revise(capsys, tmp_path, "--detach", "all", "--attach", suggestion.id)
        revised = loads((tmp_path / "tree.json").read_text())
        expected, refusal = "", ""
        try:
            expected = to_btcpp(revised)
        except RebtError as err:
            refusal = str(err)
        assert exported.exists() is bool(expected)
        assert not exported.exists() or exported.read_text() == expected
        assert f"btcpp.xml is gone: {refusal}" in out or not refusal


def test_names_of_files_that_are_not_utf_8_are_written_as_escapes(tmp_path: Path) -> None:
    table = tmp_path / "caf\udce9.csv"
    rows = "".join(f"{x},{'go' if x > 15 else 'stop'}\n" for x in range(30))
    try:
        table.write_text(f"x,action\n{rows}")
    except OSError:
        pytest.skip("this file system has UTF-8 names only")
    result = rebt_ros.learn([table], out=tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    assert summary["inputs"] == [str(table)]
    assert summary["provenance"][0]["leaves"][0]["stretches"][0]["file"] == str(table)
    assert dumps(load_learning(tmp_path / "out").learned) == dumps(result.learned)
