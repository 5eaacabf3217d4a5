"""What learning from files gives, and its figures for scripts: summary.json."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.learning.judged_levels import JudgedLevels
from rebt_ros.learning.learning import Learning
from rebt_ros.learning.options import LearnOptions
from rebt_ros.logic.conditions import Interval
from rebt_ros.storage.account import Account
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.input_options import Aside
from rebt_ros.storage.versions import versions
from rebt_ros.verification.tracing import TracedLeaf, trace_leaves

#: Packages whose versions can change a result.
_DECIDING_PACKAGES = ("numpy", "scikit-learn", "pyeda", "py_trees")


@dataclass(frozen=True, eq=False, slots=True)
class OfflineLearning:
    """A tree learned from files."""

    learned: LearnedTree
    """The value of the behavior tree document."""
    learnings: tuple[Learning, ...]
    """What it was made from, for each channel."""
    notes: tuple[str, ...]
    """What a person should know about the inputs; no full stops."""
    accounts: Mapping[str, Account] = field(default_factory=dict)
    """Where what each demonstration's file holds went."""
    rules: tuple[str, ...] = ()
    """The rules that the tree was proven to keep, each in a line."""
    aside: tuple[Aside, ...] = ()
    """Inputs that could not be read, and were left out."""
    excluded: tuple[Path | str, ...] = ()
    """What was left out as asked: files, and names of single demonstrations of tables."""
    paths: Mapping[str, Path] = field(default_factory=dict)
    """The file of each demonstration, as far as it is known."""
    weights: Mapping[str, int] = field(default_factory=dict)
    """How often the rows of each demonstration count; empty where all count once."""


def write_summary(
    directory: Path, result: OfflineLearning, inputs: Sequence[str], options: LearnOptions
) -> None:
    """Writes summary.json."""
    summary = summarize(result) | {
        "inputs": list(inputs),
        "accounts": {name: account.as_json() for name, account in result.accounts.items()},
        "set_aside": [{"path": str(aside.path), "reason": aside.reason} for aside in result.aside],
        "excluded": [str(path) for path in result.excluded],
        "weights": dict(result.weights),
        "provenance": list(_traced(result)),
        "notes": list(result.notes),
        "random_state": options.random_state,
        "upsample": options.upsample.value,
        "test_fraction": options.test_fraction,
        "refit": options.refit,
        "exact": options.exact,
        "lags": options.lags,
        "versions": _versions(options),
    }
    text = json.dumps(summary, indent=2, ensure_ascii=False)
    write_text_atomically(directory / "summary.json", text + "\n")


def summarize(result: OfflineLearning) -> dict[str, Any]:
    """The figures of a learned tree, as written to summary.json."""
    learned, provenance = result.learned, result.learned.provenance
    figures = provenance.figures
    summary: dict[str, Any] = {
        "rows": provenance.rows,
        "demonstrations": provenance.demonstrations,
        "features": [feature.name for feature in learned.features],
        "actions": [action.label for action in learned.actions],
        "nodes": nodes.size(learned.tree),
        "intervals": _intervals(learned.tree),
        "depth": nodes.depth(learned.tree),
        "fidelity_mismatches": figures.fidelity_mismatches,
        "held_out_rows": figures.held_out_rows,
        "teacher_forced_agreement": figures.teacher_forced_agreement,
        "own_history_agreement": figures.own_history_agreement,
        "mean_recall": figures.mean_recall,
        "history": provenance.history.value,
        "row_kind": learned.row_kind.value,
        "root": provenance.root.value,
        "delta": provenance.delta,
        "max_depth": provenance.max_depth,
        "ccp_alpha": provenance.ccp_alpha,
        "suggestions": [
            {
                "id": suggestion.id,
                "kind": suggestion.kind.value,
                "support": suggestion.support,
                "unit": suggestion.kind.unit.value,
                "nodes": nodes.size(suggestion.subtree),
                "attached": suggestion.attached,
            }
            for suggestion in learned.suggestions
        ],
    }
    if result.rules:
        summary["rules"] = [{"rule": rule, "answer": "proven"} for rule in result.rules]
    if provenance.mended is not None:
        summary["mended"] = asdict(provenance.mended)
    if len(result.learnings) == 1:
        return summary | _choices(result.learnings[0])
    return summary | {
        "channels": {learning.table.channel: _of_channel(learning) for learning in result.learnings}
    }


def _traced(result: OfflineLearning) -> Iterator[dict[str, Any]]:
    """Where each leaf of the tree comes from, channel by channel."""
    tree = result.learned.tree
    policies = nodes.policies(tree)
    for learning in result.learnings:
        evidence, channel = learning.evidence, learning.table.channel
        # What takes no action at all is no policy.
        policy = policies.get(channel)
        if policy is None:
            continue
        beside = [place for place, child in enumerate(nodes.children(tree)) if child is policy]
        traced = trace_leaves(
            policy,
            evidence.table,
            evidence.learned_from,
            evidence.rows_learned_from,
            () if policy is tree else tuple(beside[:1]),
        )
        yield {
            "channel": channel,
            "rows": traced.rows,
            "rows_without_leaf": traced.without,
            "leaves": [_leaf(leaf, result.paths) for leaf in traced.leaves],
        }


def _leaf(leaf: TracedLeaf, files: Mapping[str, Path]) -> dict[str, Any]:
    return {
        "path": list(leaf.path),
        "action": leaf.action.label,
        "rows": leaf.support.rows,
        "actions": dict(leaf.support.actions),
        "demonstrations": leaf.demonstrations,
        "stretches": [
            asdict(one)
            | {"file": str(file.absolute()) if (file := files.get(one.demonstration)) else None}
            for one in leaf.stretches
        ],
    }


def _of_channel(learning: Learning) -> dict[str, Any]:
    figures = learning.learned.provenance.figures
    return {
        "rows": learning.learned.provenance.rows,
        "nodes": nodes.size(learning.learned.tree),
        "intervals": _intervals(learning.learned.tree),
        "ccp_alpha": learning.policy.ccp_alpha,
        "fidelity_mismatches": figures.fidelity_mismatches,
        "teacher_forced_agreement": figures.teacher_forced_agreement,
        "own_history_agreement": figures.own_history_agreement,
        **_choices(learning),
    }


def _intervals(tree: nodes.Node) -> int:
    """Nodes that stand for two thresholds each."""
    conditions = (node for node in nodes.walk(tree) if isinstance(node, nodes.Condition))
    return sum(isinstance(condition.literal.condition, Interval) for condition in conditions)


def _choices(learning: Learning) -> dict[str, Any]:
    return {
        "decision_tree_leaves": learning.decision_tree.tree.leaves,
        "psa": learning.policy.psa,
        "report": learning.report.as_json(),
        "reasons": list(learning.policy.reasons),
        "levels": list(_levels(learning.policy.levels)),
    }


def _levels(levels: JudgedLevels | None) -> Iterator[dict[str, float]]:
    """The pruning levels that were chosen from, with their agreement in cross-validation."""
    if levels is not None:
        columns = (levels.ccp_alphas, levels.mean_recalls, levels.means, levels.standard_errors)
        for alpha, recall, mean, error in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            yield {
                "ccp_alpha": alpha,
                "mean_recall": recall,
                "agreement": mean,
                "standard_error": error,
            }


def _versions(options: LearnOptions) -> dict[str, str]:
    further = () if options.upsample is Upsampling.NONE else ("imbalanced-learn",)
    return versions((*_DECIDING_PACKAGES, *further))
