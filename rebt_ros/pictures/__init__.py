"""Pictures of decision trees, PNG files of any picture, and the plot of all pruning levels.

matplotlib makes the PNG files and the plot.  It is optional: without it `PictureError` says how to
get it, and all other pictures are made.
"""
