"""``ros2 run rebt_ros suggest-rules INPUT...``: what was never shown, as rules to choose from."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from rebt_ros.commands.shell import add_input_options, input_options, parse, run
from rebt_ros.demonstration.table import tabulate
from rebt_ros.storage.inputs import load
from rebt_ros.verification.suggesting_rules import SuggestedRule, suggested_rules


def main(arguments: list[str] | None = None) -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="suggest-rules",
        description="Prints what the demonstrations never did as rules, the strongest first. "
        "Keep those that must hold in a rules file for check, the learner and the "
        "executor.",
    )
    parser.add_argument(
        "--most",
        type=int,
        default=10,
        metavar="N",
        help="maximum number of rules per channel (default: %(default)s)",
    )
    add_input_options(parser)
    parsed = parse(parser, arguments)
    run(lambda: _suggest(parsed), "suggest-rules")


def _suggest(parsed: argparse.Namespace) -> None:
    paths = tuple(map(Path, parsed.inputs))
    tables = tabulate(load(paths, input_options(parsed)).demonstrations)
    rules = [rule for table in tables for rule in suggested_rules(table, max(parsed.most, 0))]
    print("\n".join(_lines(rules, several=len(tables) > 1)))


def _lines(rules: Sequence[SuggestedRule], *, several: bool) -> Iterator[str]:
    if not rules:
        yield "# Every action was shown all over the place: there is nothing to suggest."
        yield "rules: []"
        return
    yield "rules:"
    for rule in rules:
        margin = f", by {rule.margin:.1%} of its values" if rule.margin else ""
        rows = f"{rule.support} of {rule.rows} rows"
        yield f"  # Never shown in {rows}, which have other actions{margin}."
        yield f"  - never: {_scalar(rule.action)}"
        if several:
            yield f"    channel: {_scalar(rule.channel)}"
        yield f"    when: {_scalar(rule.when)}"


def _scalar(text: str) -> str:
    """A text as YAML has it."""
    plain = text.isascii() and text[:1].isalpha() and not set(text) & set(":#'\"\\{}[],&*!|%@`\n")
    return text if plain and text == text.strip() else json.dumps(text, ensure_ascii=False)


if __name__ == "__main__":
    main()
