"""The learner: demonstrations in, a behavior tree out."""
