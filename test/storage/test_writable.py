"""Why nothing can be written to a directory, before there is something to write."""

from __future__ import annotations

from pathlib import Path

import pytest

from rebt_ros.storage import writable as module
from rebt_ros.storage.writable import WritableDirectory


def test_what_is_there_and_what_can_be_made_is_writable_and_stays_as_it_was(tmp_path: Path) -> None:
    writable = WritableDirectory()
    for directory in (tmp_path, tmp_path / "a" / "b", tmp_path):
        assert writable.why_not(directory) == ""
        assert writable.why_not(directory) == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ("file", "Not a directory"),
        ("file/below", "{there}/file: Not a directory"),
        ("dangling", "No such file or directory"),
        ("/proc/rebt_ros", "/proc: "),
    ],
)
def test_what_cannot_be_written_is_said_until_it_can(
    place: str, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    writable = WritableDirectory()
    assert writable.why_not(tmp_path) == ""
    said = writable.why_not(tmp_path / place)
    wanted = reason.format(there=tmp_path)
    assert said.startswith(f"nothing can be written to {tmp_path / place} ({wanted}")
    (tmp_path / "file").unlink()
    (tmp_path / "nowhere").mkdir()
    assert bool(writable.why_not(tmp_path / place)) == place.startswith("/proc")


def test_a_disk_that_has_become_full_is_found_where_it_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(**_: object) -> None:
        raise OSError(28, "No space left on device")

    writable = WritableDirectory()
    assert writable.why_not(tmp_path) == ""
    with monkeypatch.context() as patch:
        patch.setattr(module.tempfile, "TemporaryFile", full)
        assert writable.why_not(tmp_path) == ""
        assert "No space left on device" in writable.why_not(tmp_path, again=True)
    assert writable.why_not(tmp_path, again=True) == ""
