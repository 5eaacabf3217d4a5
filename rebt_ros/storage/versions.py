"""Which software makes a result."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import rebt_ros.errors

#: Shells over the core, which decide no result.
_SHELLS = frozenset({"commands", "ros"})


def versions(packages: Iterable[str]) -> dict[str, str]:
    """The versions of Python and of packages; "unknown" where one is not installed."""
    found = {"python": platform.python_version()}
    for package in packages:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "unknown"
    return found


@cache
def source_digest() -> str:
    """Tells apart states of this package's core that share a version number."""
    package = Path(rebt_ros.errors.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        inside = path.relative_to(package)
        if inside.parts[0] not in _SHELLS:
            digest.update(f"{inside.as_posix()}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
