"""The linters of ament, where they are installed: they come with ROS 2, not with PyPI's wheels."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGE = str(CHECKOUT / "rebt_ros")


def test_flake8_finds_nothing(tmp_path: Path) -> None:
    main = pytest.importorskip("ament_flake8.main", reason="needs ament_flake8").main
    # Order of imports, quotes and docstrings are ruff's, and so is the longest line.
    config = tmp_path / "flake8.ini"
    config.write_text("[flake8]\nextend-ignore = B902,C816,D,E203,I,Q\nmax-line-length = 100\n")
    assert main(argv=["--config", str(config), PACKAGE]) == 0


def test_pep257_finds_nothing() -> None:
    main = pytest.importorskip("ament_pep257.main", reason="needs ament_pep257").main
    # As in .ruff.toml: the class documents __init__, and Form the methods of forms.
    left_out = ["D102", "D105", "D107", "D403"]
    assert main(argv=["--convention", "google", "--add-ignore", *left_out, "--", PACKAGE]) == 0


def test_xmllint_finds_nothing() -> None:
    main = pytest.importorskip("ament_xmllint.main", reason="needs ament_xmllint").main
    if shutil.which("xmllint") is None:
        pytest.skip("needs xmllint of libxml2-utils")
    # package.xml is compared with a schema that would be downloaded.
    assert main(argv=[str(CHECKOUT / "config")]) == 0
