"""What decides the figures of a case beside its inputs: the code that simulates and evaluates it, found by its imports.

The hash is of the sources of every module of the package that `campaign.block` needs, directly or through others, and of the versions
of the libraries that compute. A resumed run keeps no figure that another hash made.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import re
import zlib
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from fatigue_runner.caches import cache_base
from fatigue_runner.inputs.files import write_atomically

PACKAGE = "fatigue_runner"
_MADE_NAME = re.compile(rb"import_module\(f\"\{__package__\}\.(\w+)\.")
START = f"{PACKAGE}.campaign.block"
# llvmlite makes the machine code, scipy the splines, matrix exponentials and integrals
_KEPT = 32  # versions of the program whose hash is remembered
LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")


@functools.cache
def code_hash() -> str:
    """Hash of all that computes, so that figures of two versions never stand in one table."""
    known = _remembered()
    if known is not None:
        return known
    digest = hashlib.sha256(source_hash(Path(__file__).parents[1]).encode())
    for name in LIBRARIES:
        digest.update(f"{name} {metadata.version(name)}\n".encode())
    found = digest.hexdigest()[:16]
    with suppress(OSError):  # half a second at the start of every run otherwise
        _memory().parent.mkdir(parents=True, exist_ok=True)
        write_atomically(_memory(), _checked(found))
        for old in sorted(_memory().parent.iterdir(), key=lambda path: path.stat().st_mtime)[:-_KEPT]:
            old.unlink()
    return found


def program_hash() -> str:
    """Hash of the whole program and of the libraries that compute: whatever it writes it would write again."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for file in sorted(path for path in root.rglob("*") if path.suffix in (".py", ".html", ".css", ".js")):
        digest.update(f"{file.relative_to(root).as_posix()}\n".encode() + file.read_bytes())
    for name in LIBRARIES:
        digest.update(f"{name} {metadata.version(name)}\n".encode())
    return digest.hexdigest()[:16]


def _memory() -> Path:
    # not in the folder of the compiled kernels, whose name only a process with the compiler knows
    return cache_base() / "code" / program_hash()


def _remembered() -> str | None:
    """The code's hash, where an earlier run of this very program has found it."""
    try:
        text = _memory().read_bytes()
    except OSError:
        return None
    found = text.partition(b" ")[0].decode("ascii", "replace")
    return found if text == _checked(found) else None


def _checked(found: str) -> bytes:
    return f"{found} {zlib.crc32(found.encode()):08x}\n".encode()


def source_hash(root: Path) -> str:
    """SHA-256 of the modules that decide figures, of the package in the folder `root`."""
    digest = hashlib.sha256()
    for file in deciding_files(root):
        digest.update(f"{file.relative_to(root).as_posix()}\n".encode() + file.read_bytes())
    return digest.hexdigest()


def deciding_files(root: Path) -> list[Path]:
    """The files of every module that `START` imports, itself or through others, anywhere but for type checking; sorted.

    Importing a module runs the `__init__` of its folder too; that counts where it imports the folder's modules by looping over them
    (a register: wind sources, for instance, which nothing else names), else its names do nothing.
    """
    modules = _modules(root)
    found: set[str] = set()
    left = [START]
    while left:
        module = left.pop()
        if module in found:
            continue
        found.add(module)
        for name, inner in _imports(modules[module].read_bytes()):
            left += [inner if inner in modules else name]
        left += _by_name(module, modules)
        left += [*_registered(module, modules), *_registered(module.rpartition(".")[0], modules)]
        left = [name for name in left if name in modules]
    return sorted(modules[module] for module in found)


def _modules(root: Path) -> dict[str, Path]:
    """Files by the dotted names of their modules, without that of the package itself, which only hands names on."""
    files = {
        ".".join((PACKAGE, *path.relative_to(root).with_suffix("").parts)): path
        for path in root.rglob("*.py")
    }
    files = {name.removesuffix(".__init__"): path for name, path in files.items()}
    return {name: path for name, path in files.items() if name != PACKAGE}


@functools.lru_cache(maxsize=1024)
def _imports(source: bytes) -> list[tuple[str, str]]:
    """(module, name below it that may be a module, too) of all imports from the package in a file's text."""
    found = []
    left: list[ast.AST] = [ast.parse(source)]
    while left:
        node = left.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            left += node.orelse
            continue
        left += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            found += [(alias.name, "") for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [(node.module, f"{node.module}.{alias.name}") for alias in node.names]
    return [names for names in found if names[0].split(".")[0] == PACKAGE]


def _by_name(module: str, modules: dict[str, Path]) -> list[str]:
    """The modules of a folder beside `module` that it imports by a name which it makes: `import_module(f"{__package__}.folder.{name}")`."""
    folders = _MADE_NAME.findall(modules[module].read_bytes())
    above = [f"{module.rpartition('.')[0]}.{folder.decode()}." for folder in folders]
    return [name for name in modules if name.startswith(tuple(above))] if above else []


def _registered(folder: str, modules: dict[str, Path]) -> list[str]:
    """The modules that a folder's `__init__` imports by looping over them, and itself."""
    if folder not in modules or b"iter_modules(__path__)" not in modules[folder].read_bytes():
        return []
    return [name for name in modules if name == folder or name.rpartition(".")[0] == folder]
