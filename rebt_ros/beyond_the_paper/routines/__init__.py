"""Routines: Sequences and Repeaters of guarded steps, found in rows that share a state."""
