"""Speed of navigation: an hour of flight at 100 Hz, free inertial, with covariance, aided by GNSS, smoothed.

Limits: .15 s free inertial, 1 s with 15 states at 10 Hz and GNSS at 1 Hz. Run: ``python -m benchmarks navigation``.
"""

from __future__ import annotations

from benchmarks.parts import least, strapdown

LIMITS = {"an hour of navigation, free, ms": 150.0, "with 15 states at 10 Hz and GNSS, ms": 1000.0}


def main() -> None:
    for what, call, unit in strapdown():
        spent = unit * least(call)
        limit = LIMITS.get(what)
        print(f"  {what:40s}{spent:8.1f}" + ("" if limit is None else f"  (limit {limit:.0f})"))
        assert limit is None or spent < limit, "slower than the limit"


if __name__ == "__main__":
    main()
