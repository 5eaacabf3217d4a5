"""Parameter files that are not about the node that was started with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from rebt_ros.ros.parameter_files import without_effect


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/**:\n  ros__parameters: {rate: 1.0}\n", None),
        ("\ufeff/**:\n  ros__parameters: {rate: 1.0}\n", None),
        ("/robot1/recorder:\n  ros__parameters: {rate: 1.0}\n", None),
        ("robot1/recorder:\n  ros__parameters: {rate: 1.0}\n", None),
        ("robot1:\n  recorder:\n    ros__parameters: {rate: 1.0}\n", None),
        ("/*/recorder:\n  ros__parameters: {rate: 1.0}\n", None),
        ("/**/recorder:\n  ros__parameters: {rate: 1.0}\n", None),
        ("/**:\n  recorder:\n    ros__parameters: {rate: 1.0}\n", None),
        ("recorder:\n  ros__parameters: {rate: 1.0}\n", "there are some for /recorder"),
        ("/*:\n  ros__parameters: {rate: 1.0}\n", "there are some for /*"),
        ("robot1/recoder:\n  ros__parameters: {rate: 1.0}\n", "some for /robot1/recoder"),
        ("/**:\n  ros__parameters: {}\n", "no parameters for /robot1/recorder, so"),
        ("", "no parameters for /robot1/recorder, so"),
        ("{", None),
    ],
)
def test_a_file_without_parameters_for_the_node_is_named(
    tmp_path: Path, text: str, said: str | None
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(text, encoding="utf-8")
    arguments = ["recorder", "--ros-args", "--params-file", str(file)]
    sentences = list(without_effect(arguments, "/robot1/recorder"))
    assert len(sentences) == (said is not None)
    if said is not None:
        assert said in sentences[0]
        assert "/robot1/recorder:" in sentences[0]


def test_a_file_that_cannot_be_read_is_left_to_ros(tmp_path: Path) -> None:
    arguments = ["recorder", "--ros-args", "--params-file", str(tmp_path / "none.yaml")]
    assert list(without_effect(arguments, "/recorder")) == []
