"""A learned tree in the languages of other behavior tree engines."""
