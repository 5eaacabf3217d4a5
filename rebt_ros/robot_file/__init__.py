"""The robot file: where features and actions are in the messages of a robot (docs/robot_file.md).

robot file
    What a user writes, once (`robot_file`); YAML, read with bounds (`text`, `reading`).
binding
    A robot file with the types of its topics: everything in it is known to be there (`binding`).
source of actions
    A topic whose messages say what is done; a label is made of them by its labeller (`labelling`).
"""
