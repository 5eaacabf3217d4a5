"""What runs in a `LearningProcess`: it learns whenever a line on its standard input asks it to.

It ends with the node that started it, whatever way that ends, and it stands back for the nodes: it
yields the processor to them, and where memory runs out it is ended before them.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rebt_ros.errors import OptionError, RebtError
from rebt_ros.live.kept_recordings import KeptRecordings
from rebt_ros.live.learning_process import Lesson, Progress, Request

if TYPE_CHECKING:
    from rebt_ros.behavior_tree.learned_tree import LearnedTree
    from rebt_ros.demonstration.demonstration import Demonstration
    from rebt_ros.learning.learning import Learning
    from rebt_ros.learning.options import LearnOptions
    from rebt_ros.offline.result import OfflineLearning
    from rebt_ros.storage.read import Read
    from rebt_ros.verification.ruling import Ruled

#: Of all the work, what reading the recordings is.
_READING: Final = 0.1

#: How much later than a node it gets the processor, and how much sooner it is ended where memory
#: runs out (see nice(2), sched(7) and proc(5)); its session has to stand back as well as itself.
_NICENESS: Final = 5
_OUT_OF_MEMORY_SCORE: Final = "500"

#: Linux's PR_SET_PDEATHSIG.
_SET_PARENT_DEATH_SIGNAL: Final = 1

Tell = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class Learned:
    """What was learned, for the node and for the files."""

    lesson: Lesson
    result: OfflineLearning
    demonstrations: str
    options: LearnOptions


@dataclass(slots=True)
class Known:
    """What the process knows from one line to the next."""

    recordings: KeptRecordings
    """What was read."""
    learned: Learned | None = None
    """What was learned last, until its files are written: it may be large."""


def main(node: int) -> None:
    """Learns until its input ends.

    Args:
        node: Process id of the node that started it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _end_with(node)
    _stand_back()
    # What a library may print must not come between the replies.
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb", buffering=0)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(line: dict[str, Any]) -> None:
        try:
            replies.write(json.dumps(line).encode() + b"\n")
        except BrokenPipeError:
            os._exit(0)

    _warm_up()
    known = Known(KeptRecordings(_read))
    for line in sys.stdin.buffer:
        say(_reply(line, known, lambda progress: say(asdict(progress))))


