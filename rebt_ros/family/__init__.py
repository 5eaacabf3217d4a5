"""The family of a learned tree: one tree for every pruning level, with its figures and files."""
