"""`truenorth reproduce in_flight`: the slave calibrated in the air before its release. Related work of system 2.

A tilt and a level accelerometer's bias act alike in straight flight, ``dv' = f x phi + C nabla``, and so do heading and the
mounting; a turn moves the bias in n and leaves the tilt, an acceleration shows heading. After the release nothing aids the
slave, and what is left grows: ``dp = nabla t^2 / 2`` of a level accelerometer's bias, ``g eps t^3 / 6`` of a gyro's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.alignment.transfer import align_transfer
from truenorth.core.attitude import misalignment
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.figures.style import COLOURS
from truenorth.papers.drawing import sheet
from truenorth.papers.study import Study
from truenorth.papers.table import Table
from truenorth.papers.texts import read_texts
from truenorth.records import MasterRecord
from truenorth.records.calibration import Calibration
from truenorth.records.motion import Moving
from truenorth.simulation.scenario import Scenario, read_scenario
from truenorth.simulation.streams import stream
from truenorth.state.layout import DP
from truenorth.state.state import State
from truenorth.state.track import Track
from truenorth.strapdown.level import mechanise

Array = NDArray[np.float64]

RUNS = 30
RELEASE = 180.0  # s
MOUNTING = float(np.radians(1.0))  # one sigma of each angle, drawn for each flight
STREAM = 322
NAMES = {"calibrated": "attitude and biases handed over", "attitude": "attitude alone"}
CASES = {"manoeuvres": "turns and an acceleration", "straight": "straight flight"}

TEXTS = read_texts(__file__)
RULES = TEXTS.rules


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count, table = runs or RUNS, Table()
    curves: dict[tuple[str, str], Array] = {}
    time = np.zeros(0)
    for number, (case, scenario) in enumerate(scenarios().items()):
        motion, found = scenario.build_motion(), []
        ideal = scenario.ideal()
        for run in range(count):
            progress(f"{case}: flight {run + 1} of {count}")
            log = scenario.simulate(seed=seed, run=run, number=number, ideal=ideal)
            seat = mounted(scenario, MOUNTING * stream(seed, number, run, STREAM).standard_normal(3))
            master = seat.simulate_aiding(seed=seed, run=run, number=number)["master"].record
            time, one = released(log.record, master, scenario, motion, log.errors.gyro_bias, log.errors.accel_bias)
            found.append(one)
        _add(table, case, found, time)
        for method in NAMES:
            curves[case, method] = np.stack([one[method] for one in found])
    return TEXTS.study(table, {"released": draw_released(time - RELEASE, curves)})


def scenarios() -> dict[str, Scenario]:
    """The flight with its manoeuvres, and straight on until the turn after the release."""
    usual = read_scenario("transfer_release")
    content = usual.to_mapping()
    legs = [{"kind": "straight", "duration": f"{RELEASE + 20.0} s"}, *content["motion"]["legs"][-2:]]
    return {"manoeuvres": usual, "straight": read_scenario({**content, "motion": {**content["motion"], "legs": legs}})}


def mounted(scenario: Scenario, angles: Array) -> Scenario:
    """The scenario with the slave in the aircraft at these angles (heading, pitch, roll; rad), which nobody knows."""
    content = scenario.to_mapping()
    seat = [f"{angle!r} deg" for angle in np.degrees(angles).tolist()]
    return read_scenario({**content, "master": {**content["master"], "mounting": seat}})


def released(
    record: Any, master: MasterRecord, scenario: Scenario, motion: Moving, gyro_bias: Array, accel_bias: Array
) -> tuple[Array, dict[str, Any]]:
    """Align and calibrate up to the release, then navigate freely.

    Returns
    -------
    time : (K,) array, s
        Since the start, after the release.
    found : dict
        Horizontal error (K,) in m by method; errors of biases and heading at the release with their sigmas, by name.
    """
    before = master[: int(np.searchsorted(master.time, RELEASE))]
    answer = align_transfer(
        record.between(None, RELEASE), before, scenario.imu_spec, matching="both", mounting_sigma=MOUNTING
    )
    assert answer.transfer is not None
    at = motion.states(np.array(answer.time))
    C = answer.C_nb
    phi_u = float(misalignment(C, at.C_nb)[2])
    rest = record.between(answer.time + 0.5 * record.interval, None)
    start = State.at(C, at.lat, at.lon, at.alt, answer.transfer.v_n)
    found: dict[str, Any] = {
        "gyro": (answer.gyro_bias - gyro_bias, answer.gyro_bias_sigma),
        "accel": (answer.accel_bias - accel_bias, answer.accel_bias_sigma),
        "heading": (phi_u, float(np.sqrt(answer.phi_covariance[2, 2]))),
    }
    time = np.zeros(0)
    known = {
        "calibrated": Calibration(gyro_bias=answer.gyro_bias, accel_bias=answer.accel_bias),
        "attitude": Calibration(),
    }
    for method, calibration in known.items():
        every = round(1.0 / record.interval)
        out = mechanise(calibration.apply(rest), start, altitude="fixed", every=every)
        east, north, _ = out.errors_against(Track.along(motion.states(out.time)))[:, DP].T
        found[method], time = np.hypot(east, north), out.time
    return time, found


def _add(table: Table, case: str, found: list[dict[str, Any]], time: Array) -> None:
    common: dict[str, Any] = {"noise": "random_walk"}
    for method in NAMES:
        table.errors(
            case, method, "place", np.array([f[method][-1] for f in found]), "m", time=round(time[-1]), **common
        )
    for name, unit, scale in (("gyro", "deg/h", DEG_PER_HOUR), ("accel", "ug", MICRO_G)):
        errors, sigmas = (np.array([f[name][i] for f in found]) / scale for i in (0, 1))
        for i, axis in enumerate("xyz"):
            quantity = f"{name}_bias_{axis}"
            table.errors(case, "calibrated", quantity, errors[:, i], unit, sigmas[:, i], time=RELEASE, **common)
        whole = np.sqrt(np.mean(errors**2, axis=1))
        level = np.sqrt(np.mean(errors[:, :2] ** 2, axis=1))
        table.errors(case, "calibrated", f"{name}_bias", whole, unit, time=RELEASE, **common)
        table.errors(case, "calibrated", f"{name}_bias_level", level, unit, time=RELEASE, **common)
    arcmin = np.radians(1.0 / 60.0)
    off, claimed = (np.array([f["heading"][i] for f in found]) / arcmin for i in (0, 1))
    table.errors(case, "calibrated", "heading", off, "arcmin", claimed, time=RELEASE, **common)


def draw_released(since: Array, curves: Mapping[tuple[str, str], Array]) -> Figure:
    """RMS of the place's error after the release."""
    with sheet(9.0, 4.2, legend=2) as (figure, ax):
        for number, ((case, method), errors) in enumerate(curves.items()):
            rms = np.sqrt(np.mean(errors**2, axis=0))
            label, dash = f"{NAMES[method]}, {CASES[case]}", "-" if case == "manoeuvres" else "--"
            ax.plot(since, rms, dash, color=COLOURS[number % 2], linewidth=1.2, label=label)
        ax.set(
            xlabel="time since the release, s", ylabel="place, m", xlim=(0.0, since[-1]), yscale="log", ylim=(0.1, None)
        )
    return figure
