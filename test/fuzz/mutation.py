"""Mutations of bytes, text and JSON values; each follows from the generator of random numbers."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any, Final, TypeAlias

Json: TypeAlias = Any

#: Texts that have broken programs before.
TEXTS: Final = (
    "",
    " ",
    "\0",
    "a\0b",
    "\n",
    "\r\n# rebt_ros recording {}",
    "\ud800",
    "\u202e\u2066",
    "\ufeff",
    "é" * 300,
    "x" * 10_000,
    "../../etc/passwd",
    "/etc/passwd",
    "C:\\..\\x",
    "~",
    "~/x",
    "/",
    "//",
    "a//b",
    "a/",
    "{node}/{ns}",
    "{unknown}",
    "{0.__class__.__mro__}",
    "{}",
    "%s%s%n%d",
    "$(id)",
    "`id`",
    "__class__",
    "<script>alert(1)</script>",
    "]]>&amp;&#0;<!--",
    '"',
    "'",
    "1",
    "NaN",
    "null",
    "behavior_tree",
    "command",
    "/diagnostics",
    "/rosout",
    "state",
    "/" + "t" * 250,
)

#: JSON texts of numbers that have broken programs before.
NUMBERS: Final = (
    "0",
    "-0.0",
    "-1",
    "1",
    "2",
    "0.5",
    "1e308",
    "1e309",
    "-1e999",
    "5e-324",
    "1e-400",
    "2147483648",
    "-9223372036854775809",
    "18446744073709551616",
    "9" * 400,
    "9" * 5000,
    "NaN",
    "Infinity",
    "-Infinity",
)

#: Pieces of the formats that are read, to be put anywhere.
TOKENS: Final = (
    *(
        b'"',
        b"'",
        b",",
        b":",
        b"{",
        b"}",
        b"[",
        b"]",
        b"\n",
        b"\r\n",
        b"\0",
        b"\xff",
        b"\xef\xbb\xbf",
    ),
    *(
        b"null",
        b"true",
        b"NaN",
        b"1e999",
        b"-1",
        b"&a ",
        b"*a",
        b"!!python/object:os.system ",
        b"? ",
    ),
    *(b"\\u0000", b"\\ud800", b"{" * 200, b"[" * 2000, b"9" * 5000, b"# rebt_ros recording "),
    *(b"\x89MCAP0\r\n", b"SQLite format 3\0", b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"),
)

#: Sizes and offsets that have broken programs before, little endian.
_SIZES: Final = tuple(
    value.to_bytes(width, "little")
    for width in (1, 2, 4, 8)
    for value in (0, 1, 2 ** (8 * width - 1) - 1, 2 ** (8 * width - 1), 2 ** (8 * width) - 1)
)

#: Deepest nesting that is tried.
_DEEPEST: Final = 3000


def mutated_bytes(random: Random, data: bytes, others: Sequence[bytes] = ()) -> bytes:
    """One to a few changes at random places."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        data = random.choice(_BYTE_CHANGES)(random, data, others)
    return data


def mutated_text(random: Random, text: str, others: Sequence[bytes] = ()) -> str:
    """A text whose UTF-8 form was changed."""
    changed = mutated_bytes(random, text.encode("utf-8", "surrogatepass"), others)
    return changed.decode("utf-8", random.choice(("replace", "surrogateescape")))


def mutated_json(random: Random, text: str) -> str:
    """A JSON text with one to a few changes of its structure, and at times of its characters."""
    value = json.loads(text)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        value = _changed(random, value)
    written = json.dumps(value, ensure_ascii=random.random() < 0.5)
    for mark, number in _marks(written):
        written = written.replace(mark, number)
    return mutated_text(random, written) if random.random() < 0.1 else written


def _place(random: Random, data: bytes) -> int:
    return random.randrange(len(data) + 1)


