"""From a table to a learned tree: options, judging, choice, levels, suggestions, and replay.

The front door is `pipeline.learn`.
"""
