"""The learner: learns a behavior tree from the recordings when it is asked to, and publishes it."""

from __future__ import annotations

import json
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from rebt_ros.behavior_tree import nodes
from rebt_ros.behavior_tree.document import dumps, loads
from rebt_ros.behavior_tree.fingerprint import fingerprint
from rebt_ros.behavior_tree.learned_tree import LearnedTree
from rebt_ros.errors import RebtError
from rebt_ros.live.ended_demonstrations import EndedDemonstrations
from rebt_ros.live.keeping_rules import kept
from rebt_ros.live.learning_process import (
    LearningCancelledError,
    LearningError,
    LearningProcess,
    Lesson,
    Progress,
)
from rebt_ros.offline.rules_files import rules_for
from rebt_ros.ros import lifetime
from rebt_ros.ros.diagnostics import Diagnostics, Level, Report
from rebt_ros.ros.graph_watch import Finding, GraphWatch
from rebt_ros.ros.learner.settings import declare_settings
from rebt_ros.storage.atomic import StorageError, write_text_atomically
from rebt_ros.storage.shared_directory import SharedDirectory, Use
from rebt_ros.storage.tree_file import find_tree
from rebt_ros.storage.tree_versions import TreeVersions
from rebt_ros.storage.writable import WritableDirectory

#: Who subscribes later gets the latest tree, too.
TREE_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

_TREE_FILE: Final = "tree.json"
#: Directory of the trees that were published, beside it.
_TREES: Final = "trees"

#: One thread learns, one waits for the end of what it cancels, and others answer further calls,
#: parameters, and diagnostics.
_THREADS: Final = 5

#: What comes once nothing can be cancelled any more.
_PUBLISHING: Final = Progress("publishing", 1.0)

#: Time between two looks at the demonstrations (seconds).
_LOOK: Final = 1.0

#: So many notes are part of the answer; all of them are in the log.
_NOTES_ANSWERED: Final = 3

#: A tree of a smaller share of the rows of the one before it may lack demonstrations.
_FAR_FEWER: Final = 0.5

#: How long the end of the node waits for a call that is under way (seconds).
_LAST_ANSWER: Final = 1.0


