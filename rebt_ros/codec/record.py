"""Forms of dataclasses: JSON objects with certain fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final, Generic

from rebt_ros.codec.form import Definitions, Form, Json, MisfitError, T, abridged

#: Default of a field that must be there.
REQUIRED: Final = object()


@dataclass(frozen=True, slots=True)
class Field(Generic[T]):
    """A field of a JSON object.

    Where a record is derived from a dataclass, what is None here is taken from its type hints.
    """

    name: str
    """In JSON."""
    form: Form[Any] | None = None
    attribute: str | None = None
    """Of the value, and the argument that makes it; None for the same name."""
    get: Callable[[T], Any] | None = None
    """What stands there; None for the attribute."""
    default: object = REQUIRED
    """What the value has where the field is absent."""
    omitted: bool = False
    """Whether the field is left out where it has the default."""
    description: str = ""
    """For the schema."""

    @property
    def argument(self) -> str:
        """The argument that makes the value."""
        return self.attribute or self.name


class Record(Form[T]):
    """A JSON object that stands for a value of one class.

    Args:
        kind: The class.
        fields: In the order in which they are written; each with a form.
        make: Makes the value of the fields' arguments; None for the class itself.
        constants: Fields that always have the same value, written first.
        rules: Further parts of the schema.
        tolerant: Whether unknown fields are passed over instead of refused.
    """

    def __init__(
        self,
        kind: type[T],
        fields: tuple[Field[T], ...],
        *,
        make: Callable[..., T] | None = None,
        constants: Mapping[str, Json] | None = None,
        rules: Mapping[str, Json] | None = None,
        tolerant: bool = False,
    ) -> None:
        self.kind = kind
        self._make: Callable[..., T] = make or kind
        self._fields = fields
        self._constants = dict(constants or {})
        self._rules = dict(rules or {})
        self._tolerant = tolerant
        self._decoders = {field.name: (field.argument, _form(field).decode) for field in fields}
        self._encoders = tuple(
            (
                field.name,
                field.get or attrgetter(field.argument),
                _form(field).encode,
                field.omitted,
                field.default,
            )
            for field in fields
        )
        self._required = (
            *self._constants,
            *(field.name for field in fields if field.default is REQUIRED),
        )
        self._known = frozenset((*self._constants, *self._decoders))

    def with_constants(self, constants: Mapping[str, Json]) -> Record[T]:
        """The same with further constants before its own."""
        return Record(
            self.kind,
            self._fields,
            make=self._make,
            constants={**constants, **self._constants},
            rules=self._rules,
            tolerant=self._tolerant,
        )

    def decode(self, value: Json) -> T:
        if not isinstance(value, dict):
            raise MisfitError.instead_of("an object", value)
        for name in self._required:
            if name not in value:
                raise MisfitError(f"lacks {name!r}")
        arguments = {}
        decoders, constants = self._decoders, self._constants
        for name, each in value.items():
            found = decoders.get(name)
            if found is not None:
                argument, decode = found
                try:
                    arguments[argument] = decode(each)
                except MisfitError as err:
                    raise err.at(f".{name}") from None
            elif name in constants:
                if each != constants[name]:
                    raise MisfitError.instead_of(repr(constants[name]), each).at(f".{name}")
            elif not self._tolerant:
                raise MisfitError(f"has the unknown field {abridged(name)}")
        return self._make(**arguments)

    def encode(self, value: T) -> Json:
        encoded = dict(self._constants)
        for name, get, encode, omitted, default in self._encoders:
            its = get(value)
            if not (omitted and its == default):
                encoded[name] = encode(its)
        return encoded

    def schema(self, definitions: Definitions) -> Json:
        properties: Json = {name: {"const": constant} for name, constant in self._constants.items()}
        for field in self._fields:
            about = {"description": field.description} if field.description else {}
            properties[field.name] = about | _form(field).schema(definitions)
        schema: Json = {
            "type": "object",
            "properties": properties,
            "required": list(self._required),
        }
        if not self._tolerant:
            schema["additionalProperties"] = False
        return schema | self._rules


def _form(field: Field[Any]) -> Form[Any]:
    if field.form is None:
        raise TypeError(f"the field {field.name!r} has no form")
    return field.form
