"""``ros2 run rebt_ros trial TREE... | --levels DIR``: lets the executor drive with each tree."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rebt_ros.commands.asking import AskingJudge
from rebt_ros.commands.progress import ProgressBar
from rebt_ros.commands.shell import aligned, parse, run
from rebt_ros.errors import OptionError
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.trial.candidates import Candidate, distinct, of_files, of_levels
from rebt_ros.trial.driven import write_driven
from rebt_ros.trial.errors import TrialError
from rebt_ros.trial.halving import Trial
from rebt_ros.trial.outcome import Episode
from rebt_ros.trial.result import TrialResult, as_json, table, verdict
from rebt_ros.trial.settings import DEFAULT_TIME_LIMIT, StartParameter, TrialSettings

if TYPE_CHECKING:
    from rebt_ros.ros.trial.driving import Driving

_ROS_ARGUMENTS = "--ros-args"
_EPISODES = 20

#: Of learning.npz: as many as the studio shows.
_MOST_LEVELS = 25

#: Characters of a name in the progress bar.
_SHOWN = 30


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    own, of_ros = _split(sys.argv[1:] if arguments is None else arguments)
    parsed = parse(_parser(), own)
    if parsed.levels is None and not parsed.trees:
        _parser().error("name a TREE, or a directory with --levels")
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)
    run(lambda: _Command(parsed, of_ros).run(), "trial")


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The arguments of the command, and those of ROS."""
    if _ROS_ARGUMENTS not in arguments:
        return list(arguments), []
    place = arguments.index(_ROS_ARGUMENTS)
    of_ros = list(arguments[place:])
    end = of_ros.index("--") + 1 if "--" in of_ros else len(of_ros)
    return [*arguments[:place], *of_ros[end:]], of_ros[:end]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="trial",
        description="Lets the executor drive with each tree and reports which one succeeds most "
        "often. Worse trees drop out early (successive halving). During a trial its own tree "
        "drives: if another node, such as the learner, publishes a tree on behavior_tree, the "
        "episode is driven again, and that tree is republished afterwards. The executor is "
        "disabled between episodes and afterwards. Ctrl-C stops the robot and reports what is "
        "known so far.",
    )
    parser.add_argument("trees", nargs="*", type=Path, metavar="TREE", help="a tree.json")
    parser.add_argument(
        "--levels",
        type=Path,
        metavar="DIR",
        help="all pruning levels in the output directory of learn or of a learner; the results "
        "are kept in DIR/trials.json, for the studio",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        default=_EPISODES,
        metavar="N",
        help="total number of episodes for each of the last trees; others drop out earlier "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="also write all results to this file as JSON"
    )
    parser.add_argument(
        "--publish",
        action="store_true",
        help="publish the winner at the end, and keep publishing it until Ctrl-C, so that nodes "
        "that start later receive it; by default, the tree from before the trial is "
        "published again",
    )
    _add_outcome(parser)
    _add_world(parser)
    parser.add_argument(
        "--executor", default="executor", metavar="NAME", help="its name (default: %(default)s)"
    )
    return parser


def _add_outcome(parser: argparse.ArgumentParser) -> None:
    outcome = parser.add_argument_group(
        "how an episode ends",
        "Give --outcome-topic or --ask; with neither, an episode lasts for the time limit, and "
        "the answer of --reset-service says whether it was a success.",
    )
    outcome.add_argument(
        "--outcome-topic",
        metavar="TOPIC",
        help="says how it went: std_msgs/Bool, or std_msgs/String with success or failure, true "
        "or false, or JSON",
    )
    outcome.add_argument(
        "--outcome-field",
        metavar="NAME",
        help="boolean field of the JSON object that holds the outcome",
    )
    outcome.add_argument(
        "--ask", action="store_true", help="a person at this terminal says how it went"
    )
    outcome.add_argument(
        "--time-limit",
        type=float,
        metavar="SECONDS",
        help="a longer episode is a failure, and so is one in which a person takes over "
        f"(default: {DEFAULT_TIME_LIMIT:g}; with --ask: none)",
    )


def _add_world(parser: argparse.ArgumentParser) -> None:
    world = parser.add_argument_group("where an episode begins")
    world.add_argument(
        "--reset-service",
        metavar="SERVICE",
        help="std_srvs/Trigger service that resets robot and world; called before each episode",
    )
    world.add_argument(
        "--start-parameter",
        metavar="NODE/PARAMETER",
        help="integer parameter that selects the start for the next reset, so that all trees "
        "drive from the same starts",
    )
    world.add_argument(
        "--first-start",
        type=int,
        default=0,
        metavar="N",
        help="with --start-parameter: the first start; later ones count up from it (default: "
        "%(default)s)",
    )


