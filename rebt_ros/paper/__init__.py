"""The paper's algorithms, and nothing else: functions that read like its pseudo-code.

Algorithm 1
    `re_bt_espresso`, with BT-Espresso, the baseline, beside it; `rules` are its input.
Algorithm 2
    `lat_trees`: Sequences and Repeaters from the last action taken.
"""
