"""Which features of a robot file have never had a value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

#: So many messages tell that a feature has none.
_TELLING = 20


class ValuesSeen:
    """Notes which features have had a value.

    Args:
        features: Of each topic.
    """

    def __init__(self, features: Mapping[str, Sequence[str]]) -> None:
        self._lacking = {topic: dict(enumerate(names)) for topic, names in features.items()}
        self._messages = dict.fromkeys(features, 0)

    def take(self, topic: str, values: Sequence[float]) -> None:
        """Notes the values of a message's features, NaN where one is missing."""
        lacking = self._lacking[topic]
        if not lacking:
            return
        self._messages[topic] += 1
        for place in [place for place in lacking if not math.isnan(values[place])]:
            del lacking[place]

    def lacking(self) -> Iterator[str]:
        """Sentences on features that no message has had, without full stops."""
        for topic, names in self._lacking.items():
            if self._messages[topic] < _TELLING:
                continue
            for name in names.values():
                yield (
                    f"feature {name!r} had no value in any message on {topic!r}: see whether its "
                    "path, kind and categories fit what comes there"
                )
