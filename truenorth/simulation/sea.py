"""A ship in waves: sea spectra, a hull's response to them, and plain narrow-band swell, all as sums of tones.

A realisation is ``N`` components of equal energy: the spectrum is cut into ``N`` parts of one N-th of its variance each, and
every part is a sinusoid of that variance at a random frequency inside the part and with a random phase. The frequencies have
no common period, so that the sea never repeats.

Sources: K. Hasselmann et al., Measurements of wind-wave growth (JONSWAP), Dtsch. Hydrogr. Z. A8 (12), 1973; W. J. Pierson,
L. Moskowitz, J. Geophys. Res. 69 (24), 1964; O. M. Faltinsen, *Sea Loads on Ships and Offshore Structures*, 1990, ch. 2-3
(deep water: ``k = w^2/g``, encounter frequency, particle motion).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError, expect_positive
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.simulation.tones import Tone

Array = NDArray[np.float64]
COMPONENTS = 48
CUT = (
    0.4,
    4.0,
)  # the spectrum is taken between these multiples of its peak frequency: 99.7 % of the elevation's variance
STILL = 0.02  # rad/s: slower encounters of a following sea are left out, they would carry the ship away


@dataclass(frozen=True)
class WaveSpectrum:
    """JONSWAP spectrum of the sea's elevation; with a peakedness of 1, Pierson and Moskowitz's.

    Raises
    ------
    UsageError
        A height or period that is not positive, or a peakedness below 1.
    """

    height: float  # m; significant wave height, four standard deviations of the elevation
    period: float  # s; at the peak of the spectrum
    peakedness: float = 3.3  # gamma; 3.3 in the mean of a growing sea, 1 in a fully developed one

    def __post_init__(self) -> None:
        if not (0 < self.height < math.inf and 0 < self.period < math.inf and 1 <= self.peakedness < math.inf):
            raise UsageError(
                f"sea of significant height {self.height:g} m, peak period {self.period:g} s, peakedness "
                f"{self.peakedness:g}; expected a positive height and period, and a peakedness of 1 or more"
            )

    @classmethod
    def of_wind(cls, speed: float) -> WaveSpectrum:
        """The fully developed sea of a wind (m/s, at 19.5 m height); Pierson and Moskowitz (1964)."""
        # S = .0081 g^2 w^-5 exp(-.74 (g/(U w))^4): its integral, and its peak at w = (.74 * 4/5)^(1/4) g/U.
        height = 4 * math.sqrt(0.0081 / (4 * 0.74)) * speed**2 / STANDARD_GRAVITY
        return cls(height, 2 * math.pi * speed / (0.592**0.25 * STANDARD_GRAVITY), 1.0)

    def density(self, w: Array) -> Array:
        """Variance density at angular frequencies `w` (rad/s), m^2 s; its integral over the cut is height^2/16."""
        grid = np.linspace(*CUT, 4001) * 2 * math.pi / self.period
        shape = self._shape(grid)
        m0 = float(np.sum(0.5 * (shape[1:] + shape[:-1]) * np.diff(grid)))
        return self.height**2 / 16 / m0 * self._shape(np.asarray(w, dtype=np.float64))

    def _shape(self, w: Array) -> Array:
        x = w * self.period / (2 * math.pi)
        width = np.where(x <= 1, 0.07, 0.09)
        return x**-5.0 * np.exp(-1.25 * x**-4.0) * self.peakedness ** np.exp(-0.5 * ((x - 1) / width) ** 2)

    def components(self, count: int, rng: np.random.Generator) -> tuple[Array, float]:
        """Frequencies (count,) rad/s of `count` sinusoids of equal energy, and the amplitude that they share, m."""
        grid = np.linspace(*CUT, 4001) * 2 * math.pi / self.period
        shape = self._shape(grid)
        share = np.concatenate([[0.0], np.cumsum(0.5 * (shape[1:] + shape[:-1]))])
        levels = (np.arange(count) + rng.random(count)) / count
        return np.interp(levels, share / share[-1], grid), self.height / 4 * math.sqrt(2 / count)


@dataclass(frozen=True)
class Hull:
    """How a hull answers the waves: three damped oscillators behind the mean of the slope over its length and beam.

    Raises
    ------
    UsageError
        A value that is not positive.
    """

    length: float = 100.0  # m
    beam: float = 16.0  # m
    roll_period: float = 10.0  # s; natural ones
    pitch_period: float = 6.0  # s
    heave_period: float = 6.5  # s
    roll_damping: float = 0.08  # fraction of the critical
    pitch_damping: float = 0.35
    heave_damping: float = 0.35
    yaw_gain: float = 0.3  # yaw over the wave's slope times sin(2 beta)/2

    def __post_init__(self) -> None:
        expect_positive("hull", vars(self))


def sea_motion(
    spectrum: WaveSpectrum,
    hull: Hull,
    rng: np.random.Generator,  # numpy.random.Generator
    *,
    direction: float,  # rad; that the waves run to, clockwise from north
    heading: float = 0.0,  # rad; of the ship: waves are met at ``w_e = w - k V cos(beta)``
    speed: float = 0.0,  # m/s
    components: int = COMPONENTS,
) -> dict[str, tuple[Tone, ...]]:
    """Motion of a ship in a long-crested sea, all six degrees of freedom from the same waves.

    With ``k = w^2/g``, ``beta = direction - heading``, the elevation ``a cos(w_e t + phi)`` at the ship and its slope ``s =
    k a sin(w_e t + phi)``: heave follows the elevation, pitch ``s cos(beta)``, roll ``-s sin(beta)``, each through the mean over
    the hull and an oscillator; the centre is carried along the waves' direction as the water is.

    Returns
    -------
    dict
        Tones by the names that :class:`Sway` and :class:`Disturbed` take.
    """
    w, a = spectrum.components(components, rng)
    phase = rng.uniform(0, 2 * math.pi, components)
    beta = direction - heading
    k = w**2 / STANDARD_GRAVITY
    mean = np.sinc(k * hull.length * math.cos(beta) / (2 * math.pi)) * np.sinc(
        k * hull.beam * math.sin(beta) / (2 * math.pi)
    )
    met = w - k * speed * math.cos(beta)
    wave = a * mean * np.exp(1j * np.sign(met) * phase)  # cos is even: a wave that is overtaken runs backwards
    slope = -1j * np.sign(met) * k * wave
    w_e = np.abs(met)

    def oscillator(period: float, damping: float) -> NDArray[np.complex128]:
        x = w_e * period / (2 * math.pi)
        return np.asarray(1 / (1 - x**2 + 2j * damping * x), dtype=np.complex128)

    def tones(signal: NDArray[np.complex128], quarter: float = 0.0) -> tuple[Tone, ...]:
        keep = w_e > STILL
        rows = zip(np.abs(signal[keep]), 2 * math.pi / w_e[keep], np.angle(signal[keep]) + quarter, strict=True)
        return tuple(Tone(float(A), float(T), float(p)) for A, T, p in rows)

    carried = -1j * np.sign(met) * wave
    late = 0.5 * math.pi  # displacements are sums of sines
    return {
        "heading_tones": tones(hull.yaw_gain * 0.5 * math.sin(2 * beta) * slope),
        "pitch_tones": tones(math.cos(beta) * slope * oscillator(hull.pitch_period, hull.pitch_damping)),
        "roll_tones": tones(-math.sin(beta) * slope * oscillator(hull.roll_period, hull.roll_damping)),
        "east_tones": tones(math.sin(direction) * carried, late),
        "north_tones": tones(math.cos(direction) * carried, late),
        "up_tones": tones(wave * oscillator(hull.heave_period, hull.heave_damping), late),
    }


def narrow_band(
    rms: float, period: float, bandwidth: float, rng: np.random.Generator, components: int = COMPONENTS
) -> tuple[Tone, ...]:
    """Swell of one signal: a Gaussian-shaped spectrum about a centre.

    Parameters
    ----------
    rms : float
        Of the signal, rad or m.
    period : float, s
        Of the centre.
    bandwidth : float
        Width of the spectrum at half its height, over the centre's frequency: .15 is a narrow swell.
    rng : numpy.random.Generator

    Raises
    ------
    UsageError
        A negative rms, or a bandwidth outside 0 to 1.
    """
    if not (rms >= 0 and period > 0 and 0 < bandwidth < 1):
        raise UsageError(
            f"swell of rms {rms:g}, period {period:g} s, bandwidth {bandwidth:g}; expected rms of zero or more, a positive "
            "period, and a bandwidth between 0 and 1"
        )
    from scipy.special import ndtri

    levels = (np.arange(components) + rng.random(components)) / components
    spread = bandwidth / math.sqrt(8 * math.log(2))
    f = (1 + spread * np.clip(ndtri(levels), -4, 4)) / period
    phases = rng.uniform(0, 2 * math.pi, components)
    amplitude = rms * math.sqrt(2 / components)
    return tuple(Tone(amplitude, float(1 / x), float(p)) for x, p in zip(f, phases, strict=True) if x > 0)
