"""Lets what was learned drive, beside what plain learners make of the same demonstrations.

    make bench-driving                                     # all tasks; half an hour on two cores
    make bench-driving ARGS="--tasks robot,carry --counts 3,8"
    make bench-driving ARGS="--late 2 --wrong 0.05"        # demonstrators as people are
    make bench-driving ARGS="corrections"                  # one more demonstration at each failure
    make bench-driving ARGS="--quick"                      # shows that it works, tells nothing

Writes driving.json, driving.md and driving.svg, or driving-….json and so on, to bench-results.  A
run that was interrupted goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from driving import corrections, methods, plot, running, tasks
from driving.cells import Origin, Store
from driving.demonstrating import MOST_SETS, Demonstrator
from driving.report import Measured, corrections_report, report
from driving.results import entries
from rebt_ros.commands.shell import run
from rebt_ros.drawing.errors import MatplotlibMissingError
from rebt_ros.errors import OptionError
from rebt_ros.storage.atomic import write_text_atomically

_CHECKOUT = Path(__file__).resolve().parents[3]
_COUNTS, _SETS, _EPISODES = (1, 2, 3, 5, 8, 16), 5, 50
#: Tasks whose courses of corrections are short enough.
_CORRECTED = ("robot", "shuttle", "carry", "cartpole", "ice", "taxi", "doorkey")
#: Of a quick run.
_QUICK_TASKS, _QUICK_COUNTS, _QUICK_SETS, _QUICK_EPISODES = ("carry", "bell"), (1, 2), (0, 1), 4


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point."""
    parsed = _parser().parse_args(arguments)
    command = _correct if parsed.what == "corrections" else _drive
    run(lambda: command(parsed), "bench-driving")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="bench-driving",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "what", nargs="?", choices=("drive", "corrections"), default="drive", help="default: drive"
    )
    parser.add_argument("--tasks", type=_names, metavar="A,B", help=f"of {', '.join(tasks.NAMES)}")
    parser.add_argument(
        "--methods", type=_names, metavar="A,B", help=f"of {', '.join(methods.METHODS)}"
    )
    parser.add_argument(
        "--counts", type=_numbers, metavar="1,2", help="demonstrations (default: 1,2,3,5,8,16)"
    )
    parser.add_argument(
        "--sets",
        type=_range,
        metavar="FIRST-LAST",
        help="demonstration sets to take the mean of (default: 0-4)",
    )
    parser.add_argument(
        "--episodes", type=int, help="fresh ones, for each tree to drive (default: 50)"
    )
    parser.add_argument(
        "--late", type=int, default=0, metavar="STEPS", help="how late demonstrators act"
    )
    parser.add_argument(
        "--wrong",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="of steps in which they do anything",
    )
    parser.add_argument(
        "--modes",
        type=_modes,
        default=tuple(corrections.Mode),
        metavar="A,B",
        help="of corrections: failed, takeover, whole (default: all)",
    )
    parser.add_argument(
        "--most", type=int, default=20, metavar="N", help="corrections (default: %(default)s)"
    )
    parser.add_argument(
        "--workers",
        type=int,
        default=os.cpu_count() or 1,
        help="processes (default: one per processor)",
    )
    parser.add_argument(
        "--quick", action="store_true", help="so little that the figures mean nothing"
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=_CHECKOUT / "bench-results",
        metavar="DIR",
        help="default: bench-results",
    )
    return parser


def _names(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(text.split(",")))


def _modes(text: str) -> tuple[corrections.Mode, ...]:
    known = {mode.value: mode for mode in corrections.Mode}
    if unknown := [name for name in _names(text) if name not in known]:
        raise argparse.ArgumentTypeError(
            f"there is no mode {unknown[0]!r}: choose of {', '.join(known)}"
        )
    return tuple(known[name] for name in _names(text))


def _numbers(text: str) -> tuple[int, ...]:
    if not all(one.isdecimal() and int(one) > 0 for one in text.split(",")):
        raise argparse.ArgumentTypeError(f"{text!r} does not list numbers from 1 on, such as 3,8")
    return tuple(sorted({int(one) for one in text.split(",")}))


def _range(text: str) -> tuple[int, ...]:
    first, _, last = text.partition("-")
    last = last or first
    if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last) <= MOST_SETS):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no range of sets, such as 0-4; the last one there is is {MOST_SETS}"
        )
    return tuple(range(int(first), int(last) + 1))


