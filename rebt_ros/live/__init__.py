"""What the nodes do without ROS: pair, record, learn in a process, take over, judge states."""
