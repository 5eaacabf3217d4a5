"""Random configurations: valid, all different, the same for a seed, and read back as they were."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rebt_ros.commands.generate import main
from rebt_ros.errors import OptionError
from rebt_ros.study.simulator.configuration import (
    Act,
    Check,
    Group,
    GroupKind,
    Inverted,
    SimulatedNode,
    leaves,
)
from rebt_ros.study.simulator.configuration_file import format_config, parse_config
from rebt_ros.study.simulator.generator import canonical_form, generate_configs

EXPERIMENTS = Path(__file__).resolve().parents[3] / "shared" / "experiments"
SEEDS = st.integers(-(10**9), 10**9)


def kinds(node: SimulatedNode) -> set[GroupKind]:
    match node:
        case Group(kind=kind, children=children):
            return {kind}.union(*map(kinds, children))
        case Inverted(child=child):
            return kinds(child)
        case _:
            return set()


def shape(step: SimulatedNode) -> str:
    """One word for what a step of a subtree is."""
    match step:
        case Inverted(child=Check()):
            return "inverted condition"
        case Check():
            return "condition"
        case Act():
            return "action"
        case Group(kind=GroupKind.SELECTOR, children=children):
            assert all(shape(one) in ("condition", "inverted condition") for one in children)
            return f"selector of {len(children)}"
        case Group(kind=GroupKind.PARALLEL_SELECTOR, children=children):
            assert all(isinstance(one, Act) for one in children)
            return f"psa of {len(children)}"
    raise AssertionError(step)


STEPS = {
    "condition",
    "inverted condition",
    "action",
    "selector of 2",
    "psa of 2",
    "psa of 3",
}


@settings(max_examples=40)
@given(SEEDS)
def test_configurations_follow_the_rules_of_the_published_ones(seed: int) -> None:
    for config in generate_configs(5, seed):
        assert config.root.kind in (GroupKind.PARALLEL, GroupKind.SEQUENCE)
        assert len(config.subtrees) in (2, 3)
        assert config.notes == ()
        for subtree in config.subtrees:
            assert isinstance(subtree, Group)
            assert subtree.kind in (GroupKind.SEQUENCE, GroupKind.REPEATER)
            steps = [shape(one) for one in subtree.children]
            assert 2 <= len(steps) <= 5
            assert set(steps) <= STEPS
            assert steps[-1].startswith(("action", "psa"))
            labels = [leaf.label for leaf in leaves(subtree) if isinstance(leaf, Act)]
            variables = [leaf.variable for leaf in leaves(subtree) if isinstance(leaf, Check)]
            assert len(set(labels)) == len(labels) <= 5
            assert len(set(variables)) == len(variables) <= 5
            assert all(leaf.threshold == 0.5 for leaf in leaves(subtree) if isinstance(leaf, Check))


@settings(max_examples=40)
@given(SEEDS)
def test_files_are_read_back_as_they_were(seed: int) -> None:
    for config in generate_configs(5, seed):
        assert parse_config(format_config(config.root), config.name) == config


checks = st.builds(Check, st.sampled_from("xyz"), st.floats(-10, 10), st.floats(0, 1))
acts = st.builds(Act, st.sampled_from(["a", "ä", '"b"']), st.floats(0, 1))


def upright(inner: st.SearchStrategy[SimulatedNode]) -> st.SearchStrategy[SimulatedNode]:
    children = st.lists(st.one_of(inner, st.builds(Inverted, inner)), min_size=1, max_size=3)
    return st.builds(Group, st.sampled_from(GroupKind), children.map(tuple))


@settings(max_examples=60)
@given(upright(st.recursive(st.one_of(checks, acts), upright, max_leaves=10)))
def test_any_configuration_is_written_and_read_back(root: Group) -> None:
    assert parse_config(format_config(root), "it").root == root


def test_what_a_file_cannot_say_is_not_written() -> None:
    root = Group(GroupKind.SEQUENCE, (Inverted(Inverted(Act("a"))),))
    with pytest.raises(ValueError, match="inverted twice"):
        format_config(root)


def test_no_two_configurations_and_no_two_subtrees_of_one_are_the_same() -> None:
    configs = generate_configs(800, 11)
    assert len({canonical_form(one.root) for one in configs}) == len(configs)
    for config in configs:
        assert len({canonical_form(one) for one in config.subtrees}) == len(config.subtrees)


def test_equal_seeds_give_equal_configurations_and_a_larger_number_only_more() -> None:
    assert generate_configs(30, 4) == generate_configs(40, 4)[:30]
    assert generate_configs(30, 4) != generate_configs(30, 5)


def test_draws_are_the_same_on_every_version_and_machine() -> None:
    (config,) = generate_configs(1, 21)
    tests = (Check("/env_state_var_5", 0.5), Check("/env_state_var_2", 0.5))
    assert config.root == Group(
        GroupKind.PARALLEL,
        (
            Group(GroupKind.SEQUENCE, (Act("action_2"), Act("action_4"))),
            Group(
                GroupKind.SEQUENCE,
                (Group(GroupKind.SELECTOR, tuple(map(Inverted, tests))), Act("action_2")),
            ),
        ),
    )


A, B, X, Y = Act("a"), Act("b"), Check("/x", 0.5), Inverted(Check("/y", 0.5))


@pytest.mark.parametrize("kind", [GroupKind.PARALLEL, GroupKind.PARALLEL_SELECTOR])
def test_the_order_under_a_parallel_does_not_count(kind: GroupKind) -> None:
    assert canonical_form(Group(kind, (A, B))) == canonical_form(Group(kind, (B, A)))


@pytest.mark.parametrize("kind", [GroupKind.SEQUENCE, GroupKind.SELECTOR, GroupKind.REPEATER])
def test_the_order_of_actions_counts_and_that_of_neighbouring_conditions_does_not(
    kind: GroupKind,
) -> None:
    assert canonical_form(Group(kind, (A, B))) != canonical_form(Group(kind, (B, A)))
    assert canonical_form(Group(kind, (X, Y, A))) == canonical_form(Group(kind, (Y, X, A)))
    assert canonical_form(Group(kind, (X, A, Y))) != canonical_form(Group(kind, (Y, A, X)))


def test_the_form_of_the_form_is_the_form() -> None:
    for config in generate_configs(50, 2):
        form = canonical_form(config.root)
        assert canonical_form(form) == form


def test_no_configurations_are_refused() -> None:
    with pytest.raises(OptionError, match="the number of configurations is 0"):
        generate_configs(0, 0)


def test_progress_is_reported_as_a_share() -> None:
    shares: list[float] = []
    generate_configs(200, 1, shares.append)
    assert shares == [0.5, 1.0]


def frequencies(roots: list[Group]) -> dict[str, float]:
    subtrees = [subtree for root in roots for subtree in root.children]
    counts: Counter[str] = Counter()
    for subtree in subtrees:
        assert isinstance(subtree, Group)
        found = kinds(subtree)
        counts["repeater"] += GroupKind.REPEATER in found
        counts["psa"] += GroupKind.PARALLEL_SELECTOR in found
        counts["selector"] += GroupKind.SELECTOR in found
        counts["actions"] += sum(isinstance(leaf, Act) for leaf in leaves(subtree))
        counts["conditions"] += sum(isinstance(leaf, Check) for leaf in leaves(subtree))
    per_subtree = {name: number / len(subtrees) for name, number in counts.items()}
    return per_subtree | {
        "subtrees": len(subtrees) / len(roots),
        "parallel root": sum(root.kind is GroupKind.PARALLEL for root in roots) / len(roots),
    }


@pytest.mark.skipif(not EXPERIMENTS.is_dir(), reason=f"there is no {EXPERIMENTS}")
def test_frequencies_are_about_those_of_the_published_files() -> None:
    published = [
        parse_config(path.read_text(encoding="utf-8"), path.stem).root
        for path in EXPERIMENTS.glob("*.json")
    ]
    ours = frequencies([config.root for config in generate_configs(500, 3)])
    assert ours == pytest.approx(frequencies(published), rel=0.16)


def test_the_command_writes_files_that_can_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["12", "--seed", "9", "--out", str(tmp_path / "new")])
    assert capsys.readouterr().out == f"12 configurations written to {tmp_path / 'new'}.\n"
    written = {path.stem: path.read_text() for path in (tmp_path / "new").iterdir()}
    assert {name: parse_config(text, name) for name, text in written.items()} == {
        config.name: config for config in generate_configs(12, 9)
    }


def test_the_files_have_the_fields_of_the_published_ones(tmp_path: Path) -> None:
    main(["3", "--out", str(tmp_path)])
    value = json.loads((tmp_path / "expr0.json").read_text())
    assert value["name"] == f"{value['type_']}_root"
    (subtree, *_) = value["child_list"]
    assert set(subtree) == {"name", "type_", "child_list"}
    steps = [step for one in value["child_list"] for step in one["child_list"]]
    fields = {"name", "type_", "p_success", "inverted"}
    assert {frozenset(one) for one in steps if one["type_"] == "action"} == {frozenset(fields)}
    assert {frozenset(one) for one in steps if one["type_"] == "condition"} == {
        frozenset(fields | {"threshold", "target_state"})
    }


def test_a_directory_with_configurations_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "expr3.json").write_text("mine")
    with pytest.raises(SystemExit) as exited:
        main(["5", "--out", str(tmp_path)])
    assert exited.value.code == 1
    assert "holds configurations already (expr3.json)" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["expr3.json"]
