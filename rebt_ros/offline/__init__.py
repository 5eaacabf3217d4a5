"""Learning from files and replay over files, and the files that are written."""
