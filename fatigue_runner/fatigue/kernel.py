"""Compiled rainflow counting: reversals, then the three-point rule, both in one pass without allocation.

numba is imported here and nowhere else in this folder; `rainflow.py` imports this file at the first count. No
fastmath: the ranges and means must be the same bits as those of the PyPI package `rainflow`.
"""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import njit

Array = np.ndarray


@njit(nogil=True)
def reversals(series: Array, points: Array) -> int:
    """Write reversals and ends of `series` (n >= 3) to `points` (n,); return how many, 0 for a constant.

    The product's sign, not a comparison of signs, is what the reference package tests: where it underflows
    (ranges below about 1e-162) the reversal is missed there too. Kept branch-free, since noise makes this
    branch unpredictable.
    """
    last = series.size - 1
    slope = series[1] - series[0]
    points[0] = series[0]
    count = 1
    for i in range(1, last):
        step = series[i + 1] - series[i]
        points[count] = series[i]
        count += slope * step < 0.0
        slope = step if step != 0.0 else slope
    points[count] = series[last]
    return count + 1 if slope != 0.0 else 0


@njit(nogil=True)
def three_point(points: Array, residue_count: float, ranges: Array, means: Array, counts: Array) -> int:
    """ASTM E1049-85, 5.4.4 on the reversals `points`, which it overwrites; return the number of cycles.

    Every range that never closes is written with `residue_count`, or left out when that is 0.
    """
    start = (
        0  # the standard's point S; points[start : top] is the stack, which never overtakes the reading index
    )
    top = 0
    cycles = 0
    for i in range(points.size):
        points[top] = points[i]
        top += 1
        while top - start >= 3:
            x = abs(points[top - 1] - points[top - 2])
            y = abs(points[top - 2] - points[top - 3])
            if x < y:
                break
            if top - start == 3:  # step 5: Y contains the starting point
                if residue_count > 0.0:
                    ranges[cycles] = y
                    means[cycles] = 0.5 * (points[start] + points[start + 1])
                    counts[cycles] = residue_count
                    cycles += 1
                start += 1
            else:  # step 4: Y closes
                ranges[cycles] = y
                means[cycles] = 0.5 * (points[top - 3] + points[top - 2])
                counts[cycles] = 1.0
                cycles += 1
                points[top - 3] = points[top - 1]
                top -= 2
    if residue_count > 0.0:  # step 6: what is left
        for i in range(start, top - 1):
            ranges[cycles] = abs(points[i] - points[i + 1])
            means[cycles] = 0.5 * (points[i] + points[i + 1])
            counts[cycles] = residue_count
            cycles += 1
    return cycles


def count(series: np.ndarray, residue_count: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ranges, means and counts of a finite, contiguous float64 `series` (n >= 3), in the order they close."""
    points = np.empty(series.size)
    points = points[: reversals(series, points)]
    ranges, means, counts = (np.empty(max(points.size - 1, 0)) for _ in range(3))
    n = three_point(points, residue_count, ranges, means, counts)
    return ranges[:n], means[:n], counts[:n]


@njit(nogil=True)
def power(base: float, m: float) -> float:
    """`base` to a power above zero; whole ones by squaring, a fifth of the time of the general one."""
    whole = int(m)
    if whole != m:
        return base**m
    result = 1.0
    while whole > 0:
        if whole % 2 == 1:
            result *= base
        base *= base
        whole //= 2
    return result


@njit(nogil=True)
def channel_sums(block: Array, exponents: Array, residue_count: float) -> tuple[Array, Array, Array]:
    """Every channel of `block` (channels, n >= 3), finite, counted once: (Σ n (S/S_max)ᵐ (channels, exponents), S_max, Σ n).

    Ranges are taken over the largest, so that no power overflows whatever the unit.
    """
    channels, n = block.shape
    sums = np.zeros((channels, exponents.size))
    largest, total = np.zeros(channels), np.zeros(channels)
    points, ranges, means, counts = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for c in range(channels):
        top = reversals(block[c], points)
        cycles = three_point(points[:top], residue_count, ranges, means, counts)
        for i in range(cycles):
            largest[c] = max(largest[c], ranges[i])
            total[c] += counts[i]
        if largest[c] == 0.0:
            continue
        for i in range(cycles):
            relative = ranges[i] / largest[c]
            for k in range(exponents.size):
                sums[c, k] += counts[i] * power(relative, exponents[k])
    return sums, largest, total
