"""A learned tree as XML of BehaviorTree.CPP 4, which Groot2 shows and edits.

=====================================  =======================================================
rebt_ros                               BehaviorTree.CPP
=====================================  =======================================================
Sequence, Selector                     ReactiveSequence, ReactiveFallback
Sequence, Selector with memory         Sequence, Fallback
Parallel/Selector (PSA)                ReactiveFallback
Repeater                               KeepRunningUntilFailure over a Sequence
Inverter                               Inverter
Parallel of channels                   Parallel of trees that never end
Parallel of conditions                 ReactiveSequence
condition                              ScriptCondition
action                                 an action without ports
=====================================  =======================================================

The engine commands what `TreeRuntime` commands: at every tick, the same actions are ticked in the
same order, whatever the state and however each action ends.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.behavior_tree.runtime import executable
from rebt_ros.behavior_tree.wording import Wording, summary
from rebt_ros.errors import DocumentError
from rebt_ros.export import scripts
from rebt_ros.export.blackboard import Variable, texts, variables
from rebt_ros.export.elements import TREE, action_names, add_actions, one_line
from rebt_ros.export.memory import Memory, memories
from rebt_ros.logic.conditions import LastActionIs, Literal, PreviousActionIs


def to_btcpp(learned: LearnedTree) -> str:
    """The XML text of a learned tree, for BehaviorTree.CPP 4 and Groot2.

    The tree is ``LearnedTree``.  Its ports, in the ``TreeNodesModel``, are the variables that the
    robot's program sets before each tick, each with the feature that it holds.

    Args:
        learned: The tree.

    Raises:
        DocumentError: BehaviorTree.CPP cannot run this tree as it is meant: a Parallel of actions,
            or a feature with categories that is compared with a number.
    """
    return _Export(learned).text()


class _Export:
    """The parts of one exported tree."""

    def __init__(self, learned: LearnedTree) -> None:
        self._learned = learned
        self._wording = Wording(learned)
        self._tree = executable(learned.tree)
        self._policies = nodes.policies(self._tree)
        if len(self._policies) < 2:
            # All conditions of a tree ask about the channel of its first action.
            self._policies = dict.fromkeys(self._policies, self._tree)
        self._variables: Mapping[str, Variable] = variables(learned, self._tree)
        labels = texts((action.label for action in learned.actions), "action")
        self._memories = memories(
            self._policies or {learned.actions[0].channel: self._tree},
            labels,
            learned.row_kind,
        )
        self._ids = action_names(nodes.actions(self._tree))

    def text(self) -> str:
        root = Element("root", BTCPP_format="4", main_tree_to_execute=TREE)
        tree = SubElement(root, "BehaviorTree", ID=TREE, _description=summary(self._learned))
        tree.append(self._remembering(self._root()))
        self._model(SubElement(root, "TreeNodesModel"))
        ElementTree.indent(root)
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{_serialized(root)}\n'

    def _root(self) -> Element:
        if len(self._policies) < 2:
            return self._node(self._tree, next(iter(self._memories.values()), None))
        # A Parallel does not tick children that have ended, and so none may end.
        side_by_side = Element("Parallel", success_count="-1", failure_count="1")
        for channel, tree in self._policies.items():
            forever = SubElement(side_by_side, "KeepRunningUntilFailure", name=one_line(channel))
            SubElement(forever, "ForceSuccess").append(
                self._node(tree, self._memories.get(channel))
            )
        return side_by_side

    def _remembering(self, tree: Element) -> Element:
        """The tree after what keeps its memory, where it has one."""
        kept = self._memories.values()
        if not kept:
            return tree
        root = Element("ReactiveSequence")
        _assign(root, "_onHalted", (one for memory in kept for one in memory.halted))
        once = SubElement(root, "RunOnce", then_skip="false", name="nothing was done yet")
        _assign(
            SubElement(once, "Script"), "code", (one for memory in kept for one in memory.first)
        )
        copying = SubElement(root, "Script", name="what was done before")
        _assign(copying, "code", (one for memory in kept for one in memory.begin))
        root.append(tree)
        return root

    def _node(self, node: nodes.Node, memory: Memory | None) -> Element:
        match node:
            case nodes.Condition(literal=literal):
                return Element(
                    "ScriptCondition",
                    name=one_line(self._wording.literal(literal)),
                    code=self._code(literal, memory),
                )
            case nodes.Action():
                return self._action(node)
            case nodes.Inverter():
                element = Element("Inverter")
            case nodes.Sequence(memory=remembers):
                element = Element("Sequence" if remembers else "ReactiveSequence")
            case nodes.Selector(memory=remembers):
                element = Element("Fallback" if remembers else "ReactiveFallback")
            case nodes.ParallelSelector():
                element = Element("ReactiveFallback", name=self._wording.node(node))
            case nodes.Parallel():
                _refuse_what_can_run(node)
                element = Element("ReactiveSequence", name=self._wording.node(node))
            case nodes.Repeater():
                element = Element("KeepRunningUntilFailure", name=self._wording.node(node))
        children = [self._node(child, memory) for child in nodes.children(node)]
        inner = SubElement(element, "Sequence") if isinstance(node, nodes.Repeater) else element
        inner.extend(children)
        return element

    def _code(self, literal: Literal, memory: Memory | None) -> str:
        condition = literal.condition
        if isinstance(condition, PreviousActionIs | LastActionIs):
            assert memory is not None
            return memory.test(condition, literal.positive)
        return scripts.test(condition, literal.positive, self._variables)

    def _action(self, action: nodes.Action) -> Element:
        """The action, by its own name: BehaviorTree.CPP 4.8 refuses <Action> in some places."""
        element = Element(self._ids[action])
        if (name := one_line(self._wording.node(action))) != element.tag:
            element.set("name", name)
        memory = self._memories.get(action.channel)
        if memory is None or not (noted := memory.act(action.label)):
            return element
        _assign(element, "_post", memory.done(action.label))
        both = Element("ReactiveSequence", name=name)
        _assign(SubElement(both, "Script"), "code", noted)
        both.append(element)
        return both

    def _model(self, models: Element) -> None:
        add_actions(models, self._ids)
        ports = SubElement(models, "SubTree", ID=TREE)
        for variable in self._variables.values():
            port = SubElement(ports, "input_port", name=variable.name, type=variable.type)
            port.text = one_line(variable.meaning)


def _refuse_what_can_run(node: nodes.Parallel) -> None:
    runs = [one for one in nodes.walk(node) if isinstance(one, nodes.Action | nodes.Repeater)]
    if runs:
        labels = [repr(run.label) for run in runs if isinstance(run, nodes.Action)]
        raise DocumentError(
            f"the tree runs {', '.join(labels[:3]) or 'a Repeater'} in a Parallel, where "
            "BehaviorTree.CPP would not tick again what has ended while something else runs, nor "
            "keep a channel to one command: make it a Selector (`revise --psa-choice selector`), "
            "and export that."
        )


def _assign(element: Element, attribute: str, assignments: Iterable[str]) -> None:
    """Sets an attribute to a script, where there is anything to do."""
    if script := "; ".join(assignments):
        element.set(attribute, script)


def _serialized(root: Element) -> str:
    return ElementTree.tostring(root, encoding="unicode")