class _Command:
    """A trial with all that is seen of it.

    Args:
        parsed: Arguments of the command.
        of_ros: Arguments of ROS.
    """

    def __init__(self, parsed: argparse.Namespace, of_ros: Sequence[str]) -> None:
        self._parsed = parsed
        self._of_ros = of_ros
        self._settings = _settings(parsed)
        self._candidates, self._notes = distinct(_candidates(parsed))
        self._trial = Trial([candidate.nodes for candidate in self._candidates], parsed.episodes)
        self._episodes: list[list[Episode]] = [[] for _ in self._candidates]
        self._progress = ProgressBar()

    def run(self) -> None:
        """Drives and reports; also what is known when it is interrupted.

        Raises:
            RebtError: The trial cannot go on.
        """
        try:
            from rebt_ros.ros.trial.driving import driving
        except ImportError as err:
            raise TrialError(
                f"a trial needs ROS 2, and {err.name or 'a part of it'} cannot be imported: "
                "source your ROS 2 first."
            ) from err
        for note in self._notes:
            print(f"note: {note}.")
        print(self._plan(), flush=True)
        judge = AskingJudge() if self._settings.ask else None
        session: Driving | None = None
        try:
            with driving(self._settings, judge, self._of_ros) as session:
                self._drive(session)
                if self._parsed.publish:
                    self._publish(session)
        finally:
            self._progress.clear()
            if not self._parsed.publish or self._trial.winner is None:
                self._report()
            if session is not None:
                print(session.farewell)

    def _plan(self) -> str:
        count = len(self._candidates)
        trees = f"{count} trees" if count > 1 else "1 tree"
        rounds = self._trial.rounds
        if len(rounds) > 1 and count > 1:
            most = f"{', '.join(map(str, rounds[:-1]))} and at last {rounds[-1]} episodes each"
            return f"Trial of {trees}: {most}, {self._trial.most_left} in all at most."
        return f"Trial of {trees}: {self._trial.most_left} episodes in all."

    def _drive(self, session: Driving) -> None:
        while (turn := self._trial.turn) is not None:
            candidate = self._candidates[turn.candidate]
            if not self._settings.ask:
                done, left = self._trial.driven, self._trial.most_left
                rounds = self._trial.rounds
                stage = (
                    f"round {turn.round + 1} of {len(rounds)}: {candidate.name[-_SHOWN:]}, "
                    f"episode {turn.episode + 1} of {rounds[turn.round]}"
                )
                self._progress(stage, done / (done + left))
            episode = session.drive(candidate, turn.episode)
            self._episodes[turn.candidate].append(episode)
            self._trial.note(success=episode.success)

    def _publish(self, session: Driving) -> None:
        winner = self._trial.winner
        assert winner is not None
        session.publish(self._candidates[winner])
        self._progress.clear()
        self._report()
        print("It is published, and stays so until Ctrl-C.", flush=True)
        try:
            session.hold()
        except KeyboardInterrupt:
            # As it was announced.
            return

    def _report(self) -> None:
        if not self._trial.driven:
            return
        result = TrialResult(
            self._candidates,
            tuple(map(tuple, self._episodes)),
            self._trial.standings,
            self._trial.rounds,
            self._trial.winner,
        )
        print()
        print("\n".join(aligned(table(result))))
        print()
        print(verdict(result), flush=True)
        if self._parsed.levels is not None:
            write_driven(
                self._parsed.levels,
                [(self._candidates[one.candidate], one.tally) for one in result.standings],
            )
        if self._parsed.out is not None:
            text = json.dumps(as_json(result), indent=2, ensure_ascii=False)
            write_text_atomically(self._parsed.out, text + "\n")


def _settings(parsed: argparse.Namespace) -> TrialSettings:
    start = None
    if parsed.start_parameter is not None:
        start = StartParameter.of(parsed.start_parameter, parsed.first_start)
    elif parsed.first_start:
        raise OptionError("--first-start is of a parameter: give --start-parameter.")
    limit = parsed.time_limit
    if limit is None and not parsed.ask:
        limit = DEFAULT_TIME_LIMIT
    return TrialSettings(
        outcome_topic=parsed.outcome_topic,
        outcome_field=parsed.outcome_field,
        ask=parsed.ask,
        reset_service=parsed.reset_service,
        start=start,
        time_limit=limit,
        executor=parsed.executor,
    )


def _candidates(parsed: argparse.Namespace) -> Iterator[Candidate]:
    yield from of_files(parsed.trees)
    if parsed.levels is not None:
        yield from _levels(parsed.levels)


def _levels(directory: Path) -> Iterator[Candidate]:
    """The pruning levels in a directory; of learning.npz where none were written on their own."""
    from rebt_ros.learning.learning_file import NAME, load_learning

    if (directory / "levels").exists() or not (directory / NAME).is_file():
        yield from of_levels(directory)
        return
    levels = load_learning(directory).levels
    for number in levels.selected(_MOST_LEVELS):
        level = levels.level(number)
        chosen = " (chosen)" if level.chosen else ""
        yield Candidate(f"level {number:02}{chosen}", level.learned, directory / NAME)


if __name__ == "__main__":
    main()
