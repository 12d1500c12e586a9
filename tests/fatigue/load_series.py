"""Series of loads that hypothesis draws: made to vary, not drawn until they do, which its older versions refuse as a waste."""

from __future__ import annotations

from hypothesis import strategies as st

LOAD = st.just(0.0) | st.floats(1e-3, 1e7) | st.floats(-1e7, -1e-3)
SWING = st.floats(1.0, 1e7) | st.floats(-1e7, -1.0)


def _with_swing(values: list[float], swing: float, place: int) -> list[float]:
    return [*values[:place], values[0] + swing, *values[place:]]


# 3 to 60 loads, one of them at least 1 away from another
VARYING = st.builds(_with_swing, st.lists(LOAD, min_size=2, max_size=59), SWING, st.integers(0, 59))
