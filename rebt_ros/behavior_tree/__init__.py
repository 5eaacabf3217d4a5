"""What is learned: the behavior tree as data, and the views of that one value."""
