"""The executor: a behavior tree and live topics in, commands out."""
