"""An inspection as one page that needs nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rebt_ros.drawing.html import page, paragraph, table, text
from rebt_ros.inspection.inspection import Inspected, Inspection
from rebt_ros.inspection.wording import HEADING, action_name, cells, findings_of, summary

#: Actions with a color of their own, the most frequent ones.
_COLORED: Final = 6
_STYLE: Final = """
:root { --action-1: #1f6fb4; --action-2: #e08a2c; --action-3: #2f9e6e; --action-4: #b04a8f;
  --action-5: #8a6d3b; --action-6: #5b5fc7; --action-7: #9aa5b1; }
@media (prefers-color-scheme: dark) { :root { --action-1: #5aa9e6; --action-2: #f0a958;
  --action-3: #5fce9c; --action-4: #e08cc6; --action-5: #cfae74; --action-6: #9fa3f5;
  --action-7: #6b7885; } }
td.bar { min-width: 16rem; width: 60%; } .bar span, .key { display: inline-block; height: 0.9rem; }
.bar { white-space: nowrap; font-size: 0; } .key { width: 0.9rem; margin: 0 0.4rem -0.1rem 0; }
li { list-style: none; display: inline-block; margin-right: 1.2rem; } ul { padding: 0; }
"""


def inspection_page(inspection: Inspection) -> str:
    """The page as HTML; everything that was read is escaped."""
    body = "\n".join([*_head(inspection), *_findings(inspection), *_actions(inspection)])
    return page("rebt_ros: demonstrations", body, _STYLE)


def _head(inspection: Inspection) -> Iterator[str]:
    several = inspection.several_channels
    yield "<h1>Demonstrations</h1>"
    yield paragraph(summary(inspection))
    for note in inspection.notes:
        yield paragraph(f"Note: {note}.", faded=True)
    lines = [cells(one, several=several) for one in inspection.demonstrations]
    yield table([HEADING, *lines], words=1)


def _findings(inspection: Inspection) -> Iterator[str]:
    yield "<h2>Worth a look</h2>"
    lines = [
        (one.name, finding)
        for one in inspection.demonstrations
        for finding in findings_of(one, inspection)
    ]
    if inspection.constant:
        lines = [("all", f"never vary: {', '.join(inspection.constant)}"), *lines]
    if lines:
        yield table([("demonstration", "finding"), *lines], words=1)
    else:
        yield paragraph("Nothing stands out.")


def _actions(inspection: Inspection) -> Iterator[str]:
    """A bar for each demonstration, with the share of each action."""
    colors = {
        (one.channel, one.action): min(place, _COLORED) + 1
        for place, one in enumerate(inspection.actions)
    }
    several = inspection.several_channels
    yield "<h2>Actions</h2>"
    keys = [
        f"<li>{_colored('key', place + 1, '')}{text(action_name(one, several=several))}</li>"
        for place, one in enumerate(inspection.actions[:_COLORED])
    ]
    if len(inspection.actions) > _COLORED:
        keys.append(f"<li>{_colored('key', _COLORED + 1, '')}others</li>")
    yield f"<ul>{''.join(keys)}</ul>"
    lines = "\n".join(
        f'<tr><td>{text(one.name)}</td><td class="bar">{_bar(one, colors)}</td></tr>'
        for one in inspection.demonstrations
    )
    yield f'<div class="wide"><table>\n<tbody>\n{lines}\n</tbody>\n</table></div>'


def _bar(inspected: Inspected, colors: dict[tuple[str, str], int]) -> str:
    shares: dict[int, int] = {}
    for one in inspected.actions:
        color = colors[one.channel, one.action]
        shares[color] = shares.get(color, 0) + one.rows
    return "".join(
        _colored("", color, f"width:{100 * rows / inspected.rows:.2f}%;")
        for color, rows in sorted(shares.items())
    )


def _colored(kind: str, color: int, style: str) -> str:
    return f'<span class="{kind}" style="{style}background:var(--action-{color})"></span>'