def _drive(parsed: argparse.Namespace) -> None:
    plan = running.Plan(
        _tasks(parsed, tasks.USUAL),
        parsed.counts or (_QUICK_COUNTS if parsed.quick else _COUNTS),
        _sets(parsed),
        _methods(parsed, methods.USUAL),
        _episodes(parsed),
        Demonstrator(parsed.late, parsed.wrong),
    )
    _check(parsed)
    name = _name(parsed)
    store = Store(parsed.results / name, Origin.of(plan.settings))
    start = time.monotonic()
    running.run(plan, store, parsed.workers, _tell)
    measured = Measured(
        store.results(plan.cells),
        frozenset(task for task in plan.tasks if tasks.task_named(task).needs_memory),
        parsed.late,
    )
    if not measured.learned:
        raise OptionError("nothing could be measured: no demonstrator succeeds.")
    text = report(measured)
    listed = [one.as_json() for one in entries(measured.learned)]
    _write(parsed.results / f"{name}.json", json.dumps(listed, indent=1) + "\n")
    _write(parsed.results / f"{name}.md", text)
    print(text)
    try:
        _write(parsed.results / f"{name}.svg", plot.render(measured).decode())
    except MatplotlibMissingError as error:
        print(f"note: {error}")
    minutes = (time.monotonic() - start) / 60
    print(f"Written to {parsed.results / name}.json, .md and .svg; {minutes:.1f} minutes.")


def _correct(parsed: argparse.Namespace) -> None:
    [method, *others] = _methods(parsed, (methods.DEFAULT,))
    if others:
        raise OptionError("corrections are of one method: name one with --methods.")
    if parsed.late or parsed.wrong:
        raise OptionError("who corrects is neither late nor wrong: leave out --late and --wrong.")
    _check(parsed)
    name = f"{_name(parsed)}-corrections"
    origin = Origin.of(f"{_episodes(parsed)} episodes", Path(corrections.__file__))
    jobs = [
        corrections.Job(
            task,
            number,
            mode,
            method,
            min(parsed.most, 2) if parsed.quick else parsed.most,
            _episodes(parsed),
            parsed.results / name,
            origin,
        )
        for number in _sets(parsed)
        for task in _tasks(parsed, _CORRECTED)
        for mode in parsed.modes
    ]
    courses = corrections.run(jobs, parsed.workers, _tell)
    text = corrections_report(courses)
    _write(parsed.results / f"{name}.md", text)
    listed = [one.as_json() for one in courses]
    _write(parsed.results / f"{name}.json", json.dumps(listed, indent=1) + "\n")
    print(text)
    print(f"Written to {parsed.results / name}.json and .md.")


def _tasks(parsed: argparse.Namespace, usual: tuple[str, ...]) -> tuple[str, ...]:
    if parsed.tasks:
        for name in parsed.tasks:
            tasks.task_named(name)
        return tuple(parsed.tasks)
    if parsed.quick:
        return _QUICK_TASKS
    missing = [name for name in usual if tasks.missing_for(name)]
    if missing:
        print(
            f"note: {', '.join(missing)} are left out, as packages are missing: "
            "pip install 'gymnasium[box2d]' minigrid.",
            file=sys.stderr,
        )
    return tuple(name for name in usual if name not in missing)


def _methods(parsed: argparse.Namespace, usual: tuple[str, ...]) -> tuple[str, ...]:
    for name in parsed.methods or ():
        if name not in methods.METHODS:
            known = ", ".join(methods.METHODS)
            raise OptionError(f"there is no method {name!r}: choose of {known}.")
    return tuple(parsed.methods or usual)


def _sets(parsed: argparse.Namespace) -> tuple[int, ...]:
    return parsed.sets or (_QUICK_SETS if parsed.quick else tuple(range(_SETS)))


def _episodes(parsed: argparse.Namespace) -> int:
    return parsed.episodes or (_QUICK_EPISODES if parsed.quick else _EPISODES)


def _check(parsed: argparse.Namespace) -> None:
    for name in ("workers", "most", "episodes"):
        number = getattr(parsed, name)
        if number is not None and number < 1:
            raise OptionError(f"--{name} is a number from 1 on, not {number}.")


def _name(parsed: argparse.Namespace) -> str:
    """Of the files: results of other demonstrators do not take the place of the usual ones."""
    parts = ["driving"]
    parts += ["quick"] if parsed.quick else []
    parts += [f"late{parsed.late}"] if parsed.late else []
    parts += [f"wrong{parsed.wrong:g}"] if parsed.wrong else []
    return "-".join(parts)


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text_atomically(path, text)


if __name__ == "__main__":
    main()
