"""Trees in the language of another engine: names, scripts, and what is refused."""

from __future__ import annotations

import io
import re
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
import strategies as some
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros import DocumentError, to_btcpp
from rebt_ros.behavior_tree import document, nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.commands import export, learn
from rebt_ros.demonstration.schema import Feature, FeatureKind
from rebt_ros.export.blackboard import texts
from rebt_ros.export.identifiers import identifiers
from rebt_ros.logic.conditions import HasCategory, LastActionIs, Literal, Threshold

GO, TURN = some.action("go"), some.action("turn")


def _exported(learned: LearnedTree) -> Element:
    return ElementTree.fromstring(to_btcpp(learned))


@given(st.lists(some.names), st.lists(some.names, max_size=3))
def test_identifiers_are_valid_and_as_different_as_the_names(
    names: list[str], reserved: list[str]
) -> None:
    found = identifiers(names, "feature", reserved)
    assert list(found) == list(dict.fromkeys(names))
    assert len(set(found.values())) == len(found)
    assert set(found.values()).isdisjoint(reserved)
    for one in found.values():
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", one)
        assert not one.startswith(("true", "false"))


@given(st.lists(some.names))
def test_texts_can_be_written_in_scripts_and_none_is_empty(words: list[str]) -> None:
    found = texts(words, "category")
    assert len(set(found.values())) == len(set(words))
    for one in found.values():
        assert one.isascii()
        assert one.isprintable()
        assert one
        assert "'" not in one or '"' not in one


@given(some.learned_trees())
def test_whatever_is_learned_is_exported_or_refused_in_a_sentence(learned: LearnedTree) -> None:
    try:
        root = _exported(learned)
    except DocumentError:
        return
    [tree] = root.findall("BehaviorTree")
    assert len(tree) == 1
    models = {model.get("ID") for model in root.findall("TreeNodesModel/Action")}
    assert len(models) == len(root.findall("TreeNodesModel/Action"))
    ports = root.findall("TreeNodesModel/SubTree/input_port")
    assert len({port.get("name") for port in ports}) == len(ports)


def test_a_feature_and_an_action_are_explained_in_the_model() -> None:
    ground = Feature("front left (m)", topic="/ranges", index=3)
    label = "Sharp turn"
    tree = nodes.Sequence(
        (nodes.Condition(Literal(Threshold("front left (m)", 0.5))), some.action(label))
    )
    root = _exported(some.learned(tree, (ground,)))
    port = root.find("TreeNodesModel/SubTree/input_port")
    assert port is not None
    assert (port.get("name"), port.get("type")) == ("front_left_m", "double")
    assert port.text == "feature 'front left (m)': value 3 of /ranges; NaN where it is missing"
    [action] = root.findall("TreeNodesModel/Action")
    assert action.get("ID") == "Sharp_turn"
    assert [one.attrib for one in action.iter("Metadata")] == [
        {"label": label},
        {"channel": some.CHANNEL},
    ]
    condition = root.find(".//ScriptCondition")
    assert condition is not None
    assert condition.get("code") == "(front_left_m <= 0.5) && !(front_left_m > 0.5)"


@pytest.mark.parametrize("label", ["Sequence", "Sleep", "root", "2nd", "", "grün", "a.b"])
def test_no_action_has_a_name_that_the_engine_or_groot2_would_refuse(label: str) -> None:
    [action] = _exported(some.learned(some.action(label))).findall("TreeNodesModel/Action")
    name = action.get("ID")
    assert name != label
    assert name is not None
    assert re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)


def test_a_parallel_of_actions_is_refused_with_what_helps() -> None:
    tree = nodes.Selector((nodes.Parallel((GO, TURN)), GO))
    with pytest.raises(DocumentError, match=r"'go', 'turn' in a Parallel.*--psa-choice selector"):
        to_btcpp(some.learned(tree))


def test_a_category_that_is_compared_with_a_number_is_refused() -> None:
    kind = Feature("kind", FeatureKind.CATEGORICAL, ("1", "2"))
    tests = (Literal(HasCategory("kind", "1")), Literal(Threshold("kind", 0.5)))
    with pytest.raises(DocumentError, match="'kind' with a number"):
        to_btcpp(some.learned(some.when(*tests, then=GO), (kind,)))


def test_memory_is_kept_only_where_it_is_tested() -> None:
    assert "Script " not in to_btcpp(some.learned(GO))
    tests = Literal(LastActionIs("go", ("turn",)))
    text = to_btcpp(some.learned(some.when(tests, then=TURN)))
    assert "last_action_before_turn == 'go'" in text


def test_the_command_prints_a_tree_or_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    learned = some.learned(nodes.Selector((GO, TURN)))
    path, out = tmp_path / "tree.json", tmp_path / "tree.xml"
    path.write_text(document.dumps(learned), encoding="utf-8")
    export.main([str(path)])
    assert capsys.readouterr().out == to_btcpp(learned)
    export.main([str(path), "--to", "btcpp", "--out", str(out)])
    assert out.read_text(encoding="utf-8") == to_btcpp(learned)


def test_what_is_printed_is_the_same_tree_in_any_encoding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learned = some.learned(some.action("grün"))
    path = tmp_path / "tree.json"
    path.write_text(document.dumps(learned), encoding="utf-8")
    for encoding in ("ascii", "latin-1", "utf-8"):
        printed = io.BytesIO()
        monkeypatch.setattr("sys.stdout", io.TextIOWrapper(printed, encoding=encoding))
        export.main([str(path)])
        labels = [one.get("label") for one in ElementTree.fromstring(printed.getvalue()).iter()]
        assert "grün" in labels


def test_what_cannot_be_exported_is_one_sentence_and_an_exit_code(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "tree.json"
    tree = nodes.Selector((nodes.Parallel((GO, TURN)), GO))
    path.write_text(document.dumps(some.learned(tree)), encoding="utf-8")
    with pytest.raises(SystemExit, match="1"):
        export.main([str(path)])
    assert capsys.readouterr().err.startswith("export: the tree runs 'go', 'turn' in a Parallel")


def test_learn_writes_it_beside_the_tree(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    rows = "".join(f"{x / 10},{'go' if x < 20 else 'turn'}\n" for x in range(40))
    table.write_text(f"front,action\n{rows}")
    out = tmp_path / "out"
    learn.main([str(table), "--out", str(out), "--export", "btcpp"])
    learned = document.loads((out / "tree.json").read_text(encoding="utf-8"))
    assert (out / "btcpp.xml").read_text(encoding="utf-8") == to_btcpp(learned)
