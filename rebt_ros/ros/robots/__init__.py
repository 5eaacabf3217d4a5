"""Robots to try everything on: the simulated one, its demonstrator, and the synthetic one."""
