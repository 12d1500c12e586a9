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


# decimal places in which a speed is written; each has a range of seeds of its own from 0.01 m/s on
PLACES = (2, 6, 12)


def own_seeds(speed: float, count: int) -> list[int]:
    """Seeds that a mean wind speed [m/s] shares with no other, at most 999: 600001, 600002, ... at 6 m/s, 8000100001, ... at 8.0001.

    A results table with the seed alone thus tells two winds apart. Beyond twelve places two speeds share their numbers, not their
    streams.
    """
    places = next((n for n in PLACES if round(speed, n) == speed), PLACES[-1])
    first = round(speed * 10**places) * 1000
    return [first + k for k in range(1, count + 1)]
