"""Whether a directory can be written to, before there is something to write."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


class WritableDirectory:
    """Tells why nothing can be written to a directory, which need not be there yet.

    A file without a name is written for that: there is never one to see.  Where that has worked, it
    is not tried again unless that is asked for.
    """

    def __init__(self) -> None:
        self._good: Path | None = None

    def why_not(self, directory: Path, *, again: bool = False) -> str:
        """Why nothing can be written there, without a full stop; empty where that works.

        Args:
            directory: The directory.
            again: Whether to try it in any case, as where a disk was full.
        """
        there = directory.absolute()
        nearest = next(one for one in (there, *there.parents) if os.path.lexists(one))
        if not again and there == self._good and os.access(nearest, os.W_OK | os.X_OK):
            return ""
        try:
            with tempfile.TemporaryFile(dir=nearest) as file:
                file.write(b"\0")
        except OSError as err:
            self._good = None
            reason = err.strerror or str(err)
            if nearest != there:
                reason = f"{nearest}: {reason}"
            return (
                f"nothing can be written to {there} ({reason}): name a directory with room where "
                "you may write"
            )
        self._good = there
        return ""
