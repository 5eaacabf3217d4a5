"""The studio without ROS and without a web server: what browsers show, and what people change."""
