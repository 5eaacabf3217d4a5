"""Trials: an executor that drives with each candidate, and a world that judges."""
