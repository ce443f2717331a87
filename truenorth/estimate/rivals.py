"""Do the sensors stay as the specification says? The same log once more with biases that wander, and which of the two it fits.

A bias that steps or drifts, a scale factor, a delay between sensors or a velocity that is slowly led astray: each looks to the
filter like biases that change faster than the specification allows. So it runs again with rivals, whose biases walk over the
log by as much as some of their own sigmas. Twice the logarithm of the likelihood ratio of a rival says whether the log fits it
better: by chance it exceeds c in less than exp(-c / 2) of sound logs, whatever the rival is (Markov's inequality). What the
answer moves by, and what the rival is less sure of, is the effect.

Source: R. Mehra and J. Peschon, "An innovations approach to fault detection and diagnosis in dynamic systems", Automatica 7 (1971).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.quality.density import burst_evidence
from truenorth.quality.whiteness import whiteness
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import ANY_EFFECT, NO_EFFECT, Effect, Evidence, Figure, Kind
from truenorth.state.layout import DP, DV
from truenorth.state.limits import limit, may_be_chance
from truenorth.strapdown.increments import without_gaps

if TYPE_CHECKING:
    from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

# By how many of its sigmas a bias walks over the log. Up the ladder as long as the log does not rule a walk out: larger ones
# are ruled out more.
LADDERS = {"gyro": (1.0, 5.0, 30.0, 200.0), "accel": (0.3, 1.5, 8.0)}
FEWEST = 20  # measurements of each sort that a comparison needs


class Walking(Protocol):
    """A model of white noise and of biases that walk."""

    @property
    def gyro_random_walk(self) -> float:
        """rad/sqrt(s)."""

    @property
    def accel_random_walk(self) -> float:
        """m/s/sqrt(s)."""

    @property
    def gyro_rate_walk(self) -> float:
        """rad/s/sqrt(s)."""

    @property
    def accel_rate_walk(self) -> float:
        """m/s^2/sqrt(s)."""


M = TypeVar("M", bound=Walking)


class Rival(NamedTuple):
    """Another course of the biases that fits the measurements better."""

    ratio: float  # twice the logarithm of a likelihood ratio, or of what is as rare by chance
    key: str
    figures: Mapping[str, Figure]
    effect: Effect
    chance: float = 1.0  # that it is right
    suspect: str = "specification"  # what would be at fault


def wandering_evidence(
    run: Callable[[M], Track],
    first: Track,
    model: M,
    spec: ImuSpec,
    span: float,
    without: Sequence[Callable[[M], Track]] = (),
    warming: Callable[[], list[Rival]] = list,
) -> list[Evidence]:
    """Whether biases that wander explain the measurements better, and what that does to the answer.

    A bias that steps makes the errors of a wheel seem to last. So each slow error that was taken from the innovations has rivals
    of its own: biases that wander, and a sensor without that error.

    Parameters
    ----------
    run : callable
        The same log with another model.
    first : track
        Of the model itself.
    model : InsModel or TransferModel
    spec : ImuSpec
        Its biases are the measure of the walks.
    span : float, s
        Length of the log.
    without : sequence of callable
        As `run`, each without one of the slow errors that the innovations have shown.
    warming : callable
        Biases of another course that fit better (:mod:`truenorth.estimate.warming`).

    Returns
    -------
    list of Evidence
        None, or one: of the rival that fits best, with the largest effect of those that fit better than chance explains.
    """
    if not any(int(np.sum(r.rows > 0)) >= FEWEST for r in first.residuals):
        return []
    found = warming()
    for of_other in (run, *without):
        # Without a slow error a log may fit worse, or better: neither is the walk's.
        least = 0.0 if of_other is run else likelihood_ratio(first.residuals, of_other(model).residuals)
        for sensor, ladder in LADDERS.items():
            found += _climb(of_other, first, model, spec, span, sensor, ladder, least)
    if not found:
        return []
    best = max(found, key=lambda item: item.ratio)
    shown, effect = NO_EFFECT, NO_EFFECT
    for other in found:
        shown = shown.or_larger(other.effect)
        effect = effect.or_larger(other.effect.times(math.sqrt(other.chance)))
    return [rival(best.key, best.figures, best.ratio, effect, best.suspect, shown)]


def rival(
    key: str, own: Mapping[str, Figure], ratio: float, effect: Effect, suspect: str, shown: Effect | None = None
) -> Evidence:
    """Another model that fits the measurements better: a hint where that may be chance, else an effect of known size.

    Parameters
    ----------
    key : str
    own : mapping
        Figures of this rival.
    ratio : float
        Twice the logarithm of the likelihood ratio.
    effect : Effect
        By what the answer moves with the rival.
    suspect : str
        What would be at fault.
    shown : Effect, optional
        The same, where `effect` counts by how likely the rival is.
    """
    said = effect if shown is None else shown
    figures: dict[str, Figure] = {
        **own,
        "ratio": ratio,
        "chance": limit("rival"),
        "heading": said.heading,
        "level": said.level,
    }
    kind: Kind = "hint" if may_be_chance(ratio) else "known"
    return Evidence(key, figures, kind, effect, (suspect,))


def _climb(
    run: Callable[[M], Track],
    first: Track,
    model: M,
    spec: ImuSpec,
    span: float,
    sensor: str,
    ladder: Sequence[float],
    least: float,
) -> list[Rival]:
    """Walks of a sensor's biases that the log fits better than the model, and than without a walk: that ratio is `least`."""
    sigma, name = math.sqrt(float(spec.bias_variance[0 if sensor == "gyro" else 3])), f"{sensor}_rate_walk"
    found, before = [], least
    for size in ladder:
        walk = math.hypot(getattr(model, name), size * sigma / math.sqrt(span))
        try:
            other = run(replace(model, **{name: walk}))  # type: ignore[type-var]  # a dataclass
        except DataError:  # the filter broke down: no explanation
            break
        ratio = likelihood_ratio(first.residuals, other.residuals)
        gained = ratio - max(least, 0.0)
        if gained > limit("rival"):
            found.append(Rival(gained, f"rival.{sensor}_wanders", {"size": size * sigma}, effect_of(first, other)))
        elif ratio < before - limit("ruled out"):
            break
        before = max(ratio, before)
    return found


