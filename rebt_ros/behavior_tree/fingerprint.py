"""A short name for a document, by which nodes can tell each other which one they mean."""

from __future__ import annotations

import hashlib
from typing import Final

#: Hexadecimal digits: 64 bits, which nobody meets twice by chance.
_DIGITS: Final = 16


def fingerprint(document: str) -> str:
    """The first digits of the SHA-256 of a document's text.

    Example:
        >>> fingerprint("{}")
        '44136fa355b3678a'
    """
    data = document.encode("utf-8", errors="backslashreplace")
    return hashlib.sha256(data).hexdigest()[:_DIGITS]
