"""Innovations of any filter as evidence: how many were rejected, their size, colour, and steps."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.chi_square import chi_square_limit
from truenorth.quality.led_away import led_away_evidence
from truenorth.quality.whiteness import CHANCE, FEWEST, whiteness
from truenorth.state.evidence import OUTPUTS, Effect, Evidence, Figure, contradiction, note
from truenorth.state.limits import limit
from truenorth.state.track import Residuals

Array = NDArray[np.float64]

SCHULER = 5064.0  # s
NO_ROTATION = "zero rotation"  # that the gyros show themselves
REST = ("zero velocity", NO_ROTATION)
BASELINE = "GNSS heading"  # of two antennas
BODY = ("odometer", "velocity log", *REST)


def mean_nis(source: Residuals) -> float | None:
    """Mean of NIS over its number of rows, rejected measurements left out: 1 where the model is right."""
    if not source.used.any():
        return None
    return float(np.sum(source.nis[source.used]) / np.sum(source.rows[source.used]))


def largest_nis(rows: int) -> float:
    """Beyond which a mean NIS of so many rows is neither of a sound model nor chance: a few rows scatter."""
    return max(limit("nis"), chi_square_limit(CHANCE, rows) / rows)


def innovation_evidence(
    sources: Iterable[Residuals],
    sigma: Effect,
    *,
    by_motion: bool = False,
    in_sigma: Container[str] = (),
    given: bool = False,
) -> list[Evidence]:
    """What the innovations of each source say of the model.

    Parameters
    ----------
    sigma : Effect
        Of the answer, one sigma of each output: what grows.
    by_motion : bool
        Whether heading comes from motion alone: velocities in body axes then have no part in it.
    in_sigma : container of str
        Sources whose slow errors are in sigma already: their colour is not counted again.
    given : bool
        The sources are a few measurements that somebody gives and means. One that is rejected is an outlier where a later one
        agrees with the answer again; the last one contradicts the answer at the end.
    """
    sources = list(sources)
    found = [note("innovations.late", name=source.name, late=source.passed) for source in sources if source.passed]
    sources = [source for source in sources if len(source.time)]
    at_rest = any(source.name in REST and _mostly_rejected(source) for source in sources)
    for source in sources:
        count = len(source.time)
        rejected = int(np.sum(~source.used))
        if given and (_mostly_rejected(source) or not source.used[-1]):
            largest = math.sqrt(float(source.nis[~source.used].max()))
            found.append(
                contradiction(
                    "innovations.given",
                    "given",
                    "specification",
                    name=source.name,
                    rejected=rejected,
                    count=count,
                    largest=largest,
                )
            )
        elif _mostly_rejected(source):
            size = float(np.median(np.sqrt(np.nansum(source.innovation**2, axis=1))))
            where = _elsewhere(source)
            found.append(
                contradiction(where[0], where[1], name=source.name, rejected=rejected, count=count, distance=where[2])
                if where is not None
                else contradiction(
                    "innovations.rejected",
                    *_suspects(source, at_rest),
                    name=source.name,
                    rejected=rejected,
                    count=count,
                    scatter=size,
                    unit=source.unit,
                )
            )
        elif rejected:
            found.append(note("innovations.outliers", name=source.name, rejected=rejected, count=count))
        nis = mean_nis(source)
        if nis is not None and nis > largest_nis(int(source.rows[source.used].sum())):
            found.append(contradiction("innovations.size", "specification", name=source.name, factor=math.sqrt(nis)))
        else:
            found += [] if source.name in in_sigma else _growth(source, sigma, by_motion)
            found += led_away_evidence(source)
        if (outside := source.outside - source.passed) > 0:
            found.append(note("innovations.outside", name=source.name, outside=outside))
    return found


def residual_evidence(sources: Iterable[Residuals], sigma: Effect, memory: float) -> list[Evidence]:
    """What is left between an answer and its sources, where that is slow by the method's own nature: its size alone is judged.

    Parameters
    ----------
    sigma : Effect
        Of the answer.
    memory : float, s
        For which residuals are correlated: so many of them are independent; a constant or Schuler's period at least.
    """
    found = []
    for source in sources:
        if len(source.time) < FEWEST:
            continue
        squares = (source.innovation / source.sigma) ** 2
        size = math.sqrt(float(np.nanmean(squares)))
        length = float(source.time[-1] - source.time[0])
        apart = min(max(memory, SCHULER), length)
        rows = max(round(2.0 * length / apart), 1)
        if size**2 > chi_square_limit(CHANCE, rows) / rows:
            grows = math.sqrt(size**2 - 1.0)
            effect = Effect(**{name: grows * own for name, own in sigma.items() if math.isfinite(own)})
            figures: dict[str, Figure] = {"name": source.name, "size": size}
            found.append(Evidence("innovations.left", figures, "known", effect))
    return found


def contradicted(sources: Iterable[Residuals]) -> bool:
    """Whether most of what one of them measured contradicts the track."""
    return any(map(_mostly_rejected, sources))


def _mostly_rejected(source: Residuals) -> bool:
    return int(np.sum(~source.used)) > limit("rejected") * len(source.time)


def _suspects(source: Residuals, at_rest: bool) -> tuple[str, ...]:
    """What to look at first: rest has no axes, unit or clock, and where it contradicts the track, so does the IMU."""
    if source.name in REST:
        return ("specification",)
    return ("specification", "source") if at_rest else ("source", "specification")


def _elsewhere(source: Residuals) -> tuple[str, str, float] | None:
    """What places say, its remedy, and how far they lie from the track, m, where all do in one direction and by one distance.

    Of two antennas' headings, by how much they are turned from it, rad, where all are by one angle.
    """
    if source.name == BASELINE:
        return _turned(source)
    first = source.innovation[: max(FEWEST // 3, len(source.time) // 4)]
    if source.unit != "m" or len(first) < 2:
        return None
    for key, remedy, axes in (("elsewhere", "place", slice(0, 2)), ("height", "height", slice(2, 3))):
        off = first[:, axes]
        if off.size and np.isfinite(off).all():
            away = float(np.linalg.norm(off.mean(axis=0)))
            if away > limit("one place") * float(np.linalg.norm(off.std(axis=0))):
                return f"innovations.{key}", remedy, away
    return None


def _turned(source: Residuals) -> tuple[str, str, float] | None:
    off = source.innovation[:, 0]
    off = off[np.isfinite(off)]
    if len(off) < FEWEST // 3:
        return None
    mean = np.exp(-1j * off).mean()  # measured less predicted, on the circle
    angle, scatter = float(np.angle(mean)), math.sqrt(max(-2.0 * math.log(max(abs(mean), 1e-9)), 0.0))
    return ("innovations.turned", "baseline", angle) if abs(angle) > limit("one place") * scatter else None


def _growth(source: Residuals, sigma: Effect, by_motion: bool) -> list[Evidence]:
    """By how much the innovations of a source say that sigma is too small."""
    used = source.used & (source.rows > 0)
    e = source.innovation[used] / source.sigma[used]
    times = source.time[used]
    interval = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    found = whiteness(e[:, np.isfinite(e).all(axis=0)], interval)
    if found.growth <= 1.0:
        return []
    more = dict.fromkeys(("velocity", "position"), math.sqrt(found.growth**2 - 1.0))
    more |= dict.fromkeys(("heading", "level"), math.sqrt(found.of_attitude**2 - 1.0))
    # Errors of places last for minutes (multipath, atmosphere, pressure), and spoil places, not attitude: receivers that smooth
    # their fixes have hardly anything else, which is no reason to refuse a log.
    places = source.unit == "m"
    touched: tuple[str, ...] = ("position",) if places else OUTPUTS
    if by_motion and source.name in BODY:
        touched = ("level", "velocity", "position")
    effect = Effect(
        **{name: more[name] * size for name, size in sigma.items() if name in touched and math.isfinite(size)}
    )
    figures: dict[str, Figure] = {
        "name": source.name,
        "size": found.size,
        "colour": found.colour,
        "growth": found.growth,
    }
    return [Evidence("innovations.coloured", figures, "hint" if places else "known", effect)]