def jump_evidence(run: Callable[[ImuRecord], Track], first: Track, record: ImuRecord) -> list[Evidence]:
    """Whether the gaps of a log are jumps of its clock: without them it fits the measurements better.

    Parameters
    ----------
    run : callable
        The same measurements with another record.
    first : track
        Of the record as it is.
    record : ImuRecord
        With its gaps bridged.
    """
    gaps = record.gaps[record.gaps > 0]
    if not gaps.size:
        return []
    try:
        ratio = likelihood_ratio(first.residuals, run(without_gaps(record)).residuals)
    except DataError:
        return []
    if ratio <= limit("drift"):
        return []
    figures: dict[str, Figure] = {
        "count": len(gaps),
        "lost": float(np.sum(record.steps[gaps] - record.interval)),
        "ratio": ratio,
    }
    return [Evidence("record.clock_jumps", figures, "unknown", ANY_EFFECT, ("common_clock",))]


def noise_evidence(run: Callable[[M], Track], first: Track, model: M, record: ImuRecord) -> list[Evidence]:
    """What noise for a while does to an answer on the move: its own walk, and what the filter makes of it.

    The filter takes for errors of attitude and biases what the noise does to velocity. With as much noise assumed all along it
    would not: what that moves the answer by is about what it has taken in. Of the walk itself the measurements leave no more than
    the sigma of such a filter.

    Parameters
    ----------
    run, first, model
        As of :func:`wandering_evidence`.
    record : ImuRecord
    """
    found = []
    for item in burst_evidence(record):
        name = "gyro_random_walk" if item.key == "noise.gyro_stretch" else "accel_random_walk"
        louder = {name: math.hypot(getattr(model, name), float(item.figures["density"]))}
        try:
            other = run(replace(model, **louder))  # type: ignore[type-var]  # a dataclass
            taken, left = moved(first, other), _of_states(other.sigma[-1, :9])
        except DataError:
            taken, left = NO_EFFECT, ANY_EFFECT
        walked = (min(a, b) for (_, a), (_, b) in zip(item.effect.items(), left.items(), strict=True))
        effect = Effect(*(max(a, b) for a, (_, b) in zip(walked, taken.items(), strict=True)))
        found.append(replace(item, figures={**item.figures, "heading": effect.heading}, effect=effect))
    return found


def counted_once(evidence: Sequence[Evidence]) -> list[Evidence]:
    """The same evidence, rivals with what coloured innovations do not add to sigma already: both see the same.

    Where the model is contradicted, rivals of it say nothing more and are left out. Where heading depends on the start
    (:mod:`truenorth.navigation.by_start`), filters differ by where each has led it, and likelihoods refuse none.
    """
    if any(item.kind == "unknown" for item in evidence):
        return [item for item in evidence if not item.key.startswith("rival.")]
    if any(item.key == "heading.by_start" for item in evidence):
        led = ("rival.", "delay.", "innovations.step")
        evidence = [replace(e, kind="hint") if e.key.startswith(led) else e for e in evidence]
    added = NO_EFFECT
    for item in evidence:
        if item.key == "innovations.coloured":
            added = added.joined(item.effect)

    def rest(effect: Effect) -> Effect:
        pairs = zip(effect.items(), added.items(), strict=True)
        return Effect(*(math.sqrt(max(e**2 - a**2, 0.0)) for (_, e), (_, a) in pairs))

    return [replace(e, effect=rest(e.effect)) if e.key.startswith("rival.") else e for e in evidence]


