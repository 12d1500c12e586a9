"""Closed-form fit of the affine part: weighted least squares of the defects on the features."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def affine(features: Array, defects: Array, ridge: float = 1e-12) -> Array:
    """(16, k) weights W that minimise |defects - features W^T|^2, each column scaled to unit size, with a small ridge.

    features (n, k), defects (n, 16). The ridge is relative to the scaled features: it only settles directions that the data leave open.
    """
    scale = np.sqrt((features**2).mean(axis=0))
    scale[scale == 0] = 1.0
    target = np.sqrt((defects**2).mean(axis=0))
    target[target == 0] = 1.0
    x = features / scale
    rows = np.concatenate([x, np.sqrt(ridge * len(x)) * np.eye(x.shape[1])])
    right = np.concatenate([defects / target, np.zeros((x.shape[1], defects.shape[1]))])
    weights = np.linalg.lstsq(rows, right, rcond=None)[0]
    return np.ascontiguousarray((weights / scale[:, None] * target).T)


def relative_residual(prediction: Array, defects: Array) -> Array:
    """(16,) rms of what is left of each state's defect, relative to the defect."""
    size = np.sqrt((defects**2).mean(axis=0))
    size[size == 0] = 1.0
    return np.sqrt(((prediction - defects) ** 2).mean(axis=0)) / size
