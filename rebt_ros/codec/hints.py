"""Forms derived from type hints, with the bounds that stand in them (`bounds`)."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from enum import Enum
from types import NoneType, UnionType
from typing import Annotated, Any, TypeAlias, Union, get_args, get_origin, get_type_hints

from rebt_ros.codec.bounds import Bounds
from rebt_ros.codec.containers import Array, Fixed, OrNull, Table
from rebt_ros.codec.form import Form, Json, T
from rebt_ros.codec.record import REQUIRED, Field, Record
from rebt_ros.codec.scalars import Choice, Number, Text, Truth, Whole

#: Forms of types that have one of their own.
Known: TypeAlias = Mapping[Any, Form[Any]]

_UNBOUNDED = Bounds()


def record(
    kind: type[T],
    *fields: str | Field[T],
    known: Known | None = None,
    rules: Mapping[str, Json] | None = None,
    tolerant: bool = False,
) -> Record[T]:
    """The form of a dataclass.

    Args:
        kind: The dataclass.
        fields: In the order in which they are written: the name of an attribute that stands in
            JSON as its type hint says, or what differs from that.  All attributes if empty.
        known: Forms of types that have one of their own.
        rules: Further parts of the schema.
        tolerant: Whether unknown fields are passed over instead of refused.

    Raises:
        TypeError: A type hint has no form.
    """
    hints = get_type_hints(kind, include_extras=True)
    own = dataclasses.fields(kind)  # type: ignore[arg-type]
    defaults = {field.name: _default(field) for field in own}
    derived: list[Field[T]] = []
    for field in fields or tuple(defaults):
        if isinstance(field, str):
            form = form_of(hints[field], known)
            derived.append(Field(field, form, default=defaults[field]))
        else:
            form = field.form or form_of(hints[field.argument], known)
            default = defaults.get(field.argument) if field.omitted else field.default
            derived.append(dataclasses.replace(field, form=form, default=default))
    return Record(kind, tuple(derived), rules=rules, tolerant=tolerant)


def form_of(hint: Any, known: Known | None = None) -> Form[Any]:
    """The form of what a type hint describes.

    Args:
        hint: A type of text, truth, numbers, enums, tuples, dictionaries or dataclasses, or one of
            these or None.
        known: Forms of types that have one of their own.

    Raises:
        TypeError: It has no form.
    """
    bounds = _UNBOUNDED
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        bounds = next((note for note in notes if isinstance(note, Bounds)), _UNBOUNDED)
    if known is not None and hint in known:
        return known[hint]
    if get_origin(hint) in (Union, UnionType):
        choices = [choice for choice in get_args(hint) if choice is not NoneType]
        if len(choices) == 1:
            return OrNull(form_of(choices[0], known))
    if get_origin(hint) is tuple:
        return _tuple_form(get_args(hint), bounds, known)
    if get_origin(hint) in (dict, Mapping):
        key, value = get_args(hint)
        return Table(form_of(key, known), form_of(value, known))
    return _plain_form(hint, bounds, known)


def _plain_form(hint: Any, bounds: Bounds, known: Known | None) -> Form[Any]:
    if hint is str:
        return Text()
    if hint is bool:
        return Truth()
    if hint is int:
        return Whole(bounds.least, bounds.most)
    if hint is float:
        return Number(bounds.least, bounds.most)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return Choice(hint)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return record(hint, known=known)
    raise TypeError(f"{hint} has no form")


def _tuple_form(hints: tuple[Any, ...], bounds: Bounds, known: Known | None) -> Form[Any]:
    if hints[-1] is not Ellipsis:
        return Fixed(tuple(form_of(hint, known) for hint in hints))
    least = int(max(0, bounds.least))
    most = int(bounds.most) if math.isfinite(bounds.most) else None
    return Array(form_of(hints[0], known), least, most)


def _default(field: dataclasses.Field[Any]) -> object:
    if field.default is not dataclasses.MISSING:
        return field.default
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return REQUIRED
