"""Names for the numpy arrays that pass between modules, and how to go through large ones."""

from collections.abc import Iterator
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
Float32Array: TypeAlias = npt.NDArray[np.float32]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
#: Bits of sets, 64 to a word.
WordArray: TypeAlias = npt.NDArray[np.uint64]

#: Rows that are looked at at a time.
_ROWS_AT_A_TIME: Final = 65_536


def in_parts(rows: int) -> Iterator[slice]:
    """Stretches of so many rows, for who must not hold a large table a second time."""
    for start in range(0, rows, _ROWS_AT_A_TIME):
        yield slice(start, min(start + _ROWS_AT_A_TIME, rows))
