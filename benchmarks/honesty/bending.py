"""A slave at the end of a structure that bends, in worlds of our own: wings and ships' hulls that ring at their own frequencies.

What a structure does is no process of an estimator's model: tones of half to one and a half of its frequency, at random phases,
about its axis of most compliance, a tenth of it about the others. The end moves by a coupling that is drawn, .4 to 1
(:mod:`truenorth.errors.bending`). What is said with `--flexure` is the size and the time that an engineer would say: the RMS about
each axis, and a correlation time of ``2.15 / (2 pi f)``. Drawn besides: delay (50 ms), mounting (3 deg), an arm known to .3 m.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.honesty.frame import Outcome
from benchmarks.honesty.harness import of_transfer
from truenorth.aiding.matching import What
from truenorth.alignment.transfer import align_transfer
from truenorth.records.flexure import DECAY, FlexureSpec
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.flexure import Flexed

Array = NDArray[np.float64]

DEG, ARCMIN = np.radians(1.0), np.radians(1.0 / 60.0)
SECONDS, RATE = 120.0, 100.0
TONES = 40
ARM_SIGMA = 0.3  # m, of an arm that was measured


class Ringing(Flexed):
    """A structure that rings about a frequency: tones at random phases."""

    def drawn(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """The angles at the knots, and how fast they change."""
        f = np.linspace(0.5, 1.5, TONES) * self.spec.beta / (2.0 * np.pi)
        phase = 2.0 * np.pi * (self.knots[:, None, None] * f[:, None] + rng.random((TONES, 3)))
        size = np.asarray(self.spec.sigma) * np.sqrt(2.0 / TONES)
        return np.sum(size * np.sin(phase), axis=1), np.sum(2.0 * np.pi * f[:, None] * size * np.cos(phase), axis=1)


def bending(
    motion: Callable[[], Any],
    wing: bool,
    said: bool,
    matching: What = "auto",
    grade: str = "tactical",
    frequencies: tuple[float, float] = (1.0, 8.0),
    sizes: tuple[float, float] = (0.05, 0.3),
) -> Any:
    """A run of a slave on a wing (an arm of 3 to 8 m to the right) or a hull (10 to 30 m forward) that bends.

    Parameters
    ----------
    said : bool
        Whether `--flexure` is given.
    frequencies, sizes : two floats, Hz and deg
        Between which they are drawn, evenly in their logarithms.
    """

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 17])
        f, size = (float(np.exp(rng.uniform(*np.log(limits)))) for limits in (frequencies, sizes))
        tau, mount = 0.05 * rng.standard_normal(), 3 * DEG * rng.standard_normal(3)
        out = rng.uniform(3.0, 8.0) if wing else rng.uniform(10.0, 30.0)
        arm = np.array([out, 0.0, 0.3]) if wing else np.array([0.5, out, 2.0])
        given = tuple(arm + ARM_SIGMA * rng.standard_normal(3))
        most = 2 if wing else 1  # a wing turns about forward: roll; a hull about right: pitch
        sigma = tuple(size * DEG * (1.0 if axis == most else 0.1) for axis in range(3))
        lasts = DECAY / (2.0 * np.pi * f)
        coupling = (float(rng.uniform(0.4, 1.0)),) * 3
        spec = FlexureSpec(sigma=sigma, correlation_time=lasts, coupling=coupling, arm=tuple(arm))  # type: ignore[arg-type]
        way, imu = motion(), imu_spec(grade)
        bent = Ringing(way, spec, duration=SECONDS + 1.0, seed=seed, run=number)
        slave = simulate(bent, rate=RATE, duration=SECONDS, imu=imu, seed=seed, run=number).record
        of_master = MasterSpec(
            clock_offset=tau,
            lever_arm=tuple(arm),
            mounting=tuple(mount),
            velocity_noise=0.05,
            attitude_noise=ARCMIN,
        )
        master = simulate_sensor(way, of_master, duration=SECONDS, seed=seed, run=number).record
        flexure = FlexureSpec(sigma=(size * DEG,) * 3, correlation_time=lasts) if said else None
        known: dict[str, Any] = {"lever_arm": given, "lever_arm_sigma": ARM_SIGMA, "flexure": flexure}
        answer = align_transfer(slave, master, imu, matching=matching, **known)
        return of_transfer(answer, bent.states(np.array(answer.time)).C_nb, tau, arm)

    return run
