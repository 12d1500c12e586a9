"""Closed-form fit of the affine part: weighted least squares of the defects on the features."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def affine(features: Array, defects: Array, ridge: float = 1e-12) -> Array:
    """(states, k) weights W that minimise |defects - features W^T|^2, each column scaled to unit size, with a small ridge.

    features (n, k), defects (n, states). The ridge is relative to the scaled features: it only settles directions that the data leave open.
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


ROUNDS, KNEE = 4, 4.0


def robust(features: Array, defects: Array, ridge: float = 1e-12, watched: tuple[int, ...] = ()) -> Array:
    """(states, k) as `affine`, with little weight on the few steps that no affine map can follow: corners of the torque law, the start.

    Least squares repeated with the weights of Huber's loss: 1 / sqrt(1 + (r / KNEE)^2), r the largest residual of the outputs `watched`
    (all where empty) in units of their medians. Plain least squares lets those steps decide: its errors scatter with the seed of
    the samples by a factor of two (measured), these by 2 %. Huber (1964), doi:10.1214/aoms/1177703732.
    """
    weights = affine(features, defects, ridge)
    for _ in range(ROUNDS):
        by = trust(defects - features @ weights.T, watched)[:, None]
        weights = affine(features * by, defects * by, ridge)
    return weights


def trust(left: Array, watched: tuple[int, ...] = ()) -> Array:
    """(n,) Huber's weights of steps by what a fit leaves of them (n, outputs), see `robust`."""
    left = np.abs(left)
    usual = np.median(left, axis=0)
    usual[usual == 0] = 1.0
    size = (left / usual)[:, list(watched) or slice(None)].max(axis=1)
    return np.asarray(1.0 / np.sqrt(1.0 + (size / KNEE) ** 2))


def relative_residual(prediction: Array, defects: Array) -> Array:
    """(states,) rms of what is left of each state's defect, relative to the defect."""
    size = np.sqrt((defects**2).mean(axis=0))
    size[size == 0] = 1.0
    return np.sqrt(((prediction - defects) ** 2).mean(axis=0)) / size
