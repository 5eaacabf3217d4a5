"""Forms of values that are made of others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from rebt_ros.codec.form import Definitions, Form, Json, MisfitError, T, abridged
from rebt_ros.codec.record import Record

K = TypeVar("K")


class Array(Form[tuple[T, ...]]):
    """A tuple whose elements have one form.

    Args:
        element: Form of each.
        least: Fewest elements.
        most: Most elements; None for no bound.
    """

    def __init__(self, element: Form[T], least: int = 0, most: int | None = None) -> None:
        self._element = element
        self._least = least
        self._most = most

    def decode(self, value: Json) -> tuple[T, ...]:
        if not isinstance(value, list) or len(value) < self._least:
            least = f" of at least {self._least} elements" if self._least else ""
            raise MisfitError.instead_of(f"an array{least}", value)
        if self._most is not None and len(value) > self._most:
            raise MisfitError.instead_of(f"an array of at most {self._most} elements", value)
        decode = self._element.decode
        decoded: list[T] = []
        try:
            for each in value:
                decoded.append(decode(each))
        except MisfitError as err:
            raise err.at(f"[{len(decoded)}]") from None
        return tuple(decoded)

    def encode(self, value: tuple[T, ...]) -> Json:
        encode = self._element.encode
        return [encode(each) for each in value]

    def schema(self, definitions: Definitions) -> Json:
        schema: Json = {"type": "array", "items": self._element.schema(definitions)}
        if self._least:
            schema["minItems"] = self._least
        if self._most is not None:
            schema["maxItems"] = self._most
        return schema


class Fixed(Form[tuple[Any, ...]]):
    """A tuple of a certain length, each element of which has its own form."""

    def __init__(self, elements: tuple[Form[Any], ...]) -> None:
        self._elements = elements

    def decode(self, value: Json) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != len(self._elements):
            raise MisfitError.instead_of(f"an array of {len(self._elements)} elements", value)
        decoded: list[Any] = []
        try:
            for element, each in zip(self._elements, value, strict=True):
                decoded.append(element.decode(each))
        except MisfitError as err:
            raise err.at(f"[{len(decoded)}]") from None
        return tuple(decoded)

    def encode(self, value: tuple[Any, ...]) -> Json:
        return [element.encode(each) for element, each in zip(self._elements, value, strict=True)]

    def schema(self, definitions: Definitions) -> Json:
        return {
            "type": "array",
            "prefixItems": [element.schema(definitions) for element in self._elements],
            "items": False,
            "minItems": len(self._elements),
        }


class Table(Form[dict[K, T]]):
    """A dictionary.

    Args:
        key: Form of the keys, which are texts in JSON.
        value: Form of the values.
    """

    def __init__(self, key: Form[K], value: Form[T]) -> None:
        self._key = key
        self._value = value

    def decode(self, value: Json) -> dict[K, T]:
        if not isinstance(value, dict):
            raise MisfitError.instead_of("an object", value)
        decoded = {}
        for name, each in value.items():
            try:
                decoded[self._key.decode(name)] = self._value.decode(each)
            except MisfitError as err:
                raise err.at(f".{name}") from None
        return decoded

    def encode(self, value: dict[K, T]) -> Json:
        return {self._key.encode(name): self._value.encode(each) for name, each in value.items()}

    def schema(self, definitions: Definitions) -> Json:
        return {
            "type": "object",
            "propertyNames": self._key.schema(definitions),
            "additionalProperties": self._value.schema(definitions),
        }


class OrNull(Form[T | None], Generic[T]):
    """A value, or null for None."""

    def __init__(self, form: Form[T]) -> None:
        self._form = form

    def decode(self, value: Json) -> T | None:
        return None if value is None else self._form.decode(value)

    def encode(self, value: T | None) -> Json:
        return None if value is None else self._form.encode(value)

    def schema(self, definitions: Definitions) -> Json:
        return {"anyOf": [{"type": "null"}, self._form.schema(definitions)]}


class Named(Form[T]):
    """A form with a definition of its own in the schema, to which others and itself can refer.

    Args:
        name: In the schema.
        form: May be given later, by `define`, where it refers to itself.
    """

    def __init__(self, name: str, form: Form[T] | None = None) -> None:
        self._name = name
        if form is not None:
            self.define(form)

    def define(self, form: Form[T]) -> None:
        """Says what it is."""
        self._form = form
        # What stands behind a name is not asked for it again for every value.
        self.decode = form.decode  # type: ignore[method-assign]
        self.encode = form.encode  # type: ignore[method-assign]

    def decode(self, value: Json) -> T:
        return self._form.decode(value)

    def encode(self, value: T) -> Json:
        return self._form.encode(value)

    def schema(self, definitions: Definitions) -> Json:
        if self._name not in definitions:
            # Before the form is asked, which may refer to this name.
            definitions[self._name] = {}
            definitions[self._name] = self._form.schema(definitions)
        return {"$ref": f"#/$defs/{self._name}"}


class Tagged(Form[T]):
    """One of several dataclasses, told apart by a field.

    Args:
        tag: Name of the field.
        records: By the field's text.
    """

    def __init__(self, tag: str, records: Mapping[str, Record[Any]]) -> None:
        self._tag = tag
        self._records = {
            name: record.with_constants({tag: name}) for name, record in records.items()
        }
        self._by_kind = {record.kind: record for record in self._records.values()}

    def decode(self, value: Json) -> T:
        name = value.get(self._tag) if isinstance(value, dict) else None
        if not isinstance(name, str):
            raise MisfitError.instead_of(f"an object with a {self._tag!r}", value)
        record = self._records.get(name)
        if record is None:
            raise MisfitError(f"has the unknown {self._tag} {abridged(name)}")
        decoded: T = record.decode(value)
        return decoded

    def encode(self, value: T) -> Json:
        return self._by_kind[type(value)].encode(value)

    def schema(self, definitions: Definitions) -> Json:
        return {
            "type": "object",
            "required": [self._tag],
            "oneOf": [record.schema(definitions) for record in self._records.values()],
        }
