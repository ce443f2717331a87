"""Is a specification too good for its IMU? The same log once more with poorer ones, by likelihood ratio.

A specification that is too good makes a filter follow its gyros where it should follow the measurements. Sensors of a poorer class
have larger errors of all kinds: noise, biases, scale factors and misalignments. But one whose scale factor alone is poor is no
sensor of a poorer class, whose noise the log rules out: scale factors and misalignments are made larger each alone, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from truenorth.core.errors import DataError
from truenorth.estimate.rivals import Rival, effect_of, likelihood_ratio, moved, rival
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Track

FACTORS = (3.0, 10.0, 30.0, 100.0)  # classes of IMUs lie up to a hundred times apart
FIELDS = ("bias", "turn_on_bias", "random_walk", "bias_instability", "rate_random_walk", "scale_factor", "misalignment")
# What may be poorer than specified. On a sound log each fits better than chance explains in 3 of 10,000 at most: of three states of
# the prior that a log shows whole, ``(1 - 1/9) chi_3^2 - 6 ln 3`` exceeds 10; of fewer, of more and of larger factors more seldom.
KINDS = {
    "rival.poorer": FIELDS,
    "rival.scale_factors": ("scale_factor", "scale_factor_asymmetry"),
    "rival.misalignments": ("misalignment",),
}


def poorer(spec: ImuSpec, factor: float, fields: Sequence[str] = FIELDS) -> ImuSpec:
    """A specification all of whose errors, or those of these kinds, are so many times as large."""
    names = [f"{sensor}_{field}" for sensor in ("gyro", "accel") for field in fields]
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


def poorer_rivals(run: Callable[[ImuSpec], Track], first: Track, spec: ImuSpec) -> list[Rival]:
    """Of IMUs poorer in each of the kinds the likeliest, where it fits the measurements better than chance explains.

    Of a log that begins with a known attitude, which need not show what the IMU is worth: a poorer one may fit as well. Arguments
    as of :func:`poorer_evidence`. Of an innovation x the ratio ``x^2 (1/v_0 - 1/v) - ln(v/v_0)`` has one maximum over its variance,
    and is nothing at v_0, that of the specification: once it falls, still poorer ones are no likelier.
    """
    found = []
    for key, fields in KINDS.items():
        likeliest = (1.0, 0.0, first)
        for poorer_still in _climb(run, first, spec, fields):
            if poorer_still[1] < likeliest[1]:
                break
            likeliest = poorer_still
        factor, ratio, other = likeliest
        if ratio > limit("rival"):
            found.append(Rival(ratio, key, {"factor": factor}, effect_of(first, other)))
    return found


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
        if ratio < -limit("ruled out"):
            return
        yield factor, ratio, track
