"""Does a tree that is mended to keep a rule drive as often to the goal?

    PYTHONPATH=.:test/benchmarks python test/benchmarks/mending.py [--sets 0-9] [--counts 1,2,3]

For each set of demonstrations of the demo's robot: a tree is learned, held against the rule, mended
where it breaks it, and both drive from the same starts, none of which was shown.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from driving.demonstrating import demonstrations, write_tables
from driving.robot import Drive

import rebt_ros
from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.learning.policy import Policy
from rebt_ros.offline.check_and_explain import check, repaired
from rebt_ros.verification.rules_file import loads

RULE = "rules:\n- never: go\n  when: front < 0.3\n"


def drives(learned: LearnedTree, starts: range) -> tuple[int, int]:
    """How often a tree reaches the goal, and in how many steps it went with less than 0.3 m."""
    tasks = [Drive() for _ in starts]
    states = [task.reset(start) for task, start in zip(tasks, starts, strict=True)]
    policy, near = Policy(learned), 0
    policy.reset(len(tasks))
    while acting := [place for place, task in enumerate(tasks) if not task.over]:
        for place, action in zip(
            acting, policy.act_many([states[place] for place in acting], acting), strict=True
        ):
            near += action == "go" and states[place][1] < 0.3
            # It stops at any word that it does not know.
            states[place] = tasks[place].step(action or "stop")
    return sum(task.success for task in tasks), near


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", default="0-9")
    parser.add_argument("--counts", default="1,2,3")
    parser.add_argument("--starts", type=int, default=100)
    options = parser.parse_args()
    first, last = map(int, options.sets.split("-"))
    starts = range(1000, 1000 + options.starts)
    print("demonstrations  set  nodes  rule     reached  near  mended: nodes  rows  reached  near")
    for count in map(int, options.counts.split(",")):
        for number in range(first, last + 1):
            _compare(count, number, starts)


def _compare(count: int, number: int, starts: range) -> None:
    with tempfile.TemporaryDirectory() as directory:
        task = Drive()
        tables = write_tables(Path(directory), task.features, demonstrations(task, number, count))
        learned = rebt_ros.learn(tables).learned
        checked = check(learned, loads(RULE), tables)
        answer = checked.verdicts[0].answer.value
        line = f"{count:>14}  {number:>3}  {nodes.size(learned.tree):>5}  {answer:<7}"
        if checked.keeps_all:
            print(line, flush=True)
            return
        mended = repaired(checked)
        before, after = drives(learned, starts), drives(mended.learned, starts)
        print(
            f"{line}  {before[0]:>7}  {before[1]:>4}  {mended.change.added:>+13}  "
            f"{mended.change.changed:>4}  {after[0]:>7}  {after[1]:>4}",
            flush=True,
        )


if __name__ == "__main__":
    main()
