"""What the metadata.yaml of a bag says of it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from textwrap import shorten
from typing import Any, Final

import yaml

from rebt_ros.errors import InputError

NAME: Final = "metadata.yaml"

#: Longest file that is read (bytes): 700 topics with 40 publishers each, whose QoS is told one by
#: one, make 8 million.
LARGEST: Final = 32_000_000
#: Longest text without QoS that is read as YAML (characters): 700 topics make 150,000.
#: Where PyYAML is without libyaml, a recorder's 100,000 take half a second, the worst ten times
#: that.
_LARGEST_YAML: Final = 1_000_000
#: Deepest nesting of brackets, of which recorders write one or two levels (`[]`); the time that
#: YAML takes grows with its square.
_DEEPEST: Final = 20
#: What a line begins with where blocks are nested so deeply that parsers in C have no room for it.
_INDENTED: Final = re.compile(r"^[ \t?:-]{200}", re.MULTILINE)
_ALIAS: Final = re.compile(r"(?:^|[:\-\[,{?])\s*[*&][^\s*&]", re.MULTILINE)
_QOS: Final = re.compile(r"( *)(?:- )?offered_qos_profiles:(.*)")
_NEWEST: Final = 9
#: How YAML has an empty value.
_NOTHING: Final = ("", "~", "null")


@dataclass(frozen=True, slots=True)
class BagMetadata:
    """What a bag says of itself."""

    files: tuple[str, ...] = ()
    """Names of its files, in their order."""
    counts: dict[tuple[str, str], int] = field(default_factory=dict)
    """Messages by topic and type; 0 where the recorder did not come to count them."""


def read_metadata(directory: Path) -> BagMetadata | None:
    """Reads the metadata of a bag; None where there are none.

    Raises:
        InputError: They cannot be used.
    """
    file = directory / NAME
    if not file.exists():
        return None
    size = file.stat().st_size
    if size > LARGEST:
        raise InputError(f"{file} has {size} bytes, and at most {LARGEST} are read.")
    text = "\n".join(_without_qos(file.read_text(encoding="utf-8", errors="replace")))
    if len(text) > _LARGEST_YAML:
        raise InputError(
            f"{file} has {len(text)} characters beside QoS, and at most {_LARGEST_YAML} are read."
        )
    if _ALIAS.search(text) or _nests_deeply(text):
        raise InputError(
            f"{file} has YAML anchors, aliases or deep nesting, which no recorder writes."
        )
    try:
        return _parsed(text)
    except Exception as err:  # of YAML, or whatever else stands there
        reason = shorten(str(err), 200).rstrip(".") or type(err).__name__
        raise InputError(f"{file} cannot be read ({reason}).") from err


def _parsed(text: str) -> BagMetadata:
    if "\0" in text:
        raise ValueError("it holds zero bytes, as where a machine lost power")
    loaded = _loaded(text)
    about = loaded.get("rosbag2_bagfile_information") if isinstance(loaded, dict) else None
    if not isinstance(about, dict):
        raise ValueError("it says nothing of a bag" if loaded else "it is empty")
    if int(about.get("version", _NEWEST)) > _NEWEST:
        raise ValueError(f"version {about['version']} is newer than {_NEWEST}")
    counts: dict[tuple[str, str], int] = {}
    for one in _list(about, "topics_with_message_count"):
        topic = one["topic_metadata"]
        key = str(topic["name"]), str(topic["type"])
        counts[key] = counts.get(key, 0) + int(one["message_count"])
    files = tuple(PurePath(str(one)).name for one in _list(about, "relative_file_paths"))
    return BagMetadata(files, counts)


def _loaded(text: str) -> Any:
    """A document, in which all scalars are texts: libyaml reads it in no time, where it is there.

    Reading the metadata takes a quarter of the time that all of a short bag takes otherwise.
    """
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()


def _list(about: dict[str, Any], name: str) -> list[Any]:
    """What is listed there; nothing where nothing is.

    Raises:
        ValueError: Something else is there.
    """
    found = about.get(name, [])
    if found in _NOTHING:
        return []
    if not isinstance(found, list):
        raise ValueError(f"{name} is no list")
    return found


def _without_qos(text: str) -> Iterator[str]:
    """The lines but for those about QoS, which are long and tell nothing here."""
    inside: int | None = None
    for line in text.splitlines():
        indent = len(line) - len(line.lstrip(" "))
        if inside is not None:
            item = indent == inside and line.lstrip(" ").startswith("- ")
            if not line.strip() or indent > inside or item:
                continue
            inside = None
        found = _QOS.fullmatch(line)
        if found is None:
            yield line
        else:
            inside = len(found[1])


def _nests_deeply(text: str) -> bool:
    if _INDENTED.search(text):
        return True
    depth = 0
    for bracket in re.findall(r"[\[\]{}]", text):
        depth += 1 if bracket in "[{" else -1
        if depth > _DEEPEST:
            return True
    return False
