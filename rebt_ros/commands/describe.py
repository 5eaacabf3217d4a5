"""``ros2 run rebt_ros describe BAG | --live``: what is on the topics, and a robot file for it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from rebt_ros.commands.shell import aligned, parse, run
from rebt_ros.errors import InputError, OptionError
from rebt_ros.robot_file.proposal import proposal
from rebt_ros.robot_file.reading import parse_robot_file
from rebt_ros.robot_file.survey import TopicSurvey
from rebt_ros.storage.atomic import write_text_atomically
from rebt_ros.storage.bag_survey import survey_bag


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="describe",
        description="Lists the topics of a bag or of the running robot, with their types, rates "
        "and field values (* marks those that vary), and proposes a robot file.",
    )
    parser.add_argument("bag", nargs="?", type=Path, metavar="BAG", help="a rosbag2 bag")
    parser.add_argument(
        "--live", action="store_true", help="read from the running robot instead of a bag"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        default=5.0,
        metavar="SECONDS",
        help="how long to listen to the running robot (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="write the proposed robot file here"
    )
    parser.add_argument("--force", action="store_true", help="overwrite an existing file")
    parsed = parse(parser, arguments)
    run(lambda: _describe(parsed), "describe")


def _describe(parsed: argparse.Namespace) -> None:
    if parsed.live == (parsed.bag is not None):
        raise OptionError("name a bag, or say --live for the running robot, and not both.")
    out: Path | None = parsed.out
    if out is not None and out.exists() and not parsed.force:
        raise OptionError(f"{out} is there already: name another file, or say --force.")
    surveys, notes = _surveyed(parsed)
    for note in notes:
        print(f"note: {note}.")
    if not any(survey.messages for survey in surveys):
        raise InputError("there are no messages whose types are known.")
    print("\n".join(aligned(tuple(_table(surveys)))))
    if out is None:
        return
    text = proposal(surveys, "the running robot" if parsed.live else str(parsed.bag))
    parse_robot_file(text, str(out))
    write_text_atomically(out, text)
    print(f"\nWritten to {out}: look at it, name the features and actions as you like, and then:")
    print(f"  ros2 run rebt_ros learn {parsed.bag or 'BAG'} --robot {out}")


def _surveyed(parsed: argparse.Namespace) -> tuple[tuple[TopicSurvey, ...], tuple[str, ...]]:
    if not parsed.live:
        return survey_bag(parsed.bag)
    if not 0.1 <= parsed.seconds <= 3600:
        raise OptionError(f"--seconds must lie between 0.1 and 3600, not at {parsed.seconds:g}.")
    try:
        # Only where it is asked for: a bag needs no ROS.
        from rebt_ros.ros.describing import survey_live
    except ImportError as err:
        raise OptionError(
            f"--live needs ROS 2, and {err.name} is not there: source its setup file first."
        ) from err
    return survey_live(parsed.seconds)


def _table(surveys: Sequence[TopicSurvey]) -> Iterator[tuple[str, str, str]]:
    for survey in surveys:
        rate = f"{survey.rate:.3g} Hz" if survey.rate else "once" if survey.messages == 1 else ""
        counted = f"{survey.messages} messages" if survey.messages else "no messages"
        yield survey.topic, survey.kind, f"{counted}, {rate}".rstrip(", ")
        for field in survey.fields:
            if field.seen:
                path = str(field.path).removeprefix(survey.topic)
                yield f"  {'*' if field.varies else ' '} {path}", "", field.in_words()


if __name__ == "__main__":
    main()
