"""Print the equations of motion as the lane kernels in `fatigue_runner/turbine/generated/`.

python tools/generate_kernel.py            write them
python tools/generate_kernel.py --check    exit 1 if the committed files are not what the equations give
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

TARGET = ROOT / "fatigue_runner" / "turbine" / "generated"


def generate() -> dict[Path, str]:
    """The generated modules by their paths."""
    from fatigue_runner.turbine.derivation.printer import VARIANTS, module
    from fatigue_runner.turbine.derivation.section_printer import sections_module

    kernels = {TARGET / f"{name}.py": module(variant) for name, variant in VARIANTS.items()}
    return kernels | {TARGET / "sections.py": sections_module()}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    check = parser.parse_args().check
    stale = 0
    for path, text in generate().items():
        if not check:
            path.write_text(text, encoding="utf-8")
            print(f"wrote {path.relative_to(ROOT)}: {len(text.splitlines())} lines")
        elif path.exists() and path.read_text(encoding="utf-8") == text:
            print(f"generated {path.name} is current")
        else:
            print(f"generated {path.name} is stale: run python tools/generate_kernel.py")
            stale = 1
    return stale


if __name__ == "__main__":
    raise SystemExit(main())
