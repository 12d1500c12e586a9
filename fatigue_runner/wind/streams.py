"""Random numbers of turbulence: one stream for each seed, mean wind speed and signal, the same on every machine."""

from __future__ import annotations

import struct

import numpy as np


def uniform(seed: int, stream: tuple[int, ...], count: int) -> np.ndarray:
    """Random numbers in [0, 1), equal on every machine: raw PCG64 words, whose stream numpy guarantees."""
    words = np.random.PCG64(np.random.SeedSequence(seed, spawn_key=stream)).random_raw(count)
    return (words >> np.uint64(11)) * 2.0**-53


def speed_stream(speed: float) -> tuple[int, int]:
    """The 64 bits of a wind speed [m/s] as two words, the high one first: what a stream's key begins with.

    Two speeds that differ in their last bit have streams of their own, so that one seed is independent from
    speed to speed however closely a sweep lies; a rounded speed would give neighbours the same turbulence.
    """
    return struct.unpack(">II", struct.pack(">d", speed))
