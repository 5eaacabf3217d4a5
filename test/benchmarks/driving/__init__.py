"""How many demonstrations does it take?  What was learned drives, beside what plain learners reach.

task
    Something to do in a simulated world, with an expert who can do it.
episode
    One run of a task, from its start to success or failure.  Its seed makes it: equal seeds and
    actions make equal episodes.
set
    A number for a sequence of demonstrations.  They are nested: the first of n + 1 are those of n.
fresh episodes
    Those that a method is judged on, equal for all methods, so that methods can be compared in
    pairs.  Nobody ever shows them.
cell
    What one method makes of n demonstrations of one set of one task, and how that drives.
expert's success
    Of the fresh episodes, when the expert drives.  Demonstrations are only its successful runs.

Imports run from `__main__` down: `running` and `corrections` use `cells`, `methods` and
`demonstrating`, which use `episodes` and `task`; `report` and `plot` know results only.
"""
