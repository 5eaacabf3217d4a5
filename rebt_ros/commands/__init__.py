"""The executables that are not nodes: they read arguments, print, and exit."""

import resource
import sys

from rebt_ros import streams

#: With less address space (bytes), numpy and its like end in any way while they are imported.
LEAST_ADDRESS_SPACE = 500_000 * 1024

# py_trees cannot be imported where a stream is closed, and commands import it before they begin.
if None in (sys.stdout, sys.stderr):
    streams.prepare()

_limit, _ = resource.getrlimit(resource.RLIMIT_AS)
if 0 <= _limit < LEAST_ADDRESS_SPACE:
    sys.exit(
        f"the address space is limited to {_limit // 1024} kB, which is too little to begin with: "
        "raise the limit to 1000000 kB or more (ulimit -v)."
    )
