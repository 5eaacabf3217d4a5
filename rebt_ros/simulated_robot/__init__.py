"""A simulated robot to show, learn and test behavior on, without ROS.

world
    A walled room with round obstacles, a goal and a charging dock.
start
    A number from which a pose and a battery level follow; equal numbers give equal starts.
state
    What the robot measures: a tuple of named floats, none of them a coordinate in the room.
action
    A word that the robot obeys for one time step.
policy
    A function from a state to an action, or to None when it has nothing to say.
run
    From a start until the goal is reached, the battery is empty or the time is up.
"""
