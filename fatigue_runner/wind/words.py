"""What blows in words, for logs and reports: how strong it is at a point, what rotor and blades keep of it, what is left out."""

from __future__ import annotations


def told_strength(mean: float, point: float, rotor: float, blade: float | None, harmonics: int) -> str:
    """Standard deviations [m/s] of the longitudinal wind: at a point at hub height, of the mean over the rotor, at a turning blade
    (None where the wind has no harmonics of its own); `mean` [m/s]."""

    def told(sigma: float) -> str:
        return f"{sigma:.2f} m/s ({sigma / mean:.1%} of the mean)".replace("%", "\u00a0%")

    words = f"standard deviation {told(point)} at a point at hub height; the mean over the rotor keeps {told(rotor)}"
    if blade is not None:
        words += f", a turning blade feels {told(blade)} through {harmonics} azimuthal harmonics"
    return words


def told_left_out(harmonics: int) -> str:
    """What a wind of M harmonics does not have of a real one."""
    beyond = {0: "all that differs over the rotor", 1: "all that differs over the rotor beyond linear shears"}
    return (
        f"lateral and vertical turbulence; {beyond.get(harmonics, f'azimuthal harmonics above {harmonics}')}"
    )
