"""Where a wish is out of reach: how much smaller the errors in the way have to be.

The variance of heading is a sum over sources. Those that hold a part that matters are made smaller by one factor, and the
covariance is propagated anew, since a filter weighs other sensors otherwise, until the wanted sigma is met.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from truenorth.core.units import parse_unit, significant
from truenorth.records.specs import ImuSpec

# Terms of a specification, without gyro or accel, that make a source; the first of them stands for it in words.
TERMS = {
    "bias": (("bias", "turn_on_bias"), ("deg/h", "ug")),
    "noise": (("random_walk", "sample_noise", "quantisation"), ("deg/sqrt(h)", "ug/sqrt(Hz)")),
    "bias instability": (("bias_instability", "rate_random_walk"), ("deg/h", "ug")),
    "scale factors and misalignments": (("scale_factor", "misalignment", "scale_factor_asymmetry"), ("ppm", "ppm")),
}
MATTERS, NAMED = 0.02, 0.1  # of the wanted variance; of the variance there is, what is named
TRIES, MARGIN, BEST = 8, 0.99, 1e4  # the last: times as good as which no IMU is looked for
Evaluate = Callable[[ImuSpec], tuple[float, Mapping[str, float]]]


@dataclass(frozen=True)
class Better:
    """A specification with which the wish is met."""

    imu: ImuSpec
    factor: float  # by which the errors of `sources` are smaller
    sources: tuple[str, ...]  # greatest first
    chief: int  # how many of them hold a tenth of the variance and more

    @property
    def words(self) -> str:
        """The chief figures: ``gyro random walk 0.0059 deg/sqrt(h), gyro bias instability 0.035 deg/h``."""
        named = []
        for source in self.sources[: max(self.chief, 1)]:
            for sensor, names, unit in _terms(source):
                if (value := getattr(self.imu, f"{sensor}_{names[0]}")) > 0.0:
                    figure = significant(value / parse_unit(unit)[0])
                    named.append(f"{sensor} {names[0].replace('_', ' ')} {figure} {unit}")
        return ", ".join(named)


def better(spec: ImuSpec, wanted: float, evaluate: Evaluate) -> Better | str:
    """The specification with which heading comes to `wanted` (rad, one sigma); else what other than the IMU is in the way.

    Parameters
    ----------
    spec : ImuSpec
    wanted : float, rad
    evaluate : callable
        Of a specification the variance of heading (rad^2) and the part of each source, greatest first.
    """
    variance, share = evaluate(spec)
    found = tuple(name for name, part in share.items() if part * variance > MATTERS * wanted**2 and _terms(name))
    chief = sum(share[name] > NAMED for name in found)
    factor, now = 1.0, spec
    for _ in range(TRIES):
        if variance <= wanted**2:
            return Better(now, factor, found, chief)
        ours = variance * sum(part for name, part in share.items() if name in found)
        left = wanted**2 - (
            variance - ours
        )  # what does not come from the IMU stays, but for the filter's other weights
        factor = _rounded_up(factor * math.sqrt(ours / left if left > 0.0 else variance / wanted**2) / MARGIN)
        if factor > BEST or not found:
            break
        now = _smaller(spec, factor, found)
        variance, share = evaluate(now)
    return next(name for name in share if not _terms(name))


def _smaller(spec: ImuSpec, factor: float, sources: tuple[str, ...]) -> ImuSpec:
    names = [f"{sensor}_{name}" for source in sources for sensor, terms, _ in _terms(source) for name in terms]
    return replace(spec, **{name: getattr(spec, name) / factor for name in names})


def _terms(source: str) -> list[tuple[str, tuple[str, ...], str]]:
    """Sensor, terms and the unit of the first of them; empty for what is no error of the IMU."""
    sensor, _, what = source.partition(" ")
    if sensor not in ("gyro", "accelerometer") or what not in TERMS:
        return []
    names, units = TERMS[what]
    return [("gyro", names, units[0]) if sensor == "gyro" else ("accel", names, units[1])]


def _rounded_up(x: float) -> float:
    """To two digits."""
    step = 10.0 ** (math.floor(math.log10(x)) - 1)
    return math.ceil(x / step - 1e-9) * step
