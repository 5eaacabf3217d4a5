"""What elements of BehaviorTree.CPP's XML are called, and what they say of actions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement

from rebt_ros.behavior_tree import nodes
from rebt_ros.export.identifiers import identifiers

#: The name of the exported tree.
TREE = "LearnedTree"

#: Names of nodes and elements of BehaviorTree.CPP, from 4.0 to 4.10, that no action can have.
_BUILT_IN = frozenset(
    re.findall(
        r"\w+",
        """
        Action AlwaysFailure AlwaysRunning AlwaysSuccess AsyncFallback AsyncSequence BehaviorTree
        BlackboardCheckBool Condition Control Decorator Delay EntryUpdatedAction
        EntryUpdatedDecorator Fallback FallbackStar Finally ForceFailure ForceSuccess ID IfThenElse
        Inverter KeepRunningUntilFailure LoopBool LoopDouble LoopInt LoopString ManualSelector
        Metadata MetadataFields Parallel ParallelAll PopBool PopDouble PopInt PopString Precondition
        ReactiveFallback ReactiveSequence Repeat RetryUntilSuccesful RetryUntilSuccessful Root
        RunOnce Script ScriptCondition Sequence SequenceStar SequenceWithMemory SetBlackboard
        SkipUnlessUpdated Sleep SubTree SubTreePlus Switch2 Switch3 Switch4 Switch5 Switch6 TestNode
        Timeout TreeNodesModel TryCatch UnsetBlackboard WaitValueUpdate WasEntryUpdated WhileDoElse
        include name root LearnedTree
        """,
    )
)


def action_names(
    actions: Iterable[nodes.Action], reserved: Iterable[str] = ()
) -> dict[nodes.Action, str]:
    """A name for each action, which is its label where that is possible.

    Args:
        actions: The actions, in any order.
        reserved: Names that are not to be used, beside those that BehaviorTree.CPP has built in.
    """
    actions = tuple(actions)
    labels = [action.label for action in actions]
    names = {
        action: action.label
        if labels.count(action.label) == 1
        else repr((action.label, action.channel))
        for action in actions
    }
    found = identifiers(names.values(), "action", {*_BUILT_IN, *reserved})
    return {action: found[name] for action, name in names.items()}


def add_actions(models: Element, names: Mapping[nodes.Action, str]) -> None:
    """Adds to a ``TreeNodesModel`` which label and channel each action stands for."""
    for action, name in names.items():
        fields = SubElement(SubElement(models, "Action", ID=name), "MetadataFields")
        SubElement(fields, "Metadata", label=one_line(action.label))
        SubElement(fields, "Metadata", channel=one_line(action.channel))


def one_line(text: str) -> str:
    """A text as one line without what XML cannot hold."""
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode() for one in text
    )
