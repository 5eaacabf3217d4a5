"""Thin shells over the core: the three nodes.  Only this package and commands import rclpy."""
