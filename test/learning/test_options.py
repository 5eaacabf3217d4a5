"""Options of learning: what they take, and what they say about everything else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from types import MappingProxyType

import numpy as np
import pytest

import rebt_ros
from rebt_ros.errors import OptionError
from rebt_ros.learning.options import LearnOptions, Use

PAPER = LearnOptions.paper()
OPTIONS = [field.name for field in fields(LearnOptions)]
WRONG = ("0.3", "nonsense", "", b"auto", 2.5, True, None, math.nan, math.inf, -1, 3 + 4j, 10**400)
OF_WRONG_TYPE = (*WRONG, [], [1], (1,), {}, {"x": 1}, {1: "m"}, object(), Use, Use.AUTO, print)


@pytest.mark.parametrize("name", OPTIONS)
def test_an_option_of_a_wrong_type_is_named_in_a_sentence(name: str) -> None:
    refusals = []
    for value in OF_WRONG_TYPE:
        try:
            options = LearnOptions(**{name: value})
        except OptionError as err:
            refusals.append(str(err))
        else:
            assert type(getattr(options, name)) in _types_of(name), value
    assert len(refusals) >= len(OF_WRONG_TYPE) // 2
    for sentence in refusals:
        assert sentence.startswith(f"{name} ")
        assert sentence.endswith(".")


def _types_of(name: str) -> set[type]:
    """Those of the values that an option is known to have."""
    known = [getattr(options, name) for options in (LearnOptions(), PAPER)]
    known += {"ccp_alpha": [0.0], "reaction_time": [0.0], "level": [0], "max_depth": [1]}.get(
        name, []
    )
    return {type(value) for value in known}


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("delta", "0.3"),
        ("lags", "2"),
        ("lags", 2.0),
        ("max_depth", "auto"),
        ("random_state", None),
        ("test_fraction", None),
        ("refit", "no"),
        ("refit", 0),
        ("reductions", "none"),
        ("reductions", False),
        ("attach", 3),
        ("attach", ("psa-1", 3)),
        ("units", "m"),
        ("units", {"x": 3}),
        ("history", "never"),
        ("psa", None),
    ],
)
def test_known_mistakes_are_refused(name: str, value: object) -> None:
    with pytest.raises(OptionError, match=f"^{name} must be .*, not .*"):
        LearnOptions(**{name: value})


@pytest.mark.parametrize("name", OPTIONS)
def test_words_of_enums_are_taken_for_their_members(name: str) -> None:
    kind = rebt_ros.PsaChoice if name == "psa_choice" else type(getattr(PAPER, name))
    for member in kind if issubclass(kind, Enum) else ():
        assert getattr(LearnOptions(**{name: member.value}), name) is member


def test_numbers_of_numpy_and_lists_are_taken() -> None:
    options = LearnOptions(
        delta=np.float32(0.5), lags=np.int64(2), max_depth=np.int32(3), attach=["psa-1"]
    )
    assert (options.delta, options.lags, options.max_depth) == (0.5, 2, 3)
    assert [type(one) for one in (options.delta, options.lags)] == [float, int]
    assert options.attach == ("psa-1",)
    units: Mapping[str, str] = MappingProxyType({"x": "m"})
    assert LearnOptions(units=units).units == units


@pytest.mark.parametrize(
    ("name", "inside", "outside"),
    [
        ("delta", (0, 1), (-1e-9, 1 + 1e-9)),
        ("max_depth", (1,), (0,)),
        ("ccp_alpha", (0,), (-1e-9, math.inf)),
        ("level", (0,), (-1,)),
        ("test_fraction", (0,), (-1e-9, 1)),
        ("reaction_time", (0, 5), (-1e-9, 5 + 1e-9)),
        ("random_state", (0, 2**32 - 1), (-1, 2**32)),
        ("lags", (0, 20), (-1, 21)),
    ],
)
def test_ranges_include_their_ends(
    name: str, inside: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    for value in inside:
        assert getattr(LearnOptions(**{name: value}), name) == value
    for value in outside:
        with pytest.raises(OptionError, match=f"^{name} must "):
            LearnOptions(**{name: value})


def test_the_papers_settings_are_those_of_the_paper() -> None:
    """IV-B, and nothing that goes past it."""
    assert (PAPER.delta, PAPER.max_depth, PAPER.ccp_alpha) == (0.3, 5, 0.0)
    assert (PAPER.psa, PAPER.history) == (Use.ALWAYS, rebt_ros.History.LAST)
    assert (PAPER.root, PAPER.reductions) == (rebt_ros.Root.PARALLEL, None)
    assert (PAPER.differences, PAPER.sums) == (Use.NEVER, Use.NEVER)
    assert PAPER.reaction_time == 0.0
    assert not any((PAPER.refit, PAPER.simplest, PAPER.readable_thresholds, PAPER.routines))
    assert PAPER.is_paper
    assert not LearnOptions().is_paper
