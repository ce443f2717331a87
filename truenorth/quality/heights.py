"""Whether a barometer counts heights from the level that the start and the receiver have: its pressure at sea level may not be set.

A barometer's height is off by ``44 330 m * 0.19 dp/p``, some 8.3 m for each hPa by which the pressure at sea level is not the one
that it has. Within its slow error the filter takes that up. Beyond it the first rows are rejected, until the height has drifted so
far that one of them passes: from there on height is the barometer's, with the sigma of a sound one. Where the start is not known
well, no row is rejected at all. So the barometer's heights are held against those of the receiver over the whole log, and its first
ones against the start's: ``d = h_baro - h``, with the sigma of both. Where most rows are further off than the limit, nobody knows
which of the two is right.

Where height is not kept by the barometer, the other sensor's level is in the answer, and that may be the wrong one as well: a
receiver's heights above the ellipsoid and those above the sea are N apart, the undulation of the geoid, -106 to 85 m. The answer
goes on, and its sigma of height counts the difference. What is further apart is the barometer's: in feet, or heights above the
place where it was switched on.

Source: ICAO Doc 7488, *Manual of the ICAO Standard Atmosphere*, 3rd ed. (1993), for height by pressure; N. Pavlis et al., "The
development and evaluation of the Earth Gravitational Model 2008", J. Geophys. Res. 117 (2012), for N.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Barometer, Gnss
from truenorth.aiding.sensors import BARO_SIGMA, height_sigma, place_axes
from truenorth.core.units import FOOT
from truenorth.quality.slow_aids import usual_bias
from truenorth.state.evidence import Evidence, contradiction, note
from truenorth.state.layout import DP
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

FEWEST = 5  # rows
FIRST = 5.0  # s of a barometer's rows that are held against the start
NEIGHBOURS = 5.0  # s, between fixes: heights in between are on the line from one to the next
GEOID = 106.0  # m; of its undulation, at the most
FEET = "height_in_feet"  # the remedy
MOST = 0.1  # of the rows may be as near as the sigmas say: an offset is there all the time


def level_evidence(barometer: Barometer, receiver: Gnss | None, track: Track) -> list[Evidence]:
    """That a barometer's heights are another level's, where height is kept by it.

    Parameters
    ----------
    barometer : Barometer
    receiver : Gnss, optional
        Its heights are not used; they are compared.
    track : Track
        With what the barometer's rows said against the prediction.

    Returns
    -------
    list of Evidence
        None, or one: against the receiver's heights, else against the start's.
    """
    if receiver is not None and (found := _apart("height.apart", *_of_both(barometer, receiver))):
        return found
    rows = next((r for r in track.residuals if r.name == "barometer"), None)
    return [] if rows is None else _at_first(rows, _time_of(barometer), barometer.record.alt)


def either_level(barometer: Barometer, receiver: Gnss, track: Track) -> tuple[list[Evidence], Array]:
    """That a barometer by which height is not kept has another level than the receiver, and by how much sigmas grow for it.

    No answer is refused for a sensor that it does not use. Nor is the level that it does use known to be right: by as much as both
    are apart, where that is beyond chance and no more than a geoid's undulation, height may be off.

    Returns
    -------
    evidence : list of Evidence
    growth : (K, 9) array
        Times one sigma of phi, dv and dp, along the way; ones but for height.
    """
    growth = np.ones((len(track), 9))
    found = _apart("height.either", *_of_both(barometer, receiver), limit("doubt"), partial(note, urgent=True))
    for item in found:
        apart, sigma, own = float(item.figures["apart"]), float(item.figures["sigma"]), track.sigma[:, DP.stop - 1]
        if item.remedies == (FEET,) or abs(apart) > GEOID + limit("doubt") * sigma:
            return [replace(item, key="height.apart")], growth
        growth[:, DP.stop - 1] = np.hypot(1.0, apart / np.where(own > 0.0, own, np.inf))
    return found, growth


def _time_of(barometer: Barometer) -> Array:
    """When its heights were, s."""
    return barometer.record.time - (barometer.mounting or barometer.usual).latency


def _of_both(barometer: Barometer, receiver: Gnss) -> tuple[Array, Array, Array]:
    """A barometer's heights, those of a receiver at their times, and the sigma of both together."""
    record, mounting = barometer.record, barometer.mounting or barometer.usual
    other, sigma = _heights_of(receiver, _time_of(barometer))
    noise = BARO_SIGMA if mounting.noise is None else mounting.noise
    own = noise if record.sigma is None else np.where(np.isfinite(record.sigma), record.sigma, noise)
    arms = float(np.linalg.norm(mounting.lever_arm))
    return record.alt, other, np.sqrt(sigma**2 + own**2 + mounting.slow**2 + arms**2)


def _heights_of(receiver: Gnss, time: Array) -> tuple[Array, Array]:
    """Heights of a receiver at these times and their sigma, its slow error and its arm counted; NaN where no fixes are near."""
    record, mounting = receiver.record, receiver.mounting or receiver.usual
    there = record.has_position & np.isfinite(record.alt)
    if there.sum() < FEWEST:
        return np.full(len(time), np.nan), np.ones(len(time))
    at = record.time[there] - mounting.latency
    slow = usual_bias(record) * place_axes(record)[2] if mounting.bias_sigma is None else mounting.bias_sigma
    arm = float(np.hypot(np.linalg.norm(mounting.lever_arm), mounting.lever_arm_sigma))
    after = np.clip(np.searchsorted(at, time), 1, len(at) - 1)
    inside = (time >= at[0]) & (time <= at[-1]) & (at[after] - at[after - 1] <= NEIGHBOURS)
    sigma = np.sqrt(np.interp(time, at, height_sigma(record)[there]) ** 2 + slow**2 + arm**2)
    return np.where(inside, np.interp(time, at, record.alt[there]), np.nan), sigma


def _at_first(rows: Residuals, time: Array, alt: Array) -> list[Evidence]:
    """Of the first rows, against what the start and the IMU say."""
    first = np.arange(len(rows.time)) < max(FEWEST, int(np.sum(rows.time < rows.time[:1] + FIRST)))
    measured = np.interp(rows.stamp[first], time, alt)
    return _apart("height.first", measured, measured + rows.innovation[first, 0], rows.sigma[first, 0])


def _apart(
    key: str,
    measured: Array,
    other: Array,
    sigma: Array,
    least: float = limit("heights"),
    said: Callable[..., Evidence] = contradiction,
) -> list[Evidence]:
    """Evidence that heights are further from others than both can be wrong, by `least` times the `sigma` of both together."""
    off = measured - other
    there = np.isfinite(off)
    if there.sum() < FEWEST or np.quantile(np.abs(off / sigma)[there], MOST) <= least:
        return []
    in_feet = np.median(np.abs((FOOT * measured - other) / sigma)[there]) < limit("by chance")
    remedy = FEET if in_feet else key.replace("height.", "level.")
    return [said(key, remedy, apart=float(np.median(off[there])), sigma=float(np.median(sigma[there])))]
