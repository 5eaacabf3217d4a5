"""Trees judged by driving: who drives when, what is made of it, and who wins.

candidate
    A learned tree that is to be judged, with the name that a person knows it by.
episode
    One attempt at the task, from its start to success or failure.  Episodes are numbered from 0;
    where the world can be told its start, equal numbers mean equal starts for all candidates.
tally
    How many episodes succeeded, of how many.
round
    All that takes part drives up to the same number of episodes; some then leave.
trial
    The rounds from first to last, and the winner of the last one.
"""
