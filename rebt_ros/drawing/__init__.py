"""Whatever is drawn: behavior trees and decision trees as text, DOT, SVG and PNG, and plots.

matplotlib makes the PNG files and the plot.  It is optional: without it `PictureError` says how to
get it, and all other pictures are made.
"""
