"""The short form of `make fuzz`: always the same inputs, a few thousand of them."""

from __future__ import annotations

import time
from pathlib import Path
from random import Random

import pytest
from fuzz import campaign, mutation
from fuzz.target import NAMES, Target, target

from rebt_ros.errors import LONGEST_MESSAGE, InputError, RebtError

SEED = 20261122

#: So that all of them together take some seconds.
INPUTS = {
    "documents": 1500,
    "recordings": 500,
    "tables": 500,
    "experiments": 500,
    "bags": 80,
    "robot_bags": 25,
}


def test_every_target_has_a_short_form() -> None:
    assert INPUTS.keys() == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_mutated_input_is_taken_or_refused_with_one_sentence(name: str, tmp_path: Path) -> None:
    outcome = campaign.run(target(name, tmp_path), SEED, range(INPUTS[name]))
    assert outcome.failures == []
    assert outcome.accepted + outcome.refused == outcome.inputs == INPUTS[name]
    # Input that is always taken, or always refused at the first look, would show little.
    assert outcome.accepted > 0
    # Of bags whatever can be read is read.
    assert outcome.refused > (0 if name.endswith("bags") else outcome.accepted)


def test_mutated_documents_do_not_disturb_a_running_executor(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    from fuzz import executor

    outcome = executor.run(tmp_path, SEED, range(150))
    assert outcome.failures == []
    assert outcome.inputs == 150
    assert outcome.refused > 80
    assert outcome.accepted > 5


def _outcome_of(read: object) -> campaign.Outcome:
    return campaign.run(Target("made up", Random.random, read), 0, range(3))  # type: ignore[arg-type]


def _raise(error: Exception) -> None:
    raise error


def _busy(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


@pytest.mark.parametrize(
    "read",
    [
        lambda _: 1 / 0,
        lambda _: _raise(MemoryError()),
        lambda _: _raise(InputError("no full stop")),
        lambda _: _busy(0.3),
    ],
    ids=["a crash", "no memory", "no sentence", "a hang"],
)
def test_the_fuzzer_notices(read: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "LONGEST", 0.2)
    assert _outcome_of(read).failed == 3
    assert not _outcome_of(lambda _: None).failed


def test_a_pause_of_the_machine_is_no_hang(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "LONGEST", 0.2)
    pauses = iter([0.3])
    assert not _outcome_of(lambda _: _busy(next(pauses, 0.0))).failed


def test_the_same_seed_makes_the_same_inputs(tmp_path: Path) -> None:
    documents = target("documents", tmp_path)
    made = [
        [documents.make(campaign.generator("documents", seed, one)) for one in range(50)]
        for seed in (1, 1, 2)
    ]
    assert made[0] == made[1]
    assert made[0] != made[2]
    assert len(set(made[0])) > 45


@pytest.mark.parametrize("text", [*mutation.TEXTS, "x" * 10**6, "\n".join("lines")])
def test_an_error_is_one_printable_line_whatever_it_mentions(text: str) -> None:
    message = str(RebtError(f"{text} is wrong: do otherwise."))
    assert message.isprintable()
    message.encode()
    assert len(message) <= 10 * LONGEST_MESSAGE
    assert message.endswith(" is wrong: do otherwise.")
