"""What was seen on the topics of a bag."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError, MessagePathError
from rebt_ros.robot_file.survey import TopicSurvey
from rebt_ros.storage.bag import kinds_of, messages_of, unpacked
from rebt_ros.storage.bag_files import GAP, Topic, opened_bag
from rebt_ros.storage.message_types import BagTypes

#: Most messages of a topic that are looked at; the others are only counted.
_MOST_LOOKED_AT: Final = 20_000


def survey_bag(path: Path) -> tuple[tuple[TopicSurvey, ...], tuple[str, ...]]:
    """Looks at all topics of a bag.

    Args:
        path: A bag's directory, or a single .mcap or .db3 file.

    Returns:
        What was seen, sorted by topic, and notes about topics that cannot be read; no full stops.

    Raises:
        InputError: The bag cannot be read, or holds no messages.
    """
    with opened_bag(path) as bag:
        if not kinds_of(bag):
            raise InputError(f"{path} holds no messages: record the robot's topics first.")
        types = BagTypes(bag.definitions, bag.elsehow)
        surveys: dict[Topic, TopicSurvey] = {}
        notes = list(bag.notes)
        for topic, count in sorted(bag.found.items()):
            if not count:
                continue
            try:
                surveys[topic] = TopicSurvey(*topic, types)
            except MessagePathError as err:
                notes.append(f"{topic[0]} is left out: {str(err).rstrip('.')}")
        broken = Counter[str]()
        for topic, stamp, data in messages_of(path, bag, set(surveys)):
            if topic == GAP:
                continue
            survey = surveys[topic]
            if survey.messages >= _MOST_LOOKED_AT:
                survey.pass_over(stamp)
                continue
            try:
                message = types.decode(unpacked(data), topic[1])
            except Exception:  # whatever the generated decoders meet
                broken[topic[0]] += 1
                continue
            survey.take(message, stamp)
        notes += [
            f"messages on {name} cannot be decoded: {count}" for name, count in broken.items()
        ]
    return tuple(surveys.values()), tuple(notes)
