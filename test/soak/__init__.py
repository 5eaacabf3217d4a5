"""The soak: recorder, learner, executor and a robot, as real processes under load and faults.

robot
    A process that publishes states and a demonstrator's actions, and hears the commands.
fleet
    The nodes: started, killed, stopped, and watched for memory, exit codes and tracebacks.
ledger
    What must not get lost, and what did.
recordings
    What the recorder has left, row by row.
faults
    What is done to the nodes, one thing after the other.
campaign
    A soak from start to end.
"""
