"""Forms of JSON: what is encoded is decoded again, and the schema admits what is read."""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from rebt_ros.codec.bounds import Bounds, Count, Share
from rebt_ros.codec.containers import Named, Tagged
from rebt_ros.codec.form import MisfitError
from rebt_ros.codec.hints import form_of, record
from rebt_ros.codec.record import Field
from rebt_ros.codec.text import indented, parsed


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Wheel:
    radius: Annotated[float, Bounds(0)]
    spokes: Count = 0


@dataclass(frozen=True)
class Cart:
    name: str
    wheels: Annotated[tuple[Wheel, ...], Bounds(1, 4)]
    colour: Colour
    at: tuple[float, int]
    worn: dict[Colour, Share]
    load: Share | None
    locked: bool = False
    gear: Annotated[int, Bounds(-1, 5)] = 0


FORM = form_of(Cart)
SCHEMA = Draft202012Validator(FORM.schema({}))

numbers = st.floats(-1e9, 1e9)
shares = st.floats(0, 1)
texts = st.text(st.characters(codec="utf-8"), max_size=5)
wheels = st.builds(Wheel, st.floats(0, 1e9), st.integers(0, 99))
carts = st.builds(
    Cart,
    texts,
    st.lists(wheels, min_size=1, max_size=4).map(tuple),
    st.sampled_from(Colour),
    st.tuples(numbers, st.integers()),
    st.dictionaries(st.sampled_from(Colour), shares),
    st.none() | shares,
    st.booleans(),
    st.integers(-1, 5),
)
CART = Cart("hay", (Wheel(0.5), Wheel(1.0, 8)), Colour.RED, (0.5, 2), {Colour.BLUE: 0.25}, None)


def changed(*steps: str | int, to: object) -> Any:
    """The cart's JSON with another value at a place."""
    whole = FORM.encode(CART)
    holder = whole
    for step in steps[:-1]:
        holder = holder[step]
    holder[steps[-1]] = to
    return whole


def refusal(value: object) -> str:
    with pytest.raises(MisfitError) as refused:
        FORM.decode(value)
    assert not SCHEMA.is_valid(value)
    return refused.value.sentence("cart")


@given(carts)
def test_what_is_encoded_is_decoded_again(cart: Cart) -> None:
    written = json.loads(json.dumps(FORM.encode(cart)))
    assert FORM.decode(written) == cart
    assert SCHEMA.is_valid(written)


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ([], "cart must be an object, not []."),
        ({}, "cart lacks 'name'."),
        (changed("wheel", to=1), "cart has the unknown field 'wheel'."),
        (changed("name", to=1), "cart.name must be a text, not 1."),
        (changed("wheels", to=[]), "cart.wheels must be an array of at least 1 elements, not []."),
        (
            changed("wheels", to=[FORM.encode(CART)["wheels"][0]] * 5),
            "cart.wheels must be an array of at most 4 elements, not "
            "[{'radius': 0.5, 'spokes': 0}, {'radius': 0.5, 'spokes': 0},….",
        ),
        (
            changed("wheels", 1, "radius", to=-1),
            "cart.wheels[1].radius must be a number of at least 0, not -1.",
        ),
        (
            changed("wheels", 0, "spokes", to=1.5),
            "cart.wheels[0].spokes must be a whole number of at least 0, not 1.5.",
        ),
        (changed("colour", to="green"), "cart.colour must be one of red, blue, not 'green'."),
        (changed("colour", to=["red"]), "cart.colour must be one of red, blue, not ['red']."),
        (changed("at", to=[1]), "cart.at must be an array of 2 elements, not [1]."),
        (changed("at", 0, to=True), "cart.at[0] must be a number, not True."),
        (changed("at", 1, to="1"), "cart.at[1] must be a whole number, not '1'."),
        (changed("worn", to=[]), "cart.worn must be an object, not []."),
        (changed("worn", "green", to=1), "cart.worn.green must be one of red, blue, not 'green'."),
        (changed("worn", "blue", to=2), "cart.worn.blue must be a number from 0 to 1, not 2."),
        (changed("load", to=False), "cart.load must be a number, not False."),
        (changed("locked", to=0), "cart.locked must be true or false, not 0."),
        (changed("gear", to=6), "cart.gear must be a whole number from -1 to 5, not 6."),
    ],
)
def test_a_refusal_names_the_place_and_what_belongs_there(value: object, sentence: str) -> None:
    assert refusal(value) == sentence


