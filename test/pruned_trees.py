"""Decision trees, fitted and pruned in one call."""

from __future__ import annotations

from rebt_ros.decision_tree.encoding import FEATURES_ALONE, Vocabulary
from rebt_ros.decision_tree.fitted import TrainedTree
from rebt_ros.decision_tree.training import FitOptions, fit
from rebt_ros.decision_tree.upsampling import Upsampling
from rebt_ros.demonstration.table import DemonstrationTable


def train(
    table: DemonstrationTable,
    *,
    vocabulary: Vocabulary = FEATURES_ALONE,
    max_depth: int | None = None,
    ccp_alpha: float = 0.0,
    random_state: int = 0,
    upsample: Upsampling = Upsampling.NONE,
) -> TrainedTree:
    """Fits a decision tree and prunes it at `ccp_alpha`; see `fit`."""
    fitted = fit(
        table,
        FitOptions(
            vocabulary=vocabulary, max_depth=max_depth, random_state=random_state, upsample=upsample
        ),
    )
    return fitted.at(ccp_alpha)
