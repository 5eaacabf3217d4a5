"""The executables that are not nodes: they read arguments, print, and exit."""

import sys

from rebt_ros import streams

# py_trees cannot be imported where a stream is closed, and commands import it before they begin.
if None in (sys.stdout, sys.stderr):
    streams.prepare()
