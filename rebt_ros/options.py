"""Options of learning, by the name that programs outside the package know them by.

`../shared/closed_loop`, which judges learned trees by driving, imports `rebt_ros.options.Use`.
"""

from rebt_ros.learning.options import LearnOptions, Use

__all__ = ["LearnOptions", "Use"]
