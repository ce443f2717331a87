"""`truenorth reproduce lag_fusion`: one central filter of sensors that are late and out of step. Related work of system 2.

Each row is taken at its own time: what the filter knew then is carried on to now with the row in it, so that the answer is that
of rows in the order in which they were measured. A lag that is not known is a state, seen by what the vehicle does in it:
``z = h(x(t - tau)) + noise``, so that its column is minus the derivative of what is measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.aiding.sensors import from_gnss, from_odometer
from truenorth.aiding.source import Aiding
from truenorth.core import earth
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.errors.model import InsModel
from truenorth.estimate.events import Setting
from truenorth.estimate.run import begin, go_on, navigate_track, with_states
from truenorth.figures.style import COLOURS
from truenorth.papers.drawing import sheet
from truenorth.papers.study import Study
from truenorth.papers.table import Table
from truenorth.papers.texts import read_texts
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import Scenario, read_scenario
from truenorth.simulation.streams import stream
from truenorth.state.layout import DP, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.prior import prior_covariance
from truenorth.state.state import Start
from truenorth.state.track import Track
from truenorth.strapdown.increments import ImuRows

Array = NDArray[np.float64]

RUNS = 30
STREAM = 321
LEVEL, HEADING, VELOCITY, PLACE = math.radians(0.1), math.radians(2.0), 0.1, 1.0  # sigmas of the start
LAG = 0.5  # s, sigma of a lag that is a state
LATER, JUDGED = (
    100.0,
    250.0,
)  # s: errors are counted from then on, and held against their sigmas; at the end nothing is on its way
NAMES = {
    "in_time": "no lag",
    "real_time": "lag known, what has come by now",
    "own_time": "lag known, all rows",
    "states": "lag a state",
    "ignored": "lag ignored",
    "shared": "two filters fused",
}
ARCMIN = math.radians(1.0 / 60.0)
SHOWN = [DP.start, DP.start + 1, PHI.stop - 1]  # place east and north, and heading
HALF_A_ROW = 0.5 / 7.0  # s: an odometer's row holds at the middle of its interval
KEPT = ("time", "C_nb", "v_n", "position", "sensors", "P")  # of a track

TEXTS = read_texts(__file__)
RULES = TEXTS.rules


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count, table, late = runs or RUNS, Table(), read_scenario("late_sensors")
    content = late.to_mapping()
    sensors = {name: {**content[name], "latency": "0 s"} for name in ("odometer", "gnss")}
    prompt = read_scenario({**content, **sensors})
    kept: dict[str, list[tuple[Array, Array, Array]]] = {name: [] for name in NAMES}
    for run in range(count):
        progress(f"drive {run + 1} of {count}")
        for name, found in one(late, prompt, seed, run).items():
            kept[name].append(found)
    time = np.arange(1.0, late.duration + 0.5)
    after = time > LATER
    for name, runs_of in kept.items():
        errors, sigmas, lags = (np.stack(part) for part in zip(*runs_of, strict=True))
        window: dict[str, Any] = {"time": float(time[-1]), "start": LATER}
        place = np.sqrt(np.mean(np.sum(errors[:, after, :2] ** 2, axis=2), axis=1))
        heading = np.sqrt(np.mean(errors[:, after, 2] ** 2, axis=1))
        table.errors("traffic", name, "place", place, "m", **window)
        table.errors("traffic", name, "heading", heading / ARCMIN, "arcmin", **window)
        for i, (quantity, unit, scale) in enumerate(
            (("east", "m", 1.0), ("north", "m", 1.0), ("heading", "arcmin", ARCMIN))
        ):
            at = int(np.searchsorted(time, JUDGED))
            table.errors(
                "traffic", name, quantity, errors[:, at, i] / scale, unit, sigmas[:, at, i] / scale, time=JUDGED
            )
        if name == "states":
            for i, quantity in enumerate(("odometer_lag", "gnss_lag")):
                table.errors("traffic", name, quantity, lags[:, i], "s", time=float(time[-1]))
    curves = {name: np.stack([errors for errors, _, _ in runs_of]) for name, runs_of in kept.items()}
    return TEXTS.study(table, {"fusion": draw_fusion(time, curves)})


def one(late: Scenario, prompt: Scenario, seed: int, run: int) -> dict[str, tuple[Array, Array, Array]]:
    """Of one drive: errors (K, 3) east, north (m) and heading (rad) at each second, their sigmas, and errors of both lags (2,)."""
    log, logs = late.simulate(seed=seed, run=run), late.simulate_aiding(seed=seed, run=run)
    there, rng = late.build_motion(seed=seed, run=run), stream(seed, 0, run, STREAM)
    at = there.states(np.array(0.0))
    phi = np.array([LEVEL, LEVEL, HEADING]) * rng.standard_normal(3)
    spec = late.imu_spec
    P = prior_covariance((LEVEL, LEVEL, HEADING), VELOCITY, PLACE, spec.constant_variance)
    v = at.v_n + VELOCITY * rng.standard_normal(3)
    R_M, R_N = earth.radii(float(at.lat))
    dp = PLACE * rng.standard_normal(3)
    place = float(at.lat) + dp[1] / R_M, float(at.lon) + dp[0] / (R_N * math.cos(float(at.lat))), float(at.alt) + dp[2]
    start = Start(0.0, dcm_from_rotation_vector(-phi) @ at.C_nb, v, *place, np.zeros(3), np.zeros(3), P)
    lags = {name: float(spec.latency) for name, spec in late.aiding_specs.items()}
    truth = Track.along(there.states(np.arange(1.0, late.duration + 0.5)))

    def aided(source: Scenario, use: tuple[str, ...], known: bool, sigma: float) -> tuple[InsModel, list[Aiding]]:
        records = logs if source is late else source.simulate_aiding(seed=seed, run=run)
        sits = {
            name: Mounting(latency=lags[name] if known and source is late else 0.0, latency_sigma=sigma, gate=0.0)
            for name in use
        }
        aiding: list[Aiding] = []
        if "odometer" in use:
            wheel = replace(sits["odometer"], noise=0.05, slip=0.05, compliance=0.0)
            aiding += from_odometer(records["odometer"].record, wheel)
        if "gnss" in use:
            aiding += from_gnss(records["gnss"].record, sits["gnss"])
        return with_states(InsModel.from_spec(spec), aiding), aiding

    def track(source: Scenario, use: tuple[str, ...], known: bool = True, sigma: float = 0.0) -> tuple[Track, Array]:
        model, aiding = aided(source, use, known, sigma)
        found = navigate_track(log.record, start, model, aiding, interval=0.1, every=10)
        names = [group.name for group in model.groups]
        states = [found.layout.slice_of(n) for n in names if "lat" in n or "lag" in n]
        left = np.array([float(found.sensors[-1, s.start]) for s in states if s is not None])
        return found, left

    def against(found: Track) -> tuple[Array, Array]:
        last = found[-len(truth) :]
        return last.errors_against(truth)[:, SHOWN], last.sigma[:, SHOWN]

    both, none = ("odometer", "gnss"), np.full(2, np.nan)
    model, aiding = aided(late, both, True, 0.0)
    waits = [lags["gnss"] if source.name.startswith("GNSS") else lags["odometer"] + HALF_A_ROW for source in aiding]
    result = {
        "in_time": (*against(track(prompt, both)[0]), none),
        "real_time": (*against(as_it_came(log.record, start, model, aiding, waits)), none),
        "own_time": (*against(track(late, both)[0]), none),
        "ignored": (*against(track(late, both, known=False)[0]), none),
    }
    found, left = track(late, both, False, LAG)
    result["states"] = (*against(found), left - np.array([lags["odometer"], lags["gnss"]]))
    (a, s), (b, r) = (against(track(late, (name,))[0]) for name in both)
    weight = r**2 / (s**2 + r**2)
    result["shared"] = (weight * a + (1.0 - weight) * b, 1.0 / np.sqrt(1.0 / s**2 + 1.0 / r**2), none)
    return result


def as_it_came(
    record: ImuRecord, start: Start, model: InsModel, aiding: Sequence[Aiding], waits: Sequence[float]
) -> Track:
    """The answers of each second by the rows that have come until then; `waits` (s) are those of the sources.

    The loop stays a second behind; each answer goes on from there with what has come, and is not gone on from.
    """
    step = record.interval
    second = round(1.0 / step)
    setting = Setting(model, tuple(_rows(source, np.zeros(0, np.intp)) for source in aiding), second // 10, 10)
    state = begin(setting, start, float(record.time[0]) - step, step)
    answers = []
    for end in range(second, len(record) + 1, second):
        now, part = float(record.time[end - 1]), slice(end - second, end)
        samples = ImuRows(record.time[part], record.gyro[part], record.accel[part], record.kind, record.source)
        new = [np.flatnonzero((source.time > now - 1.0) & (source.time <= now)) for source in aiding]
        come = [k[s.time[k] + wait <= now] for s, k, wait in zip(aiding, new, waits, strict=True)]
        answers.append(
            go_on(setting, state, samples, [_rows(s, k) for s, k in zip(aiding, come, strict=True)], last=True)[1]
        )
        state = go_on(setting, state, samples, [_rows(s, k) for s, k in zip(aiding, new, strict=True)])[0]
    ends: dict[str, Any] = {name: np.concatenate([getattr(a, name)[-1:] for a in answers]) for name in KEPT}
    return replace(answers[-1], **ends)


def _rows(source: Aiding, at: NDArray[np.intp]) -> Aiding:
    return replace(source, time=source.time[at], measured=source.measured[at], sigma=source.sigma[at])


def draw_fusion(time: Array, curves: Mapping[str, Array]) -> Figure:
    """RMS of place and heading over time."""
    with sheet(11.0, 4.2, 1, 2, legend=len(NAMES)) as (figure, (place, heading)):
        for (name, errors), colour in zip(curves.items(), COLOURS, strict=False):
            rms = np.sqrt(np.mean(errors**2, axis=0))
            place.plot(time, np.hypot(rms[:, 0], rms[:, 1]), color=colour, linewidth=1.0, label=NAMES[name])
            heading.plot(time, rms[:, 2] / ARCMIN, color=colour, linewidth=1.0)
        place.set(yscale="log", xlabel="time, s", ylabel="place, m", xlim=(0.0, time[-1]))
        heading.set(yscale="log", xlabel="time, s", ylabel="heading, arcmin", xlim=(0.0, time[-1]))
    return figure
