"""Every tree that was published, so that the one before can be published again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from rebt_ros.errors import InputError, RebtError
from rebt_ros.storage.atomic import StorageError, write_text_atomically
from rebt_ros.storage.text import read_text

_SUFFIX: Final = ".json"
_UNDONE: Final = ".undone"


class TreeVersions:
    """Trees in a directory, numbered as they were published.

    Args:
        directory: Is made when it is needed.
        most: How many are kept, the newest ones; at least 2.
    """

    def __init__(self, directory: Path, most: int) -> None:
        self._directory = directory
        self._most = most

    def keep(self, document: str, put: Callable[[str], object] = lambda document: None) -> Path:
        """Adds a tree that is published; one that is the newest already is not added again.

        Args:
            document: The tree.
            put: Puts it where it is used; where that fails it is not added.

        Raises:
            StorageError: It cannot be written, or an old one not be removed.
        """
        numbered = self._numbered()
        if numbered and self._text(numbered[-1]) == document:
            put(document)
            return numbered[-1]
        number = max((_number(one) for one in self._all()), default=0) + 1
        path = self._directory / f"{number:06}{_SUFFIX}"
        self._tidy()
        write_text_atomically(path, document)
        try:
            put(document)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        return path

    def _tidy(self) -> None:
        """Makes room for another one."""
        old = [*self._numbered()[: 1 - self._most], *self._all(_UNDONE)[: -self._most]]
        try:
            for one in old:
                one.unlink(missing_ok=True)
        except OSError as err:
            raise StorageError(
                f"{self._directory} cannot be tidied ({err.strerror or err}): see that you may "
                "write there."
            ) from err

    def go_back(self, accept: Callable[[str], object] = lambda document: None) -> tuple[Path, str]:
        """Takes the newest one out, which stays as a file, and returns the one before it.

        Args:
            accept: Raises an error if it does not accept the one before, or cannot put it in
                place, and nothing is changed.

        Raises:
            InputError: There is none before it, or it cannot be read or is not accepted.
            StorageError: The newest one cannot be taken out.
        """
        numbered = self._numbered()
        if len(numbered) < 2:
            raise InputError(f"there is no tree before this one in {self._directory}.")
        document = self._accepted(numbered[-2], accept)
        try:
            numbered[-1].rename(numbered[-1].with_suffix(f"{_SUFFIX}{_UNDONE}"))
        except OSError as err:
            raise StorageError(
                f"{numbered[-1]} cannot be renamed ({err.strerror or err}), and stays the newest "
                "tree: name a place where you may write."
            ) from err
        return numbered[-2], document

    def newest(self, accept: Callable[[str], object] = lambda document: None) -> tuple[Path, str]:
        """The newest one, where none is published; see `go_back`.

        Raises:
            InputError: There is none, or it cannot be read or is not accepted.
            StorageError: It cannot be put in place.
        """
        numbered = self._numbered()
        if not numbered:
            raise InputError(f"there is no tree in {self._directory}.")
        return numbered[-1], self._accepted(numbered[-1], accept)

    def _accepted(self, path: Path, accept: Callable[[str], object]) -> str:
        try:
            document = read_text(path)
            accept(document)
        except StorageError:
            raise
        except RebtError as err:
            raise InputError(
                f"{path} is not published again: {err} To go back further, remove it."
            ) from err
        return document

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return bool(self._numbered())

    def _numbered(self) -> list[Path]:
        return self._all(_SUFFIX)

    def _all(self, suffix: str = "") -> list[Path]:
        if not self._directory.is_dir():
            return []
        return sorted(
            path
            for path in self._directory.iterdir()
            if path.name.split(".")[0].isdecimal() and path.name.endswith(suffix)
        )

    def _text(self, path: Path) -> str:
        try:
            return read_text(path)
        except InputError:
            return ""


def _number(path: Path) -> int:
    return int(path.name.split(".")[0])