class LearnerNode(Node):
    """Offers ``~/relearn`` and ``~/cancel``; learning takes place in a `LearningProcess`.

    A tree that was learned is written to disk first and published then; when learning fails, the
    tree before it stays in both places.

    Raises:
        OptionError: A parameter makes no sense.
    """

    def __init__(self) -> None:
        super().__init__("learner")
        self._lock = threading.Lock()
        self._call: _Call | None = None
        self._last = Report(Level.OK, "idle: nothing was learned yet")
        self._learned: LearnedTree | None = None
        self._figures: Mapping[str, str] = {}
        self._watch = GraphWatch(self)
        self._settings = declare_settings(self)
        self._ended = EndedDemonstrations()
        self._uncounted = ""
        self._sharing = SharedDirectory(Use.TREES)
        self._writable, self._trees_writable = WritableDirectory(), WritableDirectory()
        self._watch.say(Finding(one, waits=False) for one in (self._unwritable(),) if one)
        self._count_ended()
        # On the second one an executor follows this learner, whoever else publishes trees.
        self._tree_publishers = [
            self.create_publisher(String, topic, TREE_QOS)
            for topic in ("behavior_tree", "~/behavior_tree")
        ]
        self._publish_what_is_on_disk()
        self._process = LearningProcess()
        try:
            self._process.start()
        except LearningError as err:
            # There may be room for it once somebody wants it to learn.
            self.get_logger().warning(str(err))
        self._diagnostics = Diagnostics(
            self, "learning", self._report, MutuallyExclusiveCallbackGroup()
        )
        group = ReentrantCallbackGroup()
        self.create_service(Trigger, "~/relearn", self._relearn, callback_group=group)
        self.create_service(Trigger, "~/cancel", self._cancel, callback_group=group)
        self.create_service(Trigger, "~/rollback", self._rollback, callback_group=group)
        self.create_timer(
            _LOOK,
            self._look_at_demonstrations,
            callback_group=MutuallyExclusiveCallbackGroup(),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )
        self._answers = self.create_publisher(String, "~/proposal_answer", 10)
        self.create_subscription(String, "~/proposal", self._on_proposal, 1, callback_group=group)

    def interrupt(self) -> None:
        """Ends the learning process, also while it learns, and with it a call of ~/relearn."""
        self._process.close()

    def close(self) -> None:
        """Waits for a tree that is being written."""
        self._sharing.close()
        self._process.close()
        call = self._call
        if call is not None:
            call.over.wait(_LAST_ANSWER)

    def _look_at_demonstrations(self) -> None:
        """Learns anew where enough demonstrations have ended."""
        ended = self._count_ended()
        if ended and ended >= self._settings.relearn_after() and self._call is None:
            self.get_logger().info(f"new demonstrations have ended ({ended}): learning from all.")
            self._relearn(Trigger.Request(), Trigger.Response())

    def _count_ended(self) -> int:
        """How many demonstrations have ended that nothing was learned from, if that matters."""
        if not self._settings.relearn_after():
            self._uncounted = ""
            return 0
        try:
            count = self._ended.look(self._settings.demonstrations(), time.monotonic())
            self._uncounted = self._ended.problem
        except RebtError as err:
            count, self._uncounted = 0, str(err).rstrip(".")
        return count

    def _relearn(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        call = _Call()
        with self._lock:
            other = self._call
            if other is None:
                self._call = call
        if other is not None:
            response.message = (
                f"busy: {other}; call again when that is done, or ~/cancel to cancel it."
            )
            return response
        try:
            response.message, doubts = self._learn(call)
            response.success = True
            self._last = Report(Level.WARN if doubts else Level.OK, response.message)
            self.get_logger().info(response.message)
        except LearningCancelledError as err:
            response.message = str(err)
            self._end(Level.OK, response.message)
        except RebtError as err:
            notes = err.notes if isinstance(err, LearningError) else ()
            self._log(notes)
            response.message = f"{err}{_in_short(notes)}"
            self._end(Level.WARN, response.message)
        except Exception as err:
            # The node lives on.  Once its context is shut down, all that rclpy does raises.
            if self.context.ok():
                response.message = (
                    f"learning failed, which is a mistake in rebt_ros ({type(err).__name__}: "
                    f"{err}): please report it, with the learner's log."
                )
                self.get_logger().error(traceback.format_exc())
                self._end(Level.ERROR, response.message)
        finally:
            with self._lock:
                self._call = None
            call.over.set()
        return response

    def _end(self, level: Level, message: str) -> None:
        """Notes how a call ended, unless it ended with the node."""
        self._last = Report(level, message)
        if not self.context.ok():
            return
        # On two lines: rclpy refuses another severity from the same one.
        if level is Level.OK:
            self.get_logger().info(message)
        else:
            self.get_logger().error(message)

    def _learn(self, call: _Call) -> tuple[str, Sequence[str]]:
        """Learns, writes and publishes; returns what a person wants to know, and what to doubt."""
        if why := self._unwritable():
            raise LearningError(f"nothing was learned: {why}.")
        self._ended.learn()
        request = self._settings.request(dumps(self._learned) if self._learned else "")
        path = self._settings.output() / _TREE_FILE
        lesson = self._process.ask(
            request,
            cancelled=call.cancelled,
            limit=self._settings.timeout() or None,
            progress=lambda progress: self._note(call, progress),
        )
        self._log(lesson.notes)
        learned = loads(lesson.document)
        self._hold_back(lesson)
        unjudged = (
            " keep_if_better had no say: the published tree cannot be judged on these rows, "
            "because it is about other features or channels, or none were held out."
            if request.published and lesson.rival is None
            else ""
        )
        with self._lock:
            if call.cancelled.is_set():
                raise LearningCancelledError
            call.progress = _PUBLISHING
        fewer = self._fewer(learned)
        for doubt in fewer:
            self.get_logger().warning(f"{doubt}.")
        self._put_out(path, learned, lesson.document, lesson.figures)
        # Nobody has to wait for pictures.
        threading.Thread(target=self._write_files, args=[path.parent], daemon=True).start()
        notes = (*fewer, *lesson.notes)
        return (
            f"{lesson.sentence} It is published and in {path}.{unjudged}{_in_short(notes)}",
            (*fewer, *lesson.doubts),
        )

    def _fewer(self, learned: LearnedTree) -> tuple[str, ...]:
        """That a tree of far more rows is replaced, without a full stop; else nothing."""
        rows = learned.provenance.rows
        before = self._learned.provenance.rows if self._learned is not None else None
        if before is None or rows >= _FAR_FEWER * before:
            return ()
        return (
            f"it was learned from {rows} rows, and the tree before it from {before}: see whether "
            f"demonstrations are missing from {self._settings.demonstrations().absolute()}; "
            "~/rollback publishes the tree before",
        )

    def _log(self, notes: Sequence[str]) -> None:
        for note in notes:
            self.get_logger().warning(f"{note}.")

    def _write_files(self, directory: Path) -> None:
        """Writes what the command `learn` writes."""
        try:
            notes = self._process.write(directory)
        except LearningError as err:
            # Its end is none of a node's faults.
            if self.context.ok():
                said = f"not all files beside the tree were written: {err}"
                self.get_logger().warning(said)
                self._last = Report(Level.WARN, f"{self._last.message} {said}")
            return
        self._log(notes)
        self.get_logger().info(f"summary and pictures of the tree are in {directory.absolute()}.")

    def _hold_back(self, lesson: Lesson) -> None:
        """Refuses a tree that is not to be published.

        Raises:
            LearningError: It agrees too little with the rows that were held out.
        """
        least, agreement = self._settings.least_agreement(), lesson.agreement
        before = "the tree before it stays" if self._learned else "there is no tree yet"
        stays = f"it is not published, and {before}."
        if least and (agreement is None or agreement < least):
            told = "with no held-out rows" if agreement is None else f"with {agreement:.1%} of them"
            raise LearningError(
                f"{lesson.sentence} It agrees {told}, and min_agreement is {least:.1%}: {stays}"
                f"{_in_short(lesson.notes)}"
            )
        if lesson.rival is not None and (agreement is None or agreement < lesson.rival):
            raise LearningError(
                f"{lesson.sentence} The published tree agrees with {lesson.rival:.1%} of the same "
                f"held-out rows, some of which it may have been learned from, and keep_if_better "
                f"is set: {stays} To publish it all the same, unset keep_if_better and call again."
                f"{_in_short(lesson.notes)}"
            )

    def _unruled(self) -> str:
        """Why no tree can be proven to keep its rules, without a full stop; empty for none."""
        try:
            file = self._settings.rules.file()
            if file is not None and not Path(file).is_file():
                return f"rules_file {file} is not there, so that no tree is published"
        except (RebtError, OSError, ValueError) as err:
            return f"rules_file cannot be read ({err}), so that no tree is published"
        return ""

    def _unkept(self) -> str:
        """That the published tree is on disk no more, without a full stop; else empty."""
        with suppress(RebtError):
            path = self._settings.output() / _TREE_FILE
            if self._learned is not None and not path.exists():
                return (
                    f"the tree that is published is not in {path.absolute()}, and is gone once "
                    "this node ends: ~/relearn writes it again"
                )
        return ""

    def _unwritable(self) -> str:
        """Why no tree can be written, without a full stop; else empty."""
        with suppress(RebtError):
            output = self._settings.output()
            return self._writable.why_not(output) or self._trees_writable.why_not(output / _TREES)
        return ""

    def _shared(self) -> str:
        """That another learner writes to the same directory, without a full stop; else empty."""
        with suppress(RebtError):
            output = self._settings.output()
            if self._sharing.is_shared(output):
                return (
                    f"another learner keeps its trees in {output.absolute()} and replaces those of "
                    "this one: stop it, or give each an output of its own"
                )
        return ""

    def _keeping_rules(self, learned: LearnedTree) -> LearnedTree:
        """The tree, which was learned before.

        Raises:
            RebtError: It is not proven to keep the rules, or these cannot be read.
        """
        rules = self._settings.rules
        wanted = rules_for(rules.file(), learned.robot)
        kept(learned, wanted, action_results=rules.action_results())
        return learned

    def _versions(self) -> TreeVersions:
        trees = self._settings.output().absolute() / _TREES
        return TreeVersions(trees, self._settings.kept_trees())

    def _rollback(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Publishes the tree before; where none is published, the newest one that was."""
        with self._lock:
            if self._call is not None:
                response.message = f"busy: {self._call}; call again when that is done."
                return response
            what = "the tree before" if self._learned else "the newest tree that was kept"
            try:
                versions = self._versions()
                step = versions.go_back if self._learned else versions.newest
                path, document = step(self._put_in_place)
                learned = loads(document)
            except (RebtError, OSError) as err:
                response.message = str(err)
                self.get_logger().warning(f"nothing was published: {err}")
                if isinstance(err, (StorageError, OSError)):
                    self._last = Report(Level.WARN, f"nothing was published: {err}")
                return response
            self._figures = {}
            self._publish(learned, document)
        self._draw(document)
        response.success = True
        response.message = f"published {what}, {path}."
        self._last = Report(Level.OK, response.message)
        self.get_logger().info(response.message)
        return response

    def _draw(self, document: str) -> None:
        """Draws a tree that was not learned just now; nobody has to wait for it."""
        directory = self._settings.output()

        def draw() -> None:
            try:
                self._process.draw(document, directory)
            except LearningError as err:
                if self.context.ok():
                    self.get_logger().warning(f"the published tree was not drawn: {err}")
                return
            self.get_logger().info(
                f"the pictures in {directory.absolute()} are of the published tree; summary.json, "
                "learning.npz and the decision tree are of what was learned last."
            )

        threading.Thread(target=draw, daemon=True).start()

    def _put_in_place(self, document: str) -> None:
        """Makes a tree that was published before the one on disk.

        Raises:
            RebtError: It is not proven to keep the rules, or cannot be written.
        """
        self._keeping_rules(loads(document))
        write_text_atomically(self._settings.output() / _TREE_FILE, document)

    def _on_proposal(self, message: String) -> None:
        """Publishes a tree that a person made, if it keeps its rules, and says how that went."""
        document = message.data
        answer = {"document": fingerprint(document), "published": False, "version": ""}
        try:
            answer["version"], said = self._accept(document)
            answer["published"] = True
            self.get_logger().info(said)
        except (RebtError, OSError) as err:
            said = f"the proposed tree is not published, and the tree before it stays: {err}"
            self.get_logger().warning(said)
        text = json.dumps({**answer, "message": said}, ensure_ascii=False)
        self._answers.publish(String(data=text))

    def _accept(self, document: str) -> tuple[str, str]:
        """Publishes a proposed tree; returns the number of its version, and a sentence.

        Raises:
            RebtError: It is no tree, does not keep its rules, or cannot be written.
        """
        with self._lock:
            if self._call is not None:
                raise LearningError(f"busy: {self._call}; try again when that is done.")
            learned = self._keeping_rules(loads(document))
            path = self._settings.output() / _TREE_FILE
            version = self._put_out(path, learned, document, {})
        self._draw(document)
        said = f"published a proposed tree of {nodes.size(learned.tree)} nodes, {version}."
        self._last = Report(Level.OK, said)
        return version.stem, said

    def _note(self, call: _Call, progress: Progress) -> None:
        entered = progress.stage != call.progress.stage
        call.progress = progress
        if entered:
            self._diagnostics.publish()

    def _cancel(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            call = self._call
            late = call is not None and call.progress is _PUBLISHING
            if call is not None and not late:
                call.cancelled.set()
        if call is None:
            response.message = "there is nothing to cancel: nothing is being learned."
        elif late:
            response.message = "it is too late to cancel: the tree is being published."
        else:
            self._process.cancel()
            call.over.wait()
            response.success = True
            response.message = "learning was cancelled: the tree before it stays."
        return response

    def _publish_what_is_on_disk(self) -> None:
        path = self._settings.output() / _TREE_FILE
        try:
            learned = find_tree(path)
            if learned is not None:
                self._keeping_rules(learned)
        except RebtError as err:
            helps = (
                " ~/rollback publishes the newest tree that was kept."
                if self._versions().any
                else ""
            )
            self._last = Report(Level.WARN, f"the tree on disk is not published: {err}{helps}")
            self.get_logger().warning(self._last.message)
            return
        if learned is None:
            kept = ", or ~/rollback for the newest that was kept" if self._versions().any else ""
            self.get_logger().info(
                f"there is no tree in {path.absolute()} yet: call ~/relearn to learn one from "
                f"{self._settings.demonstrations().absolute()}{kept}."
            )
            return
        self._publish(learned, dumps(learned))
        try:
            self._versions().keep(dumps(learned))
        except RebtError as err:
            self.get_logger().warning(str(err))
        self._last = Report(Level.OK, f"idle: published the tree in {path}")
        self.get_logger().info(
            f"published the tree in {path.absolute()}; ~/relearn learns from "
            f"{self._settings.demonstrations().absolute()}."
        )

    def _put_out(
        self, path: Path, learned: LearnedTree, document: str, figures: Mapping[str, str]
    ) -> Path:
        """Writes a tree to disk and publishes it then; returns the file of its version.

        Raises:
            StorageError: It cannot be written.
        """
        version = self._versions().keep(document, lambda new: write_text_atomically(path, new))
        self._figures = figures
        self._publish(learned, document)
        return version

    def _publish(self, learned: LearnedTree, document: str) -> None:
        self._learned = learned
        for publisher in self._tree_publishers:
            publisher.publish(String(data=document))

    def _report(self) -> Report:
        values: dict[str, Any] = {"learning process": self._process.id or "none"}
        if self._learned is not None:
            provenance = self._learned.provenance
            values |= {
                "nodes": nodes.size(self._learned.tree),
                "actions": len(self._learned.actions),
                "rows": provenance.rows,
                "demonstrations": provenance.demonstrations,
                "own-history agreement": provenance.figures.own_history_agreement,
                "mean recall of held-out rows": provenance.figures.mean_recall,
                "history": provenance.history.value,
            }
            values |= self._figures
        call = self._call
        if call is not None:
            progress = call.progress
            values |= {"stage": progress.stage, "progress (%)": round(100 * progress.share)}
            return Report(Level.OK, str(call), values)
        values["stage"] = "idle"
        several = self._watch.several(
            "behavior_tree",
            "trees",
            "executors without a parameter 'learner' follow one by chance; stop all but one",
        )
        said = (
            self._uncounted,
            self._unruled(),
            self._unwritable(),
            self._shared(),
            self._unkept(),
        )
        unfit = [Finding(one, waits=False) for one in said if one]
        problems = self._watch.say([*several, *unfit])
        if problems:
            return Report(Level.WARN, "; ".join((self._last.message, *problems)), values)
        return Report(self._last.level, self._last.message, values)


class _Call:
    """A call of ``~/relearn`` that is under way."""

    def __init__(self) -> None:
        self.since = time.monotonic()
        self.progress = Progress("starting", 0.0)
        self.cancelled = threading.Event()
        self.over = threading.Event()

    def __str__(self) -> str:
        seconds = time.monotonic() - self.since
        return f"learning since {seconds:.0f} s ({self.progress.stage}, {self.progress.share:.0%})"


def _in_short(notes: Sequence[str]) -> str:
    """The first notes, for an answer."""
    if not notes:
        return ""
    more = len(notes) - _NOTES_ANSWERED
    rest = f"; and {more} more, see the log" if more > 0 else ""
    return f" Note: {'; '.join(notes[:_NOTES_ANSWERED])}{rest}."


def main(args: list[str] | None = None) -> None:
    """Runs the learner."""
    lifetime.run(LearnerNode, args, threads=_THREADS)


if __name__ == "__main__":
    main()
