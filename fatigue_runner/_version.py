"""The program's version: the one place that says it (pyproject.toml reads this file)."""

__version__ = "0.1.0"
