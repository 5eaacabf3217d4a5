"""What a browser can ask for, and how badly."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rebt_ros.errors import OptionError
from rebt_ros.studio.verbs import Arguments, reply

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=5,
)


@given(JSON)
def test_whatever_is_asked_gets_an_answer(request: Any) -> None:
    answer = reply({}, request).as_json()
    assert answer["ok"] is False
    assert answer["message"].endswith((".", "page."))


@given(JSON)
def test_arguments_are_read_with_their_types_or_refused_in_a_sentence(value: Any) -> None:
    arguments = Arguments({"name": value})
    readings: tuple[tuple[Callable[[str], Any], type], ...] = (
        (arguments.text, str),
        (arguments.flag, bool),
        (arguments.number, float),
        (arguments.whole, int),
    )
    for read, kind in readings:
        refused = ""
        try:
            found = read("name")
        except OptionError as err:
            refused = str(err)
        assert refused.startswith("'name' must be") if refused else type(found) is kind


def test_a_verb_answers_with_a_sentence_and_data_or_says_why_not() -> None:
    def refuse(asked: Arguments) -> str:
        raise OptionError("no.")

    def tell(asked: Arguments) -> tuple[str, list[float]]:
        return "here", [asked.number("x")]

    verbs = {"say": lambda asked: asked.text("what"), "tell": tell, "refuse": refuse}
    assert reply(verbs, {"id": 1, "do": "say", "what": "hello"}).as_json() == {
        "answer": 1,
        "ok": True,
        "message": "hello",
        "data": None,
    }
    told = reply(verbs, {"id": "a", "do": "tell", "x": 2})
    assert (told.id, told.ok, told.data) == ("a", True, [2.0])
    assert reply(verbs, {"id": 1, "do": "refuse"}).message == "no."
    assert not reply(verbs, {"id": [1], "do": "say"}).ok


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, True, "1", None])
def test_numbers_are_finite(value: Any) -> None:
    with pytest.raises(OptionError):
        Arguments({"x": value}).number("x")
