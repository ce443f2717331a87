"""Run every ``benchmarks/bench_*.py``, or those whose names are given: ``python -m benchmarks [mechanisation ...]``."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path


def main() -> None:
    names = sorted(path.stem for path in Path(__file__).parent.glob("bench_*.py"))
    wanted = {f"bench_{name}" for name in sys.argv[1:]} or set(names)
    unknown = wanted - set(names)
    if unknown:
        sys.exit(f"no such benchmark: {', '.join(sorted(unknown))}; there are {', '.join(names)}")
    for name in names:
        if name in wanted:
            print(f"\n{name}", flush=True)
            import_module(f"benchmarks.{name}").main()


if __name__ == "__main__":
    main()
