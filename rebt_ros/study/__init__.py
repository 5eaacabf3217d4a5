"""The paper's evaluation (IV): simulate, learn all pruning levels, compare with the simulated tree.

simulated subtree
    What stands under the root of a simulated tree.
generated subtree
    What stands under the root of a learned tree, or a suggestion.
mode
    A way to make generated subtrees: BT-Espresso, RE:BT-Espresso as printed, or our default.
score
    How near the generated subtrees of a mode come to a simulated subtree.
"""