def _end_with(node: int) -> None:
    """Ends this process with the node, also while it learns or is stuck in a library.

    Elsewhere than on Linux it learns to the end, and finds then that its input has ended.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != node:
            os._exit(0)


def _stand_back() -> None:
    os.nice(_NICENESS)
    settings = {"oom_score_adj": _OUT_OF_MEMORY_SCORE, "autogroup": str(_NICENESS)}
    for name, value in settings.items():
        # Not every kernel has them.
        with contextlib.suppress(OSError):
            Path("/proc/self", name).write_text(value)


def _warm_up() -> None:
    """Imports what takes long to import; what is missing is reported once it is asked for."""
    try:
        import rebt_ros.learning.pipeline  # noqa: F401
        from rebt_ros.decision_tree.training import PLAIN

        # scikit-learn is not imported before something is fitted.
        PLAIN.classifier()
    except ImportError:
        return


def _reply(line: bytes, known: Known, tell: Tell) -> dict[str, Any]:
    """The reply to a line.

    Args:
        line: A request, or a call for the files of what was learned last.
        known: What is known from earlier lines.
        tell: Told how far a request is.
    """
    notes: list[str] = []
    try:
        message = json.loads(line)
        learned, known.learned = known.learned, None
        if "draw" in message:
            return {"notes": draw(message["document"], Path(message["draw"]))}
        if "write" in message:
            return {"notes": write(learned, Path(message["write"])) if learned else []}
        del learned
        known.learned = learn(Request(**message), tell, known.recordings, notes)
        return asdict(known.learned.lesson)
    except RebtError as err:
        return {"error": str(err), "notes": notes}
    except ImportError as err:
        return {"error": f"{err.name or err} is not installed: install it and call again."}
    except MemoryError:
        return {"error": "the memory does not suffice: learn from fewer demonstrations."}
    except Exception as err:
        traceback.print_exc()
        return {
            "error": f"learning failed, which is a mistake in rebt_ros ({type(err).__name__}: "
            f"{err}): please report it, with the learner's log."
        }


def learn(
    request: Request,
    tell: Tell = lambda progress: None,
    recordings: KeptRecordings | None = None,
    notes: list[str] | None = None,
) -> Learned:
    """Learns from all recordings of a directory, in this process.

    Args:
        request: What to learn.
        tell: Told how far it is.
        recordings: What was read earlier, and is not read again; None for nothing.
        notes: Takes what a person should know about the recordings and about the tree, also where
            nothing is learned; no full stops.

    Raises:
        RebtError: They cannot be used, or an option makes no sense.
    """
    from rebt_ros.behavior_tree.document import dumps
    from rebt_ros.demonstration.schema import FeatureKind
    from rebt_ros.demonstration.table import tabulate
    from rebt_ros.demonstration.together import notes_together
    from rebt_ros.learning import pipeline
    from rebt_ros.learning.options import LearnOptions
    from rebt_ros.offline.result import OfflineLearning
    from rebt_ros.storage.recording_files import recordings as recordings_in
    from rebt_ros.storage.sources import passed_over

    twice = set(request.binary_features) & set(request.categorical_features)
    if twice:
        raise OptionError(f"feature {min(twice)!r} cannot be both binary and categorical.")
    declared = {
        **dict.fromkeys(request.binary_features, FeatureKind.BINARY),
        **dict.fromkeys(request.categorical_features, FeatureKind.CATEGORICAL),
    }
    options = LearnOptions(**request.options)
    directory = Path(request.demonstrations)
    files = recordings_in(directory)
    reads = (recordings or KeptRecordings(_read)).read(
        files,
        lambda share: tell(Progress("reading", _READING * share)),
    )
    notes = [] if notes is None else notes
    notes += passed_over([directory], set(files))
    notes += [f"{read.demonstration.name}: {note}" for read in reads for note in read.notes]
    demonstrations = [read.demonstration for read in reads]
    notes += notes_together(demonstrations)
    robot = next((read.robot for read in reads if read.robot is not None), None)
    tables = [replace(table, robot=robot) for table in tabulate(demonstrations, declared)]
    learnings = pipeline.learn_channels(
        tables,
        options,
        lambda stage, share: tell(Progress(stage, _READING + (1.0 - _READING) * share)),
    )
    kept = _ruled(pipeline.side_by_side(learnings), request, demonstrations)
    learned = kept.learned
    notes += [note for learning in learnings for note in learning.notes]
    led = {
        f"{learning.table.channel}: " if len(learnings) > 1 else "": learning.report
        for learning in learnings
    }
    sentences = [f"{channel}{one.in_short()}" for channel, one in led.items()]
    accounts = {read.demonstration.name: read.account for read in reads if read.account}
    paths = {one.name: Path(request.demonstrations, one.name) for one in demonstrations}
    result = OfflineLearning(learned, learnings, tuple(notes), accounts, kept.rules, paths=paths)
    lesson = Lesson(
        dumps(learned),
        " ".join((pipeline.summary_sentence(learned), *sentences)),
        notes,
        {
            f"{channel}{name}": value
            for channel, one in led.items()
            for name, value in one.figures().items()
        },
        learned.provenance.figures.own_history_agreement,
        tuple(f"{channel}{one.doubt}" for channel, one in led.items() if one.doubt),
        _agreement_of(request.published, learnings),
    )
    return Learned(lesson, result, request.demonstrations, options)


def _read(path: Path) -> Read:
    from rebt_ros.storage.recording import read_recording

    return read_recording(path)


def _ruled(
    learned: LearnedTree, request: Request, demonstrations: Sequence[Demonstration]
) -> Ruled:
    """The tree as it keeps its rules.

    Raises:
        RebtError: The rules cannot be read, or it does not keep them.
    """
    from rebt_ros.learning.replaying import rows_for
    from rebt_ros.live.keeping_rules import kept
    from rebt_ros.offline.rules_files import rules_for
    from rebt_ros.verification.errors import RuleError

    try:
        rules = rules_for(request.rules, learned.robot)
        return kept(
            learned,
            rules,
            rows_for(learned, demonstrations) if rules else (),
            action_results=request.action_results,
            mend=request.repair,
        )
    except RuleError as err:
        raise RuleError(
            f"the learned tree is not published, and the tree before it stays: {err}"
        ) from err


def write(learned: Learned, directory: Path) -> tuple[str, ...]:
    """Writes what the command `learn` does; returns notes on what could not be made.

    A tree.json that is there stays: the node has written it, and may have published another since.

    Raises:
        StorageError: A file cannot be written.
    """
    from rebt_ros.offline.learning_from_files import write_files
    from rebt_ros.offline.level_files import TREE_FILE
    from rebt_ros.storage.tree_file import write_tree

    if not (directory / TREE_FILE).exists():
        write_tree(directory / TREE_FILE, learned.result.learned)
    before = learned.result.notes
    inputs = [learned.demonstrations]
    return write_files(directory, learned.result, inputs, learned.options).notes[len(before) :]


def draw(document: str, directory: Path) -> tuple[str, ...]:
    """Writes text and pictures of a tree that was not learned just now; returns notes.

    Raises:
        StorageError: A file cannot be written.
    """
    from rebt_ros.behavior_tree.document import loads
    from rebt_ros.drawing.text import render_text
    from rebt_ros.offline.level_files import write_tree_pictures
    from rebt_ros.storage.atomic import write_text_atomically

    learned = loads(document)
    write_text_atomically(directory / "tree.txt", render_text(learned))
    return tuple(write_tree_pictures(directory, learned))


def _agreement_of(document: str, learnings: Sequence[Learning]) -> float | None:
    """Agreement of the published tree with all rows that were held out."""
    from rebt_ros.behavior_tree.document import loads
    from rebt_ros.learning.replaying import agreement_on

    if not document:
        return None
    published = loads(document)
    agreeing = rows = 0.0
    for learning in learnings:
        held_out = learning.table.where(learning.evidence.held_out)
        agreement = agreement_on(published, held_out)
        if agreement is None:
            return None
        agreeing, rows = agreeing + agreement * len(held_out), rows + len(held_out)
    return agreeing / rows if rows else None


if __name__ == "__main__":
    main(int(sys.argv[1]))