def _flip(random: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    if not data:
        return data
    changed = bytearray(data)
    changed[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _overwrite(random: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    place, new = _place(random, data), random.choice(_SIZES)
    return data[:place] + new + data[place + len(new) :]


def _insert(random: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    place = _place(random, data)
    new = random.choice(TOKENS) if random.random() < 0.7 else random.randbytes(random.randint(1, 8))
    return data[:place] + new + data[place:]


def _delete(random: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    place = _place(random, data)
    return data[:place] + data[place + random.choice((1, 1, 2, 8, 64, 1000)) :]


def _cut(random: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    return data[: _place(random, data)]


def _repeat(random: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    place = _place(random, data)
    piece = data[place : place + random.choice((1, 4, 30, 300))]
    return data[:place] + piece * random.choice((2, 3, 50)) + data[place:]


def _splice(random: Random, data: bytes, others: Sequence[bytes]) -> bytes:
    other = random.choice(others) if others else data
    return data[: _place(random, data)] + other[_place(random, other) :]


_BYTE_CHANGES: Final[tuple[Callable[[Random, bytes, Sequence[bytes]], bytes], ...]] = (
    _flip,
    _flip,
    _overwrite,
    _insert,
    _insert,
    _delete,
    _cut,
    _repeat,
    _splice,
)


def _containers(value: Json) -> list[Json]:
    """Every object and array of a value that is not empty."""
    found, waiting = [], [value]
    while waiting:
        one = waiting.pop()
        if isinstance(one, (dict, list)) and one:
            found.append(one)
            waiting += one.values() if isinstance(one, dict) else one
    return found


def _key(random: Random, container: Json) -> Any:
    if isinstance(container, dict):
        return random.choice(list(container))
    return random.randrange(len(container))


def _changed(random: Random, value: Json) -> Json:
    """The value with one change; it may be made in place."""
    containers = _containers(value)
    if not containers or random.random() < 0.02:
        return _odd(random)
    container = random.choice(containers)
    key = _key(random, container)
    match random.randrange(7):
        case 0:
            del container[key]
        case 1 | 2:
            container[key] = _odd(random)
        case 3:
            container[key] = _nudged(random, container[key])
        case 4:
            other = random.choice(containers)
            # A copy, as a value that holds itself cannot be written.
            container[key] = json.loads(json.dumps(other[_key(random, other)]))
        case 5 if isinstance(container, dict):
            container[random.choice((*TEXTS, *container))] = container.pop(key)
        case 5:
            container += container[:50]
        case _:
            container[key] = _nested(random, container[key])
    return value


def _odd(random: Random) -> Json:
    """A value of any kind."""
    return random.choice(
        (
            lambda: random.choice(TEXTS),
            lambda: f"@@number {random.randrange(len(NUMBERS))}@@",
            lambda: random.choice((None, True, False)),
            lambda: random.choice(([], {}, [[]], [{}], {"type": "action"}, {"": None})),
            lambda: random.uniform(-2, 2),
        )
    )()


def _nudged(random: Random, value: Json) -> Json:
    """A value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + random.choice((-1, 1, 20, 10**6, 10**20))
    if isinstance(value, float):
        return value * random.choice((-1.0, 0.0, 1e-300, 1e300, 1.0000000000000002))
    if isinstance(value, str):
        return random.choice((value + random.choice(TEXTS), value[:-1], value.upper(), value * 2))
    return _odd(random)


def _nested(random: Random, value: Json) -> Json:
    if random.random() < 0.8:
        depth = random.choice((1, 2, 50, 99, 100, 101))
        inverters = random.random() < 0.7
        for _ in range(depth):
            value = {"type": "inverter", "child": value} if inverters else [value]
        return value
    return f"@@nesting {random.choice((500, 990, 1000, _DEEPEST))}@@"


def _marks(written: str) -> list[tuple[str, str]]:
    """What stands for JSON that Python would not write, and that JSON."""
    if "@@" not in written:
        return []
    return [
        *((f'"@@number {place}@@"', number) for place, number in enumerate(NUMBERS)),
        *(
            (f'"@@nesting {depth}@@"', "[" * depth + "]" * depth)
            for depth in (500, 990, 1000, _DEEPEST)
        ),
    ]