def misfit(residuals: Iterable[Residuals]) -> float:
    """Minus twice the log-likelihood of measurements, but for a constant."""
    return sum(float(np.sum(np.where(r.rows > 0, r.nis, 0.0)) + 2.0 * np.nansum(np.log(r.sigma))) for r in residuals)


def likelihood_ratio(
    first: Iterable[Residuals], rival: Iterable[Residuals], *, one_model: bool = False, whitened: bool = False
) -> float:
    """Twice the logarithm of the likelihood ratio, of each source as far as its measurements are independent.

    Measurements that both take count: outliers choose no model. A source whose innovations are ``f`` times as large as they
    should be, or are correlated so that a mean errs by ``f`` times as much, carries a share ``1 / f^2`` of its information.

    Parameters
    ----------
    first, rival : iterable of Residuals
    one_model : bool
        Both are of one model and of other readings of the log. Then their variances differ only by where errors are linear about,
        and both count with the one ``S`` between them: ``(e_1^2 - e_2^2) / S``, to first order in ``ln S_1 - ln S_2``. A wheel that
        is less noisy than it says would else prefer whatever narrows S: of a sound car, an eighth of whose S is noise, by 2 % in
        2400 rows or a ratio of 43.
    whitened : bool
        The rival is a slow error, which colours innovations itself: what colour it takes out of them is no reason to believe
        them less. The share is that of the whiter ones.
    """
    total = 0.0
    others = {r.name: r for r in rival}
    for r in first:
        other = others[r.name]
        _, at, of_other = np.intersect1d(r.stamp, other.stamp, return_indices=True)
        both = r.used[at] & other.used[of_other] & (r.rows[at] > 0) & (other.rows[of_other] == r.rows[at])
        at, of_other = at[both], of_other[both]
        if not len(at):
            continue
        e = r.innovation[at] / r.sigma[at]
        narrower = 2.0 * np.log(r.sigma[at] / other.sigma[of_other])
        if one_model:
            narrower *= 0.5 * (e**2 + (other.innovation[of_other] / other.sigma[of_other]) ** 2)
        share = whiteness(e[:, np.isfinite(e).all(axis=0)]).growth ** 2
        if whitened:
            left = other.innovation[of_other] / other.sigma[of_other]
            share = min(share, whiteness(left[:, np.isfinite(left).all(axis=0)]).growth ** 2)
        total += float(r.nis[at].sum() - other.nis[of_other].sum() + np.nansum(narrower)) / share
    return total


def moved(first: Track, other: Track) -> Effect:
    """By how much two tracks differ: in sigmas of the first, the RMS of the later half or the last, if larger, as sizes there.

    What changes late is in the last; a last one may be small by chance. Epochs that a delay has moved are compared with the
    other's nearest.
    """
    first, other = first.whole(), other.whole()
    half = slice(len(first.C_nb) // 2, None)
    near = nearest(other.time, first.time[half])
    off = np.abs(first[half].errors_against(other, near))
    sigma = first.sigma[half, :9]
    known = sigma > 0.0
    squares = np.where(known, off / np.where(known, sigma, 1.0), 0.0) ** 2
    ratio = np.sqrt(np.maximum(squares.mean(axis=0), squares[-1]))
    return _of_states(ratio * first.sigma[-1, :9])


def effect_along(first: Track, other: Track) -> Effect:
    """By how much two tracks differ at most, anywhere on the way: in sigmas of the first there, as sizes at its end."""
    first, other = first.whole(), other.whole()
    off = np.abs(first.errors_against(other, nearest(other.time, first.time)))
    sigma = first.sigma[:, :9]
    known = sigma > 0.0
    ratio = np.where(known, off / np.where(known, sigma, 1.0), 0.0).max(axis=0)
    return _of_states(ratio * first.sigma[-1, :9])


def nearest(time: Array, wanted: Array) -> NDArray[np.intp]:
    """Rows of ascending times that lie nearest to those wanted."""
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    return after - (wanted - time[after - 1] < time[after] - wanted)


def effect_of(first: Track, rival: Track) -> Effect:
    """What the answer moves by, and by what the rival is less sure."""
    more = np.sqrt(np.maximum(rival.sigma[-1, :9] ** 2 - first.sigma[-1, :9] ** 2, 0.0))
    return moved(first, rival).joined(_of_states(more))


def last_sizes(track: Track) -> Effect:
    """One sigma of each output at the end of a track."""
    return _of_states(track.sigma[-1, :9])


def _of_states(size: Array) -> Effect:
    """Sizes (9,) of attitude, velocity and position, the larger of each."""
    return Effect(float(size[2]), float(size[:2].max()), float(size[DV].max()), float(size[DP].max()))
