"""Reads many inputs: side by side, those that were read before from the cache."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from rebt_ros.demonstration.large_arrays import Spool
from rebt_ros.errors import InputError, OptionError, RebtError
from rebt_ros.storage.column_file import NoColumnFileError, unpacked_read
from rebt_ros.storage.input_options import InputKind, InputOptions, ReadingPlan, Source
from rebt_ros.storage.read import Read, on_spool
from rebt_ros.storage.read_cache import (
    ReadCache,
    is_kept,
    kept_bytes,
    size_of,
    state_of,
)
from rebt_ros.storage.text import unreadable

#: Processes are started for so many bytes that are read for the first time: they take a second.
_WORTHWHILE: Final = 16 << 20
#: Seconds of reading after which it is known how fast it is.
_SETTLED: Final = 1.0
_MINUTE: Final = 60
_HOUR: Final = 60 * _MINUTE


@dataclass(frozen=True, slots=True)
class Reading:
    """How one input is read: functions that other processes know by their names."""

    read: Callable[[Source, InputOptions], Read]
    """Reads it, or raises a `RebtError`."""
    deciding: Callable[[InputKind, InputOptions], tuple[object, ...]]
    """The options that decide about rows, in plain values."""


@dataclass(frozen=True, slots=True)
class Gathered:
    """What was read of all inputs."""

    found: tuple[Read | RebtError, ...]
    """Of each: what was read, or why it could not be."""
    unwritable: str = ""
    """Why the cache did not take something."""
    cached: int = 0
    """How many of them the cache had."""


@dataclass(frozen=True, slots=True)
class _Fetched:
    """What a worker says of an input: one of the first three."""

    place: int
    """Position among the inputs."""
    key: str | None = None
    """Where it is in the cache."""
    content: bytes | None = None
    """What would be kept of it, where no cache keeps it."""
    error: RebtError | None = None
    """Why it cannot be read."""
    unwritable: str = ""
    """Why the cache does not take it."""
    is_cached: bool = False
    """Whether the cache had it."""


def gather(sources: Sequence[Source], reading: Reading, options: InputOptions) -> Gathered:
    """Reads inputs, in whatever order, and gives what was read in theirs.

    Raises:
        RebtError: A worker failed, or an option makes no sense; if the plan is strict, an input
            cannot be read.
    """
    plan = options.plan
    if plan.jobs == 0 or plan.scheduler is not None:
        _check_workers(plan)
    cache = None if plan.cache is None else ReadCache(plan.cache)
    keys = {}
    if cache is not None and plan.scheduler is None:
        # Of a fleet, these are the same for all inputs of a kind.
        deciding = {
            kind: reading.deciding(kind, options) for kind in {source.kind for source in sources}
        }
        keys = {
            place: _key(source, deciding[source.kind], cache)
            for place, source in enumerate(sources)
        }
    spool = Spool()
    answers: dict[int, Read | RebtError] = {}
    if cache is not None:
        for place, key in keys.items():
            read = cache.get(key, sources[place], options.robot) if key else None
            if read is not None:
                answers[place] = on_spool(read, spool)
    missing = [place for place in range(len(sources)) if place not in answers]
    apart = _for_workers(missing, sources, plan)
    cached = len(answers)
    tell = _Telling(plan.progress, len(missing))
    reasons: list[str] = []
    try:
        for place in (one for one in missing if one not in apart):
            source, known = sources[place], keys.get(place)
            answer = _answer(source, reading, options, known, cache, reasons)
            answers[place] = on_spool(answer, spool) if isinstance(answer, Read) else answer
            tell.one_more()
        for fetched in _by_workers(sorted(apart), sources, keys, reading, options):
            answer = _taken(fetched, sources[fetched.place], options)
            answers[fetched.place] = on_spool(answer, spool) if isinstance(answer, Read) else answer
            reasons += filter(None, [fetched.unwritable])
            cached += fetched.is_cached
            tell.one_more()
    finally:
        plan.progress("reading", 1.0)
    found = tuple(answers[place] for place in range(len(sources)))
    for answer in found:
        if isinstance(answer, RebtError) and (plan.strict or isinstance(answer, OptionError)):
            raise answer
    return Gathered(found, min(reasons, default=""), cached)


def _check_workers(plan: ReadingPlan) -> None:
    # joblib is not loaded where it is not used.
    from rebt_ros.workers import check_workers

    check_workers(1 if plan.jobs is None else plan.jobs, plan.scheduler)


def _answer(
    source: Source,
    reading: Reading,
    options: InputOptions,
    key: str | None,
    cache: ReadCache | None,
    reasons: list[str],
) -> Read | RebtError:
    """What was read in this process, or why it could not be.

    Raises:
        RebtError: It could not be, and that is no matter of this input, or the plan is strict.
    """
    try:
        return _read_here(source, reading, options, key, cache, reasons)
    except OptionError:
        raise
    except RebtError as err:
        if options.plan.strict:
            raise
        return err


def _for_workers(
    missing: Sequence[int], sources: Sequence[Source], plan: ReadingPlan
) -> frozenset[int]:
    """Which of the inputs that must be read are read by other processes."""
    own = frozenset(place for place in missing if is_kept(sources[place]))
    if plan.scheduler is not None or (plan.jobs not in (None, 1) and len(own) > 1):
        return own
    if plan.jobs is None and len(own) > 1:
        size = sum(size_of(sources[place]) for place in own)
        return own if size >= _WORTHWHILE else frozenset()
    return frozenset()


def _by_workers(
    places: Sequence[int],
    sources: Sequence[Source],
    keys: dict[int, str],
    reading: Reading,
    options: InputOptions,
) -> Iterator[_Fetched]:
    if not places:
        return iter(())
    from rebt_ros.workers import run_all

    plan = options.plan
    plain = replace(options, plan=ReadingPlan(cache=plan.cache))
    here = Path.cwd()
    tasks = [(place, sources[place], reading, plain, keys.get(place), here) for place in places]
    jobs = -1 if plan.jobs is None else plan.jobs
    return run_all(_fetched, tasks, jobs, plan.scheduler, batch="auto")


def _fetched(
    place: int,
    source: Source,
    reading: Reading,
    options: InputOptions,
    key: str | None,
    here: Path,
) -> _Fetched:
    """Reads an input in a worker, which leaves it in the cache as a rule."""
    # A worker that was started for an earlier call may stand in another directory, and one on
    # another machine may not have this one.
    with suppress(OSError):
        os.chdir(here)
    directory = options.plan.cache
    cache = None if directory is None else ReadCache(directory)
    if cache is not None and key is None:
        key = _key(source, reading.deciding(source.kind, options), cache)
        if key and cache.get(key, source, options.robot) is not None:
            return _Fetched(place, key, is_cached=True)
    reasons: list[str] = []
    try:
        read = _read_here(source, reading, options, key, cache, reasons)
    except RebtError as err:
        return _Fetched(place, error=_plain(err))
    if (
        cache is not None
        and key
        and not reasons
        and cache.get(key, source, options.robot) is not None
    ):
        return _Fetched(place, key)
    content = b"".join(kept_bytes(source, read))
    return _Fetched(place, content=content, unwritable="".join(reasons[:1]))


def _plain(error: RebtError) -> RebtError:
    """An error as another process can be sent it: without what it was raised from."""
    kind = OptionError if isinstance(error, OptionError) else InputError
    return kind(str(error))


def _taken(fetched: _Fetched, source: Source, options: InputOptions) -> Read | RebtError:
    """What a worker read.

    Raises:
        WorkerError: It is not in the cache of this machine.
    """
    if fetched.error is not None:
        return fetched.error
    if fetched.content is not None:
        try:
            read, _, has_robot = unpacked_read(fetched.content)
        except NoColumnFileError as err:  # the worker is of another version
            raise _elsewhere(options.plan) from err
        return replace(read, robot=options.robot) if has_robot else read
    cache = options.plan.cache
    kept = cache and fetched.key and ReadCache(cache).get(fetched.key, source, options.robot)
    if not kept:
        raise _elsewhere(options.plan)
    return kept


def _elsewhere(plan: ReadingPlan) -> RebtError:
    from rebt_ros.workers import WorkerError

    return WorkerError(
        f"what the workers kept in {plan.cache} is not there on this machine: name a directory "
        "that all machines share with --cache, or keep nothing (--no-cache)."
    )


def _key(source: Source, deciding: tuple[object, ...], cache: ReadCache) -> str:
    """The key of an input in a cache; empty where it is not kept, or cannot be read."""
    if not is_kept(source):
        return ""
    try:
        return cache.key_of(source, deciding)
    except OSError:
        return ""


def _read_here(
    source: Source,
    reading: Reading,
    options: InputOptions,
    key: str | None,
    cache: ReadCache | None,
    reasons: list[str],
) -> Read:
    """Reads an input in this process, and keeps what was read; notes why the cache refuses it.

    Raises:
        RebtError: It cannot be read.
    """
    if cache is None or not key:
        return reading.read(source, options)
    try:
        before = state_of(source)
        read = reading.read(source, options)
        # Of an input that is written to, nobody knows of what content it was read.
        is_same = before == state_of(source)
    except OSError as err:
        raise unreadable(source.path, err) from err
    if is_same:
        try:
            cache.put(key, kept_bytes(source, read))
        except OSError as err:
            reasons.append(err.strerror or str(err))
    return read


class _Telling:
    """Tells how far the reading is, how fast it is, and when it will be done."""

    def __init__(self, progress: Callable[[str, float], None], total: int) -> None:
        self._progress = progress
        self._total = total
        self._done = 0
        self._start = time.monotonic()

    def one_more(self) -> None:
        """Another input was read, or set aside."""
        self._done += 1
        stage = f"reading {self._done} of {self._total}"
        seconds = time.monotonic() - self._start
        if seconds > _SETTLED:
            rate = self._done / seconds
            stage += f", {rate:.3g}/s, {time_left((self._total - self._done) / rate)} left"
        # The end is told once all is there.
        self._progress(stage, min(self._done / self._total, 0.999))


def time_left(seconds: float) -> str:
    """A time that a person waits, in two units at most.

    >>> time_left(8.2), time_left(95), time_left(7500)
    ('9 s', '1 min 35 s', '2 h 5 min')
    """
    whole = int(-(-seconds // 1))
    if whole < _MINUTE:
        return f"{whole} s"
    if whole < _HOUR:
        return f"{whole // _MINUTE} min {whole % _MINUTE} s"
    return f"{whole // _HOUR} h {whole % _HOUR // _MINUTE} min"
