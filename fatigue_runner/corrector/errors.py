"""What is wrong with a corrector."""

from __future__ import annotations

from fatigue_runner.errors import InputError


class CorrectorError(InputError):
    """A corrector that cannot be used, or not here."""
