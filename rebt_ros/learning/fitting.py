"""Options of decision trees, from those of learning."""

from __future__ import annotations

from rebt_ros.decision_tree.encoding import Vocabulary
from rebt_ros.decision_tree.training import FitOptions
from rebt_ros.learning.options import LearnOptions


def fit_options(options: LearnOptions, vocabulary: Vocabulary) -> FitOptions:
    """How to fit a tree with a vocabulary."""
    return FitOptions(vocabulary, options.max_depth, options.random_state, options.upsample)
