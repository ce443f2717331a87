"""Is a specification too good for its IMU? The same log once more with poorer ones, by likelihood ratio.

A specification that is too good makes a filter follow its gyros where it should follow the measurements. Sensors of a poorer class
have larger errors of all kinds: noise, biases, scale factors and misalignments. But one whose scale factor alone is poor is no
sensor of a poorer class, whose noise the log rules out: scale factors and misalignments are made larger each alone, too.

A log may prefer the true sensors by less than chance explains, and its answer be five sigmas off all the same. So what is unsure is
in sigma. Let each of them be as likely beforehand as makes it as likely as not at the limit c of a rival, one to 148. With r, twice
the logarithms of the likelihood ratios, the chance of each and the second moment of the errors about the specification's answer are

    w_i = exp((r_i - c) / 2) / (1 + sum exp((r_j - c) / 2)),        P + sum w_i (P_i - P + d_i d_i')

d the way from one answer to the other.

Source: Y. Bar-Shalom, X. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), sec. 1.4.16
(moments of a mixture), 11.6 (multiple models).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.estimate.rivals import Rival, effect_of, last_sizes, likelihood_ratio, moved, nearest, rival
from truenorth.estimate.slow_fit import bounded_misfit
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.state.judge import weight
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

FACTORS = (3.0, 10.0, 30.0, 100.0)  # classes of IMUs lie up to a hundred times apart
FIELDS = ("bias", "turn_on_bias", "random_walk", "bias_instability", "rate_random_walk", "scale_factor", "misalignment")
# What may be poorer than specified. On a sound log each fits better than chance explains in 3 of 10,000 at most: of three states of
# the prior that a log shows whole, ``(1 - 1/9) chi_3^2 - 6 ln 3`` exceeds 10; of fewer, of more and of larger factors more seldom.
ALONE = {"rival.scale_factors": ("scale_factor", "scale_factor_asymmetry"), "rival.misalignments": ("misalignment",)}
KINDS = {"rival.poorer": FIELDS, **ALONE}
# Of a slave: on a straight flight its gyros' rates are their noise, and a scale factor of -1 would take that out.
SLOW: dict[str, tuple[str, ...]] = {"rival.poorer": ("bias", "turn_on_bias", "bias_instability", "rate_random_walk")}
# Where the earth's rate tells heading, a gyro's bias turns it: gyros that feel force, or are warmer than when they were calibrated,
# have larger ones, and are no noisier.
SENSORS = ("gyro_", "accel_")
BIASES: dict[str, tuple[str, ...]] = {"rival.gyro_biases": ("gyro_bias", "gyro_turn_on_bias")}


def poorer(spec: ImuSpec, factor: float, fields: Sequence[str] = FIELDS) -> ImuSpec:
    """A specification all of whose errors, or those of these kinds, of one sensor or of both, are so many times as large."""
    of_one = [name for name in fields if name.startswith(SENSORS)]
    of_both = [sensor + field for sensor in SENSORS for field in fields if field not in of_one]
    names = [*of_one, *of_both]
    return replace(spec, **{name: factor * getattr(spec, name) for name in names})


def poorer_evidence(run: Callable[[ImuSpec], Track], first: Track, spec: ImuSpec) -> list[Evidence]:
    """Whether a poorer IMU fits the measurements as well, and by what the answer moves with it.

    Measurements rule it out by far where the specification is right (ratios of -60 and less for a drive of four minutes): errors
    three times as large would have shown.

    Parameters
    ----------
    run : callable
        The same log with another specification.
    first : track
        Of the specification itself.
    spec : ImuSpec
    """
    found = [
        rival("rival.poorer", {"factor": factor}, ratio, moved(first, other), "specification")
        for factor, ratio, other in _climb(run, first, spec, FIELDS)
    ]
    return sorted(found, key=lambda item: item.effect.level)[-1:]


class Other(NamedTuple):
    """A log by a poorer IMU."""

    key: str  # of the kind in which it is poorer
    factor: float
    ratio: float  # twice the logarithm of its likelihood ratio
    track: Track


def poorer_tracks(
    run: Callable[[ImuSpec], Track], first: Track, spec: ImuSpec, kinds: Mapping[str, Sequence[str]] = KINDS
) -> list[Other]:
    """The log by IMUs that are poorer in each of the kinds, up to the likeliest of each and the one after it.

    Arguments as of :func:`poorer_evidence`, and the fields of each kind. Of an innovation x the ratio
    ``x^2 (1/v_0 - 1/v) - ln(v/v_0)`` has one maximum over its variance, and is nothing at v_0, that of the specification: once it
    falls, still poorer ones are no likelier.
    """
    found = []
    for key, fields in kinds.items():
        before = 0.0
        for factor, ratio, track in _climb(run, first, spec, fields):
            found.append(Other(key, factor, ratio, track))
            if ratio < before:
                break
            before = ratio
    return found


def poorer_rivals(first: Track, others: Sequence[Other]) -> list[Rival]:
    """Of each kind the likeliest, where it is likelier than chance explains, or what it may do is worth a place in sigma.

    Of a log that begins with a known attitude, which need not show what the IMU is worth: a poorer one may fit as well.
    """
    found, chances, sigma = [], _chances(others), last_sizes(first)
    for key in dict.fromkeys(other.key for other in others):
        own = [k for k, other in enumerate(others) if other.key == key]
        best = max((others[k] for k in own), key=lambda other: other.ratio)
        if best.ratio <= 0.0:
            continue
        effect, chance = effect_of(first, best.track), float(chances[own].sum())
        little = weight(effect.times(math.sqrt(chance)), sigma) <= limit("negligible")
        if best.ratio > limit("rival") or not little:
            found.append(Rival(best.ratio, key, {"factor": best.factor}, effect, chance))
    return found


def growth_along(first: Track, others: Sequence[Other]) -> Array:
    """(K, 9) by how many times the sigmas of phi, dv and dp are those of the mixture, all along the way; never less than one."""
    variance = first.sigma[:, :9] ** 2
    more = np.zeros_like(variance)
    for other, chance in zip(others, _chances(others), strict=True):
        track = other.track.whole()
        near = nearest(track.time, first.time)
        d = first.errors_against(track, near)
        more += chance * (track.sigma[near, :9] ** 2 - variance + d**2)
    return np.sqrt(1.0 + np.maximum(more, 0.0) / np.where(variance > 0.0, variance, np.inf))


def _chances(others: Sequence[Other]) -> Array:
    """That each of them is right, and the specification wrong."""
    logs = 0.5 * (np.array([other.ratio for other in others]) - limit("rival"))
    most = max(0.0, float(logs.max(initial=0.0)))  # else odds of thousands are infinite
    odds = np.exp(logs - most)
    return np.asarray(odds / (np.exp(-most) + odds.sum()))


def more_rejected(first: Track, other: Track) -> bool:
    """Whether the gates of another track keep out more of a sensor's rows than the first one's, and than chance and some jumps do.

    Those that both take say nothing of it: a filter that has lost its track rejects nearly all rows, and the few that it takes
    fit as it likes. Rejected ones count as much as the gate allows then.
    """
    had = {r.name: r.rejected for r in first.residuals}
    return any(r.rejected - had.get(r.name, 0) > limit("rejected") * max(len(r.time), 1) for r in other.residuals)


def _climb(
    run: Callable[[ImuSpec], Track], first: Track, spec: ImuSpec, fields: Sequence[str]
) -> Iterator[tuple[float, float, Track]]:
    """How many times as poor, likelihood ratio and track, as long as the log does not rule it out: more is ruled out more."""
    for factor in FACTORS:
        other = poorer(spec, factor, fields)
        if other == spec:  # it has no such errors
            return
        try:
            track = run(other)
        except DataError:  # the filter broke down: no explanation
            return
        ratio = likelihood_ratio(first.residuals, track.residuals)
        if more_rejected(first, track):
            ratio = min(ratio, bounded_misfit(first.residuals) - bounded_misfit(track.residuals))
        if ratio < -limit("ruled out"):
            return
        yield factor, ratio, track
