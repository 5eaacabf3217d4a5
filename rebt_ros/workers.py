"""Runs work side by side: on the processors of this machine, or on a Dask cluster.

joblib does it in both cases.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import os
import re
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Literal, TypeVar

import joblib

from rebt_ros.errors import OptionError, RebtError

#: Until a scheduler must have answered (seconds).
_PATIENCE = 10.0
_ADDRESS = re.compile(r"([a-z]+://)?[^\s/]+:[0-9]{1,5}")
_SUCH_AS = "name one such as tcp://127.0.0.1:8786"
#: How often a worker looks whether its parent is there.
_WATCH_SECONDS = 0.5
#: joblib 1.3 returns results in order only, so that those behind a slow one wait for it.
_IN_ORDER = joblib.__version__.startswith("1.3.")


_Answer = TypeVar("_Answer")


class WorkerError(RebtError):
    """A worker, or the cluster, does not work."""


def check_workers(jobs: int, scheduler: str | None) -> None:
    """Refuses a number of jobs, or an address of a scheduler, that makes no sense.

    Raises:
        OptionError: It makes none.
    """
    if jobs == 0:
        raise OptionError("jobs is 0: name a number of processes, or -1 for one per processor.")
    if scheduler is not None and not _ADDRESS.fullmatch(scheduler):
        raise OptionError(f"the scheduler {scheduler!r} is no address: {_SUCH_AS}.")


def run_all(
    work: Callable[..., _Answer],
    tasks: Sequence[tuple[Any, ...]],
    jobs: int = -1,
    scheduler: str | None = None,
    *,
    batch: int | Literal["auto"] = 1,
) -> Iterator[_Answer]:
    """Runs tasks.

    Args:
        work: What is called with the values of each task; known by its name to other processes.
        tasks: Values that other processes can be sent.
        jobs: Processes; -1 for one per processor.  Not for a cluster, of which all workers work.
        scheduler: Address of a Dask scheduler; None for this machine.
        batch: Tasks that are handed out at a time; 1, so that each answer is there as soon as it is
            known, or "auto" where they are short.

    Yields:
        What came out, as soon as it is known and so in any order.

    Raises:
        OptionError: A number of jobs or an address that makes no sense.
        WorkerError: A worker died, or the cluster cannot be used.
    """
    check_workers(jobs, scheduler)
    if not tasks:
        return
    here = os.getpid() if scheduler is None else None
    calls = (joblib.delayed(_do)(work, task, here) for task in tasks)
    with _cluster(scheduler) if scheduler is not None else contextlib.nullcontext():
        parallel = joblib.Parallel(
            n_jobs=-1 if scheduler is not None else min(jobs, len(tasks)),
            batch_size=batch,
            return_as="generator" if _IN_ORDER else "generator_unordered",
        )
        try:
            yield from parallel(calls)
        except BrokenProcessPool as err:
            raise WorkerError(
                "a worker process died, perhaps of a lack of memory: start the same command again "
                "with fewer --jobs, and it goes on where it was."
            ) from err


def _do(work: Callable[..., _Answer], task: tuple[Any, ...], parent: int | None) -> _Answer:
    """Does a task, in the process `parent` or in one that is to end with it, if any."""
    if parent not in (None, os.getpid()):
        _end_with(parent)
    return work(*task)


@functools.cache
def _end_with(parent: int | None) -> None:
    """Ends this process when its parent ends.

    joblib's processes would finish what was handed to them first when their parent is killed, and
    be in the way of the run that goes on where it was.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


async def _reach(address: str) -> None:
    """Connects to a Dask scheduler, and leaves again."""
    from distributed.comm.core import connect

    comm = await connect(address, timeout=_PATIENCE)
    await comm.close()


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[None]:
    """Lets joblib use a Dask cluster.

    Raises:
        WorkerError: There is no such cluster, it has no workers, or Dask is not installed.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as err:
        raise WorkerError(
            "a Dask cluster is used through the package distributed, which is not installed: "
            "python3 -m pip install distributed."
        ) from err
    if _IN_ORDER:
        raise WorkerError(
            f"joblib {joblib.__version__} cannot return results from Dask one by one: install "
            "joblib 1.4 or newer."
        )
    try:
        # First without a client, which would wait 20 s for itself after a failure; in a thread, as
        # notebooks have an event loop in theirs.
        with ThreadPoolExecutor(1) as pool:
            pool.submit(lambda: asyncio.run(_reach(address))).result()
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except MemoryError as err:
        # What another server answers, "HTTP/1.1", is read as the length of a message.
        raise WorkerError(
            f"what answers at {address} is not a Dask scheduler: {_SUCH_AS}."
        ) from err
    except (OSError, ValueError) as err:
        raise WorkerError(f"no Dask scheduler answers at {address} ({err}): {_SUCH_AS}.") from err
    with client:
        if not client.scheduler_info()["workers"]:
            raise WorkerError(f"the Dask scheduler at {address} has no workers: start some.")
        try:
            with joblib.parallel_config(backend="dask", client=client):
                yield
        except (CancelledError, ImportError, KilledWorker, OSError) as err:
            raise WorkerError(
                f"the cluster at {address} failed ({type(err).__name__}: {err}): see that its "
                "workers can import rebt_ros, and start the same command again; it goes on where "
                "it was."
            ) from err
