"""A seeded fuzzer: mutated input for every reader of the package, and for a running executor.

mutation
    What is done to bytes, to text and to JSON values.
corpus
    The valid inputs that mutation starts from.
target
    A reader, and how an input for it is made.
campaign
    Many inputs for one target, in a process that is watched.

Every input follows from the seed and its number, so that whatever is found can be made again:
``python -m fuzz --seed 7 --target documents --first 4711 --inputs 1``.
"""
