"""Settings and versions that decide the results of an experiment, and a short name for them."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import Any

from rebt_ros.storage.versions import source_digest, versions
from rebt_ros.study.settings import Settings

_DECIDING_PACKAGES = ("networkx", "numpy", "pyeda", "scikit-learn", "scipy")


def provenance(settings: Settings) -> dict[str, Any]:
    """Settings and versions of this process, as JSON has them."""
    # The version of this package changes too rarely to tell its states apart.
    found = {"rebt_ros": f"source {source_digest()}"} | versions(_DECIDING_PACKAGES)
    return {"settings": asdict(settings), "versions": found}


def fingerprint(settings: Settings) -> str:
    """Differs where `provenance` does."""
    text = json.dumps(provenance(settings), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
