"""Progress of long work."""

from __future__ import annotations

from collections.abc import Callable

#: Told what is being done and which share of the work is behind.
Progress = Callable[[str, float], None]
