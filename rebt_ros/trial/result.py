"""What a trial found, as a table, as sentences and as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from rebt_ros.trial.candidates import Candidate
from rebt_ros.trial.halving import Standing
from rebt_ros.trial.outcome import Episode
from rebt_ros.trial.tally import CONFIDENCE, Interval

HEAD: Final = ("", "nodes", "agreement", "success", "episodes", f"{CONFIDENCE:.0%} interval")


@dataclass(frozen=True, slots=True)
class TrialResult:
    """What is known of all candidates, be it that the trial is over or was interrupted."""

    candidates: tuple[Candidate, ...]
    episodes: tuple[tuple[Episode, ...], ...]
    """Of each candidate, in their order."""
    standings: tuple[Standing, ...]
    """From best to worst."""
    rounds: tuple[int, ...]
    winner: int | None
    """None where it was interrupted."""

    @property
    def driven(self) -> int:
        """Episodes of all candidates."""
        return sum(map(len, self.episodes))


def table(result: TrialResult) -> list[tuple[str, ...]]:
    """A row per candidate from best to worst, below `HEAD`."""
    return [HEAD, *(_row(result, standing) for standing in result.standings)]


def verdict(result: TrialResult) -> str:
    """Who won and how sure that is."""
    if result.winner is None:
        return f"The trial was interrupted after {result.driven} episodes: there is no winner."
    best, *others = result.standings
    name = result.candidates[best.candidate].name
    tally = best.tally
    sentence = (
        f"{name} wins: {tally.successes} of {tally.episodes} episodes succeeded "
        f"({HEAD[-1]} {_percent(tally.interval)})."
    )
    rivals = [
        other
        for other in others
        if other.round == best.round and not tally.surely_above(other.tally)
    ]
    if not rivals:
        return sentence
    names = ", ".join(result.candidates[rival.candidate].name for rival in rivals)
    level = all(rival.tally == tally for rival in rivals)
    why = "none of these is smaller" if level else "more episodes would tell"
    return f"{sentence} So few episodes do not tell it from {names}: {why}."


def as_json(result: TrialResult) -> dict[str, Any]:
    """All of it, for scripts."""
    return {
        "rounds": list(result.rounds),
        "episodes": result.driven,
        "winner": None if result.winner is None else str(result.candidates[result.winner].path),
        "confidence": CONFIDENCE,
        "candidates": [_entry(result, standing) for standing in result.standings],
    }


def _row(result: TrialResult, standing: Standing) -> tuple[str, ...]:
    candidate, tally = result.candidates[standing.candidate], standing.tally
    return (
        candidate.name,
        str(candidate.nodes),
        "-" if candidate.agreement is None else f"{candidate.agreement:.1%}",
        "-" if tally.share is None else f"{tally.share:.0%}",
        f"{tally.successes}/{tally.episodes}",
        "-" if tally.share is None else _percent(tally.interval),
    )


def _percent(interval: Interval) -> str:
    return f"{interval.low:.0%} to {interval.high:.0%}"


def _entry(result: TrialResult, standing: Standing) -> dict[str, Any]:
    candidate, tally = result.candidates[standing.candidate], standing.tally
    return {
        "name": candidate.name,
        "path": str(candidate.path),
        "nodes": candidate.nodes,
        "own_history_agreement": candidate.agreement,
        "successes": tally.successes,
        "episodes": tally.episodes,
        "success": tally.share,
        "interval": list(tally.interval),
        "round": standing.round + 1,
        "outcomes": [_outcome(episode) for episode in result.episodes[standing.candidate]],
    }


def _outcome(episode: Episode) -> dict[str, Any]:
    return {
        "success": episode.success,
        "seconds": round(episode.seconds, 3),
        "ending": episode.ending.value,
        "start": episode.start,
    }
