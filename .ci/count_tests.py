"""Counts the tests of a JUnit XML file and prints one line: ``N passed, N failed``.

The exit code is 1 when a test failed or none ran: a run without tests shows nothing.
"""

import sys
from pathlib import Path
from xml.etree import ElementTree


def main(path: Path) -> int:
    """Print the counts of `path`; a file that is missing or unreadable counts as one failure."""
    try:
        cases = list(ElementTree.parse(path).iter("testcase"))
    except (OSError, ElementTree.ParseError) as err:
        sys.stderr.write(f"{path} has no test results: {err}\n")
        sys.stdout.write("0 passed, 1 failed\n")
        return 1
    # A case whose test and tear-down both fail has two children, and some cases come twice.
    outcomes = {(case.get("classname"), case.get("name")): "passed" for case in cases}
    for case in cases:
        key = (case.get("classname"), case.get("name"))
        tags = {child.tag for child in case}
        if tags & {"failure", "error"}:
            outcomes[key] = "failed"
        elif "skipped" in tags and outcomes[key] == "passed":
            outcomes[key] = "skipped"
    counts = {name: list(outcomes.values()).count(name) for name in ("passed", "failed", "skipped")}
    line = f"{counts['passed']} passed, {counts['failed']} failed"
    if counts["skipped"]:
        line += f", {counts['skipped']} skipped"
    sys.stdout.write(line + "\n")
    return 1 if counts["failed"] or not counts["passed"] else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
