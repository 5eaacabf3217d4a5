"""Many inputs for one target, and what came of them."""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from typing import Any, Final

from fuzz.target import Target, target
from rebt_ros.errors import RebtError

#: An input that takes longer each time is a hang (seconds of the processor).
LONGEST: Final = 1.0
#: How often an input that took too long is read before that counts.
_READINGS: Final = 3
#: How much the process may grow, whatever it is given (bytes).
LARGEST_GROWTH: Final = 256 << 20

#: Beyond this there is an end to patience, and to the process (seconds).
_PATIENCE: Final = 20.0
#: Longest sentence of a refusal, which may be a service's response (characters).
_LONGEST_SENTENCE: Final = 1000
#: How many failures are told in full.
_TOLD: Final = 10


@dataclass(slots=True)
class Outcome:
    """What came of a campaign."""

    target: str
    seed: int
    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    failed: int = 0
    slowest: float = 0.0
    """Seconds."""
    growth: int = 0
    """By how much the process's resident memory grew at its peak, bytes."""
    failures: list[str] = field(default_factory=list)
    """The first of them, each with the number of its input."""

    @property
    def passed(self) -> bool:
        """Whether nothing went wrong."""
        return not self.failed

    def fail(self, number: int, what: str) -> None:
        """Notes a failure."""
        self.failed += 1
        if len(self.failures) < _TOLD:
            self.failures.append(f"input {number}: {what}")

    def report(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def generator(target: str, seed: int, number: int) -> Random:
    """The generator that an input follows from."""
    return Random(f"{seed} {target} {number}")


def run(reader: Target, seed: int, numbers: range) -> Outcome:
    """Reads inputs in this process."""
    outcome = Outcome(reader.name, seed)
    for _ in each(reader, outcome, numbers):
        pass
    return outcome


def each(reader: Target, outcome: Outcome, numbers: range) -> Iterator[int]:
    """Reads one input after the other; yields the number of the next one before it is read."""
    before = _peak()
    for number in numbers:
        yield number
        made = reader.make(generator(reader.name, outcome.seed, number))
        took, error = _reading(reader, made)
        if error is None:
            outcome.accepted += 1
        elif isinstance(error, RebtError):
            outcome.refused += 1
            if problem := _problem(str(error)):
                outcome.fail(number, f"{problem}: {str(error)[:300]!r}")
        else:
            outcome.fail(number, "".join(traceback.format_exception(error, limit=-4)))
        # Once may be the collector's work, or a machine that stood still.
        for _ in range(_READINGS - 1):
            if took > LONGEST:
                took = min(took, _reading(reader, made)[0])
        if took > LONGEST:
            outcome.fail(number, f"took {took:.1f} s")
        outcome.inputs += 1
        outcome.slowest = max(outcome.slowest, took)
        outcome.growth = _peak() - before
    if outcome.growth > LARGEST_GROWTH:
        outcome.fail(numbers.stop - 1, f"or one before it: {outcome.growth >> 20} MB more memory")


def _reading(reader: Target, made: Any) -> tuple[float, Exception | None]:
    """How long an input took, and what it raised.

    In seconds of the processor, as a busy machine is no hang; waiting is found by who watches.
    """
    began = time.process_time()
    error = None
    try:
        reader.read(made)
    except Exception as raised:
        error = raised
    return time.process_time() - began, error


def _problem(sentence: str) -> str:
    """What is wrong with a refusal's words."""
    if not sentence.endswith("."):
        return "no full stop"
    if "\n" in sentence or (not sentence.isascii() and _unprintable(sentence)):
        return "more than a line of text"
    if len(sentence) > _LONGEST_SENTENCE:
        return f"{len(sentence)} characters"
    return ""


def _unprintable(sentence: str) -> bool:
    return any("\ud800" <= one <= "\udfff" for one in sentence)


def _peak() -> int:
    """Peak resident memory of this process, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def watched(name: str, seed: int, numbers: range) -> Outcome:
    """Reads inputs in a process of its own, which may hang or crash."""
    context = multiprocessing.get_context("spawn")
    current = context.Value("q", numbers.start)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_child, args=(name, seed, numbers, current, sender))
    process.start()
    sender.close()
    last, since = numbers.start, time.monotonic()
    while not receiver.poll(0.2) and process.is_alive():
        if current.value != last:
            last, since = current.value, time.monotonic()
        elif time.monotonic() - since > _PATIENCE:
            break
    try:
        # Also true at the end of a process that was killed.
        outcome: Outcome = receiver.recv() if receiver.poll() else Outcome(name, seed)
    except EOFError:
        outcome = Outcome(name, seed)
    if process.is_alive() and not outcome.inputs:
        process.kill()
    process.join()
    if not outcome.inputs:
        outcome.inputs = current.value - numbers.start + 1
        outcome.fail(current.value, f"hung or crashed with exit code {process.exitcode}")
    return outcome


def _child(name: str, seed: int, numbers: range, current: Any, sender: Any) -> None:
    with tempfile.TemporaryDirectory(prefix="rebt_ros_fuzz_") as directory:
        outcome = Outcome(name, seed)
        for number in each(target(name, Path(directory)), outcome, numbers):
            current.value = number
        sender.send(outcome)
