"""A process that computes edit distances with networkx until its input ends.

Each line of standard input is a JSON list of two trees, each with labels and parents; each is
answered by a line with the distance.  An empty line comes first, once everything is imported.
`rebt_ros.study.edit_distance.networkx_measure` is the other side.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
from typing import BinaryIO

import networkx as nx

from rebt_ros.study.edit_distance.labelled_tree import LabelledTree


def main() -> None:
    """Answers each line, and ends with the input, also in the middle of a computation."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(sys.stdin.buffer, requests), daemon=True).start()
    # What networkx imports when it is first used must not count as time of the first pair.
    first_distance(LabelledTree(("a", "b"), (-1, 0)), LabelledTree(("a", "c"), (-1, 0)))
    replies = sys.stdout.buffer
    replies.write(b"\n")
    replies.flush()
    while True:
        first, second = (
            LabelledTree(tuple(labels), tuple(parents))
            for labels, parents in json.loads(requests.get())
        )
        replies.write(b"%r\n" % first_distance(first, second))
        replies.flush()


def _listen(requests: BinaryIO, waiting: queue.SimpleQueue[bytes]) -> None:
    for line in requests:
        waiting.put(line)
    os._exit(0)


def first_distance(first: LabelledTree, second: LabelledTree) -> float:
    """The first distance that ``optimize_graph_edit_distance`` comes up with."""
    distances = nx.optimize_graph_edit_distance(
        directed_graph(first),
        directed_graph(second),
        node_match=lambda one, other: one["label"] == other["label"],
    )
    return float(next(distances))


def directed_graph(tree: LabelledTree) -> nx.DiGraph:
    """The tree as networkx has it, with its labels in the attribute ``label``."""
    graph = nx.DiGraph()
    graph.add_nodes_from((node, {"label": label}) for node, label in enumerate(tree.labels))
    graph.add_edges_from(tree.edges)
    return graph


if __name__ == "__main__":
    main()
