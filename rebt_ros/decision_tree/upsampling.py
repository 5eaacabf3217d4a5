"""Ways to add rows of rare actions."""

from __future__ import annotations

from enum import Enum


class Upsampling(Enum):
    """Which rows a decision tree is fitted to besides the shown ones."""

    NONE = "none"
    SVM_SMOTE = "svm-smote"
