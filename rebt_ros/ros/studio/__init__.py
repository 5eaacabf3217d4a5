"""The studio: a node, and the web server through which browsers see the robot and steer it."""
