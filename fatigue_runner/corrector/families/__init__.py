"""What can be learned, one family a file: the keys of its recipe, how it is trained, and a map of its own where it needs one.

Every module of this folder is imported here, so a new family is one new file: a subclass of `recipe.Recipe` whose `family` names it is
found by `fatigue-runner train`, and its correctors by everything that runs them.
"""

from importlib import import_module
from pkgutil import iter_modules


def find_all() -> None:
    """Import every module of the folder."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")


find_all()
