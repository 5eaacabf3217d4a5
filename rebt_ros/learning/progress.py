"""Progress of long work."""

from __future__ import annotations

from collections.abc import Callable

#: Called with what is being done, and the share of the work that is done.
Progress = Callable[[str, float], None]
