"""`truenorth reproduce transfer`: what is matched, with and without space-time states, late data, and what holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.comparison import paired
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.papers.errors import level
from truenorth.papers.study import Study
from truenorth.papers.sweeps import Sweep, dependences, draw_sweeps, swept
from truenorth.papers.table import Table
from truenorth.papers.texts import read_texts
from truenorth.papers.transfer.drawings import STATES, Panel, draw_biases, draw_level, draw_misalignment, draw_panels
from truenorth.papers.transfer.filtering import EPOCHS, METHODS, Errors, errors_of
from truenorth.papers.transfer.observability import seen_in
from truenorth.papers.transfer.truth import ARCMIN, ARM_SIGMA, BEGIN, END, STOP, TAU_SIGMA, Case, Flights

Array = NDArray[np.float64]

TEXTS = read_texts(__file__)
RULES = TEXTS.rules
RUNS = 100
KNOWN_DELAY = 0.2  # s, of the late master
DROP = (128.0, 138.0)  # s: its silence, in the turn
SPEED = 200.0  # m/s
TURN = (EPOCHS > BEGIN) & (EPOCHS <= STOP)
VELOCITY = ("states12", "states13", "states16", "oracle")
PAIR = ("states12", "states16", "states12_att", "states16_att")
LATE = ("ignored", "extrapolated", "past_state", "augmented")
MATCHED = tuple(f"{kind}_{name}" for kind in ("position", "acceleration") for name in ("states12", "states16"))
BOTH = (*VELOCITY, "states12_att", "states13_att", "states16_att", "oracle_att")

CASES = {
    "flat_turn": (Case("flat_turn", 0), (*BOTH, "attitude_only", *MATCHED)),
    "banked_turn": (Case("banked_turn", 1, "banked_turn"), (*BOTH, "attitude_only", *MATCHED)),
    "s_turn": (Case("s_turn", 2, "s_turn"), BOTH),
    "accelerate": (Case("accelerate", 3, "accelerate"), BOTH),
    "wing_rock": (Case("wing_rock", 4, "wing_rock"), BOTH),
    "flat_turn_no_error": (Case("flat_turn_no_error", 5, space_time="none"), VELOCITY),
    "flat_turn_random": (Case("flat_turn_random", 6, space_time="drawn"), VELOCITY),
    "late_master": (Case("late_master", 7, drop=DROP, extra_delay=KNOWN_DELAY), VELOCITY),
    "banked_turn_flexed": (Case("banked_turn_flexed", 8, "banked_turn", flexure=True), ("flexure", "states16_att")),
    "accelerate_10.5": (Case("accelerate_10.5", 9, "accelerate_10.5"), PAIR),
    "wing_rock_10.5": (Case("wing_rock_10.5", 10, "wing_rock_10.5"), PAIR),
    "late_known": (Case("late_known", 11, space_time="none", extra_delay=KNOWN_DELAY), LATE),
    "late_rough": (Case("late_rough", 12, extra_delay=KNOWN_DELAY), LATE),
}
# What the paper leaves open: the field of a method, and its values.
SWEEPS = {
    "noise": Sweep("flat_turn", "R", "velocity noise as believed, times the true", 1.0, (0.25, 0.5, 1.0, 2.0, 4.0)),
    "tau_sigma": Sweep("flat_turn", "P0_delay", "delay in P0, s", TAU_SIGMA, (0.01, 0.02, 0.05, 0.1, 0.3)),
    "arm_sigma": Sweep("flat_turn", "P0_arm", "lever arm in P0, m", ARM_SIGMA, (0.1, 0.3, 1.0, 3.0, 10.0)),
    "every": Sweep("flat_turn", "step", "rows that are taken, one in", 1, (1, 2, 5, 10)),
}
SWEPT_RUNS = 30  # at most
PANELS = {
    "matching": [
        [
            Panel(
                f"{case.replace('_', ' ')}, {states.removeprefix('states')} states",
                case,
                {states: "velocity", f"position_{states}": "position", f"acceleration_{states}": "acceleration"},
                heading,
            )
            for case in ("flat_turn", "banked_turn")
            for states in ("states12", "states16")
        ]
        for heading in (False, True)
    ],
    "late": [
        [
            Panel(words, case, {name: name.replace("_", " ") for name in LATE}, heading)
            for case, words in (("late_known", "200 ms, known"), ("late_rough", "30 ms of it unknown"))
        ]
        for heading in (False, True)
    ],
}
DRAWN = ("flat_turn", "banked_turn", "s_turn", "accelerate", "wing_rock")
Found = dict[tuple[str, str], Errors]


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count = runs or RUNS
    table = Table()
    found: Found = {}
    for name, (case, methods) in CASES.items():
        progress(f"{name}: {count} runs of {len(methods)} methods")
        for method, errors in errors_of(Flights(case, seed), methods, count, workers).items():
            found[name, method] = errors
            _add_errors(table, name, method, errors)
    flights, few = Flights(CASES["flat_turn"][0], seed), min(count, SWEPT_RUNS)
    for field, sweep in SWEEPS.items():
        progress(f"{sweep.label}: {few} runs")
        for value in sweep.values:
            changed = {name: replace(METHODS[name], **{field: value}) for name in ("states12", "states16")}  # type: ignore[arg-type]
            for method, errors in errors_of(flights, changed, few, workers).items():
                _add_errors(table, sweep.case_of(value), method, errors)
    _add_gains(table, found)
    progress("observability")
    seen = {name: seen_in(CASES[name][0]) for name in DRAWN}
    for name, words in seen.items():
        table.value(name, "states16", "rank", "value", words.rank, "1")
    sweeps = swept(RULES, table, list(SWEEPS.values()))
    drawings = {
        "figure_1": draw_misalignment(found["flat_turn", "states12"], "Figure 1: misalignment, 12 states"),
        "figure_2": draw_biases(found["flat_turn", "states12"], "Figure 2: error of the gyro biases, 12 states"),
        "figure_3": draw_misalignment(found["flat_turn", "states16"], "Figure 3: misalignment, 16 states"),
        "figure_4": draw_biases(found["flat_turn", "states16"], "Figure 4: error of the gyro biases, 16 states"),
        "level": draw_level(found, DRAWN),
        "matching": draw_panels(found, PANELS["matching"], "What is matched, RMS over the runs (grey: turn)"),
        "late": draw_panels(found, PANELS["late"], "A master 200 ms late, RMS over the runs (grey: turn)"),
        "open_choices": draw_sweeps(table, list(SWEEPS.values()), sweeps, STATES, "level@120-150"),
    }
    remarks = [*dependences(sweeps), *(f"{name.replace('_', ' ')}: {words}" for name, words in seen.items())]
    return TEXTS.study(table, drawings, remarks, flat_turn=str(seen["flat_turn"]), drop_from=DROP[0], drop_to=DROP[1])


def _add_errors(table: Table, case: str, method: str, errors: Errors) -> None:
    def add(name: str, e: Array, s: Array | None, unit: str, scale: float, **when: float) -> None:
        claimed = None if s is None else s / scale
        table.errors(case, method, name, e / scale, unit, claimed, noise="random_walk", **when)  # type: ignore[arg-type]

    def over(values: Array) -> Array:
        return np.asarray(np.sqrt(np.nanmean(values[:, TURN] ** 2, axis=tuple(range(1, values.ndim)))))

    tilts, tilts_sigma = errors.phi[..., :2], errors.sigma[..., :2]
    window = {"time": STOP, "start": BEGIN}
    add("level", over(tilts), over(tilts_sigma), "arcmin", ARCMIN, **window)
    add("gyro_bias_y", over(errors.gyro[..., 1]), over(errors.gyro_sigma[..., 1]), "deg/h", DEG_PER_HOUR, **window)
    square = np.nanmean(errors.nees[:, TURN], axis=1)
    table.errors(case, method, "nees", square, "1", statistics=("mean",), noise="random_walk", **window)  # type: ignore[arg-type]
    for at in (BEGIN, STOP, END):
        k = int(np.searchsorted(EPOCHS, at))
        quantities = {
            "level": (level(errors.phi[:, k]), level(errors.sigma[:, k]), "arcmin", ARCMIN),
            "heading": (errors.phi[:, k, 2], errors.sigma[:, k, 2], "arcmin", ARCMIN),
            "tau": (errors.tau[:, k], errors.tau_sigma[:, k], "s", 1.0),
        }
        for i, axis in enumerate("xyz"):
            quantities[f"gyro_bias_{axis}"] = (errors.gyro[:, k, i], errors.gyro_sigma[:, k, i], "deg/h", DEG_PER_HOUR)
            quantities[f"accel_bias_{axis}"] = (errors.accel[:, k, i], errors.accel_sigma[:, k, i], "ug", MICRO_G)
            quantities[f"lever_arm_{axis}"] = (errors.arm[:, k, i], errors.arm_sigma[:, k, i], "m", 1.0)
        for name, (e, s, unit, scale) in quantities.items():
            if np.isfinite(e).all():
                add(name, e, s, unit, scale, time=at)
        if np.isfinite(errors.nees[:, k]).all():
            table.errors(
                case, method, "nees", errors.nees[:, k], "1", statistics=("mean",), noise="random_walk", time=at
            )
        both = _forward(errors, k)
        if np.isfinite(both).all():
            add("lever_arm_y_and_speed_times_tau", both, None, "m", 1.0, time=at)


def _forward(errors: Errors, k: int) -> Array:
    """(runs,) error of the forward lever arm and the way flown in the delay together, m: what a steady turn tells."""
    return np.asarray(errors.arm[:, k, 1] + SPEED * errors.tau[:, k])


def level_in_turn(errors: Errors) -> Array:
    """(runs,) RMS of both tilts in the turn, arcmin."""
    return np.asarray(np.sqrt(np.nanmean(errors.phi[:, TURN, :2] ** 2, axis=(1, 2))) / ARCMIN)


def _add_gains(table: Table, found: Found) -> None:
    """Level of 12 states over level of 16, and of 16 over that of the oracle, run by run."""
    common = {"time": STOP, "start": BEGIN, "noise": "random_walk"}
    for case in CASES:
        for suffix in ("", "_att"):
            if (case, f"states12{suffix}") not in found:
                continue
            ours = level_in_turn(found[case, f"states16{suffix}"])
            gain = level_in_turn(found[case, f"states12{suffix}"]) / ours
            table.errors(case, f"gain{suffix}", "level", gain, "1", statistics=("median", "mean"), **common)  # type: ignore[arg-type]
            for other in (f"states12{suffix}", f"oracle{suffix}"):
                if (case, other) not in found:
                    continue
                runs, wins, _, ratio, _ = paired(ours, level_in_turn(found[case, other]))
                for statistic, value in (("win_rate", wins), ("ratio", ratio)):
                    name = f"states16{suffix} against {other}"
                    table.value(case, name, "level", statistic, value, "1", runs=runs, **common)  # type: ignore[arg-type]
