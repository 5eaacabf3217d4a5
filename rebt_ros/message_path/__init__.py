"""Message paths: where in a message a feature is, such as ``/odom.pose.pose.position.x``.

The syntax is Foxglove's message path, with a few additions of ours (docs/message_paths.md).  A path
is parsed once (`parsing`), checked against the definition of the message (`checking`) and compiled
to a getter (`compiling`), which reads attributes and nothing else.

path
    A topic and the parts behind it: fields, indices, slices, filters and functions (`path`).
definition
    The fields and constants of a message type, wherever they come from (`definition`).
shape
    What a path leads to: a record (a message within a message), an array, or a value (`shapes`).
missing
    A path that leads nowhere in this message, such as beyond the end of an array, has no value.
"""
