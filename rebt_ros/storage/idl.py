"""Definitions of message types in IDL, as bags hold those of packages without `.msg` files.

They come from outside.  What is read are the parts of IDL that ROS 2 has: structs, constants and
names of types, in modules.  All else is passed over, so that a type which needs it is not known;
and each word is looked at once.
"""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from rosbags.interfaces import Nodetype

#: Constants and fields of a type, and a field's type, in the form of rosbags.
Definition: TypeAlias = tuple[list[tuple[str, str, Any]], list[tuple[str, Any]]]
_Type: TypeAlias = tuple[Nodetype, Any]

_WORD: Final = re.compile(
    # What is not closed ends somewhere all the same: nothing is looked at twice.
    r"""(?:\s|//[^\n]*|\#[^\n]*|/\*.*?(?:\*/|\Z))+"""
    r"""|("(?:[^"\\\n]|\\.)*"?|'(?:[^'\\\n]|\\.)*'?|[A-Za-z_]\w*|[0-9][\w.]*|::|.)""",
    re.DOTALL | re.ASCII,
)
_NAME: Final = re.compile(r"[A-Za-z_]\w*", re.ASCII)
#: Behind the name of a struct: the module of its constants.
_CONSTANTS: Final = "_Constants"
#: Most modules within each other; ROS 2 has three.
_DEEPEST: Final = 20
_BASES: Final = {
    "boolean": "bool",
    "octet": "octet",
    "char": "char",
    "float": "float32",
    "double": "float64",
    "short": "int16",
    "long": "int32",
    "long long": "int64",
    "unsigned short": "uint16",
    "unsigned long": "uint32",
    "unsigned long long": "uint64",
    "string": "string",
    "wstring": "wstring",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
#: What stands for a type that no message of ROS 2 has: no bag defines it.
_UNKNOWN: Final = (Nodetype.NAME, "")


def parse_idl(text: str) -> dict[str, Definition]:
    """The structs of a text, by their names, such as ``my_msgs/msg/Own``."""
    reader = _Reader([found[1] for found in _WORD.finditer(text) if found[1]])
    with contextlib.suppress(_EndError):
        reader.read()
    reader.give_constants()
    return reader.found


class _EndError(Exception):
    """The text ends amid something."""


@dataclass(slots=True)
class _Reader:
    """Reads words, one after the other."""

    words: list[str]
    place: int = 0
    found: dict[str, Definition] = field(default_factory=dict)
    _modules: list[str] = field(default_factory=list)
    _names: dict[str, _Type] = field(default_factory=dict)
    """Types by the names that they were given."""
    _constants: dict[str, tuple[str, int]] = field(default_factory=dict)

    def read(self) -> None:
        """Reads all definitions.

        Raises:
            _EndError: They end amid one.
        """
        while self.place < len(self.words):
            match self._next():
                case "module" if len(self._modules) < _DEEPEST:
                    self._modules.append(self._next())
                    self._skip_to("{")
                case "}" if self._modules:
                    self._modules.pop()
                case "@":
                    self._skip_annotation()
                case "typedef":
                    for name, its in self._declared():
                        self._names[self._full(name)] = its
                case "const":
                    self._read_constant()
                case "struct":
                    self._read_struct()
                case ";":
                    pass
                case _:
                    self._skip_definition()

    def give_constants(self) -> None:
        """Adds to each struct the whole numbers that the module of its constants names."""
        for full, (kind, value) in self._constants.items():
            module, _, name = full.rpartition("/")
            owner = module.removesuffix(_CONSTANTS)
            if owner != module and owner in self.found:
                self.found[owner][0].append((name, kind, value))

    def _next(self) -> str:
        if self.place >= len(self.words):
            raise _EndError
        self.place += 1
        return self.words[self.place - 1]

    def _is_next(self, word: str) -> bool:
        """Whether a word comes next, which is taken then."""
        if self.place < len(self.words) and self.words[self.place] == word:
            self.place += 1
            return True
        return False

    def _skip_to(self, word: str) -> None:
        while self._next() != word:
            pass

    def _skip_annotation(self) -> None:
        self._scoped_name()
        if self._is_next("("):
            depth = 1
            while depth:
                word = self._next()
                depth += (word == "(") - (word == ")")

    def _skip_definition(self) -> None:
        """Skips to the semicolon behind what is of no other kind, such as an enumeration."""
        self.place -= 1
        depth = 0
        while (word := self._next()) != ";" or depth > 0:
            depth += (word == "{") - (word == "}")

    def _full(self, name: str) -> str:
        return "/".join((*self._modules, name))

    def _scoped_name(self) -> str:
        """A name with its modules; it begins with a slash where nothing is left out before it."""
        name = "/" if self._is_next("::") else ""
        name += self._next()
        while self._is_next("::"):
            name += f"/{self._next()}"
        return name

    def _read_constant(self) -> None:
        node, about = self._type()
        kind = about[0] if node == Nodetype.BASE else ""
        name = self._next()
        self._skip_to("=")
        words = []
        while (word := self._next()) != ";":
            words.append(word)
        value = self._number("".join(words))
        if value is not None:
            self._constants[self._full(name)] = (kind, value)

    def _number(self, text: str) -> int | None:
        """A whole number, or the constant of that name."""
        with contextlib.suppress(ValueError):
            return int(text, 0) if len(text) <= len(str(-(1 << 64))) else None
        for outer in self._scopes(text.replace("::", "/")):
            if outer in self._constants:
                return self._constants[outer][1]
        return None

    def _scopes(self, name: str) -> list[str]:
        """What a name may be the name of, from the nearest module on."""
        if name.startswith("/"):
            return [name[1:]]
        return [
            "/".join((*self._modules[:depth], name)) for depth in range(len(self._modules), -1, -1)
        ]

    def _type(self) -> _Type:
        """The type that comes next, without the brackets of an array behind its name."""
        word = self._next()
        if word == "sequence":
            # ROS 2 has no sequences of arrays, or of sequences.
            self._skip_to("<")
            element = self._type() if not self._is_next("sequence") else _UNKNOWN
            self._skip_to(">")
            is_single = element[0] in (Nodetype.BASE, Nodetype.NAME)
            return (Nodetype.SEQUENCE, (element, 0)) if is_single else _UNKNOWN
        if word in ("string", "wstring"):
            if self._is_next("<"):
                self._skip_to(">")
            return Nodetype.BASE, (word, 0)
        while self._continues(word):
            word = f"{word} {self._next()}"
        if word in _BASES:
            return Nodetype.BASE, (_BASES[word], 0)
        self.place -= 1
        scopes = self._scopes(self._scoped_name())
        named = next((self._names[one] for one in scopes if one in self._names), None)
        if named is not None:
            return named
        known = next((one for one in scopes if one in self.found), None)
        # Of a name with its modules, the last one is the name from outside of all.
        return Nodetype.NAME, known or (scopes[-1] if "/" in scopes[-1] else scopes[0])

    def _continues(self, word: str) -> bool:
        """Whether the next word belongs to the type, too."""
        following = self.words[self.place] if self.place < len(self.words) else ""
        return f"{word} {following}" in _BASES

    def _declared(self) -> list[tuple[str, _Type]]:
        """Names of one type, up to the semicolon."""
        kind = self._type()
        declared = []
        while True:
            name, its = self._next(), kind
            while self._is_next("["):
                size = self._next()
                self._skip_to("]")
                count = self._number(size)
                is_single = its[0] in (Nodetype.BASE, Nodetype.NAME)
                # ROS 2 has arrays of one dimension.
                its = (Nodetype.ARRAY, (its, count)) if is_single and count else _UNKNOWN
            declared.append((name, its if _NAME.fullmatch(name) else _UNKNOWN))
            if self._is_next(";"):
                return declared
            self._skip_to(",")

    def _read_struct(self) -> None:
        name = self._full(self._next())
        if self._is_next(";"):
            return
        fields: list[tuple[str, Any]] = []
        if not self._is_next("{"):
            # What it inherits is not known here.
            fields.append(("", _UNKNOWN))
            self._skip_to("{")
        while not self._is_next("}"):
            if self._is_next("@"):
                self._skip_annotation()
            else:
                fields += self._declared()
        self.found.setdefault(name, ([], fields))
