"""Kalibr's form of a specification, written: continuous-time densities in SI; :func:`truenorth.imu_spec` reads it."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

from truenorth.records.specs import KALIBR, ImuSpec


def write_kalibr(spec: ImuSpec, rate: float, path: str | PathLike[str]) -> None:
    """Write the four densities that Kalibr takes, for samples at a rate (Hz).

    A bias that wanders as a Gauss-Markov process (sigma b, correlation time T) drives its random walk by ``b sqrt(2 / T)``.

    Raises
    ------
    UsageError
        The file cannot be written.
    """
    import yaml

    from truenorth.core.atomic import atomic_path, write_text

    whole = spec.with_random_walks(1.0 / rate)
    drive = math.sqrt(2.0 / spec.correlation_time)
    content: dict[str, Any] = {}
    for theirs, ours in KALIBR.items():
        value = getattr(whole, ours)
        if ours.endswith("rate_random_walk"):
            sensor = ours.partition("_")[0]
            value = math.hypot(value, getattr(spec, f"{sensor}_bias_instability") * drive)
        content[theirs] = float(value)
    content |= {"rostopic": "/imu", "update_rate": float(rate)}
    with atomic_path(path) as temporary:
        write_text(temporary, yaml.safe_dump(content, sort_keys=False))
