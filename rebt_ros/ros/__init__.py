"""Thin shells over the core: the nodes.  Only this package and commands import rclpy."""
