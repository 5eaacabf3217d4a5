"""The executables that are not nodes: they read arguments, print, and exit."""