def test_a_field_with_a_default_may_be_absent() -> None:
    value = FORM.encode(CART)
    del value["locked"], value["gear"], value["wheels"][0]["spokes"]
    assert FORM.decode(value) == CART
    assert SCHEMA.is_valid(value)


def test_a_whole_number_may_have_a_fraction_of_zero() -> None:
    gear = FORM.decode(changed("gear", to=3.0)).gear
    assert (gear, type(gear)) == (3, int)


def test_a_record_can_rename_leave_out_and_describe_fields() -> None:
    form = record(
        Wheel,
        Field("r", attribute="radius", description="In metres."),
        Field("spokes", omitted=True),
    )
    assert form.encode(Wheel(1.0)) == {"r": 1.0}
    assert form.encode(Wheel(1.0, 2)) == {"r": 1.0, "spokes": 2}
    assert form.decode({"r": 1.0}) == Wheel(1.0)
    assert form.schema({}) == {
        "type": "object",
        "properties": {
            "r": {"description": "In metres.", "type": "number", "minimum": 0},
            "spokes": {"type": "integer", "minimum": 0},
        },
        "required": ["r"],
        "additionalProperties": False,
    }


def test_a_tolerant_record_passes_over_what_it_does_not_know() -> None:
    form = record(Wheel, tolerant=True)
    value = {"radius": 1.0, "tyre": "rubber"}
    assert form.decode(value) == Wheel(1.0)
    assert Draft202012Validator(form.schema({})).is_valid(value)


@dataclass(frozen=True)
class Leaf:
    name: str


@dataclass(frozen=True)
class Fork:
    branches: tuple[Any, ...]


PLANT: Named[Any] = Named("plant")
PLANT.define(
    Tagged(
        "is",
        {
            "leaf": record(Leaf),
            "fork": record(Fork, "branches", known={tuple[Any, ...]: form_of(tuple[Leaf, ...])}),
        },
    )
)


def test_a_tag_tells_dataclasses_apart() -> None:
    fork = Fork((Leaf("a"), Leaf("b")))
    value = {"is": "fork", "branches": [{"name": "a"}, {"name": "b"}]}
    assert PLANT.encode(fork) == value
    assert PLANT.decode(value) == fork
    definitions: dict[str, Any] = {}
    assert PLANT.schema(definitions) == {"$ref": "#/$defs/plant"}
    schema = Draft202012Validator({"$ref": "#/$defs/plant", "$defs": definitions})
    assert schema.is_valid(value)
    assert not schema.is_valid({"is": "leaf", "branches": []})
    for other, problem in (
        ({"is": "root"}, "it has the unknown is 'root'."),
        ({"name": "a"}, "it must be an object with a 'is', not {'name': 'a'}."),
    ):
        with pytest.raises(MisfitError) as refused:
            PLANT.decode(other)
        assert refused.value.sentence("it") == problem
        assert not schema.is_valid(other)


def test_a_constant_is_compared() -> None:
    form = record(Leaf).with_constants({"version": 2})
    assert form.decode({"version": 2, "name": "a"}) == Leaf("a")
    with pytest.raises(MisfitError, match="must be 2, not 3"):
        form.decode({"version": 3, "name": "a"})


def test_what_has_no_form_is_the_programmer_s_mistake() -> None:
    with pytest.raises(TypeError, match="has no form"):
        form_of(complex)


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    # Also lone surrogates.
    | st.text(st.characters()),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(json_values)
def test_indented_text_is_that_of_the_standard_library(value: Any) -> None:
    text = indented(value)
    assert text == json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False)
    assert parsed(text) == value


@pytest.mark.parametrize("value", [float("nan"), [float("inf")], {"a": float("-inf")}])
def test_numbers_that_json_does_not_have_are_neither_written_nor_read(value: object) -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        indented(value)
    with pytest.raises(ValueError, match="is not a number"):
        parsed(json.dumps(value))
