"""`truenorth reproduce damping`: the double filter compared with networks and a 15-state filter, and what of its claims holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.loop import Loop, eigenvalues, in_words
from truenorth.damping.networks import NO_NETWORK
from truenorth.damping.poles import filter_modes
from truenorth.damping.spectrum import earth_line, schuler_lines
from truenorth.errors.marine import DP, DV
from truenorth.papers.damping import choices, drawings
from truenorth.papers.damping.bias_signs import BIASES, left_by_filter1, search
from truenorth.papers.damping.choices import swept_signs
from truenorth.papers.damping.methods import AZIMUTH, NETWORK, SWITCH, Case, run_all, without_overlap
from truenorth.papers.damping.statistics import Signs, consistency, random_signs
from truenorth.papers.damping.switching import overshoot, switches
from truenorth.papers.damping.truth import HOUR, sail
from truenorth.papers.study import Study
from truenorth.papers.sweeps import dependences, draw_sweeps, swept
from truenorth.papers.table import OF_RUNS, Table
from truenorth.papers.texts import read_texts

Array = NDArray[np.float64]

TEXTS = read_texts(__file__)
RULES = TEXTS.rules
RUNS = 30
COARSE = 5.0  # s, epochs of the statistical cases
ERRORS = (0.0, -0.1, -0.2, -0.3, -0.4, -0.5)  # m/s, of the log
MAIN = "c-0.3"
STEADY = 20.0 * HOUR  # when tables 1 and 2 are read; the paper does not say
AROUND = 600.0  # s, over which the reading is averaged
WINDOWS = ((3, 6), (6, 12), (12, 18), (18, 24), (24, 48))  # h
QUANTITIES = ("phi_e", "phi_n", "phi_u", "v_e", "v_n", "lat", "lon")
UNITS = ("deg", "deg", "deg", "m/s", "m/s", "deg", "deg")
PHI_U = QUANTITIES.index("phi_u")
SCALE = np.array([1.0 if unit == "m/s" else math.degrees(1.0) for unit in UNITS])

# The paper's tables: phi_e, phi_n (1e-3 deg), phi_u, dL, dlon (deg), dv_e, dv_n (m/s), by the log's error.
TABLE_1 = {
    -0.1: (1.140, -3.100, -0.035, -0.014, -0.020, -0.081, -0.090),
    -0.2: (0.700, -4.500, -0.039, -0.016, -0.050, -0.142, -0.150),
    -0.3: (0.470, -4.300, -0.046, -0.009, -0.079, -0.150, -0.181),
    -0.4: (0.200, -4.250, -0.046, -0.006, -0.081, -0.131, -0.139),
    -0.5: (0.440, -4.000, -0.049, -0.006, -0.080, -0.110, -0.132),
}
TABLE_2 = {
    -0.1: (0.810, -5.901, -0.053, -0.033, -0.066, -0.092, -0.098),
    -0.2: (-2.001, -11.002, -0.077, -0.072, -0.150, -0.203, -0.198),
    -0.3: (-4.004, -13.705, -0.105, -0.111, -0.234, -0.296, -0.294),
    -0.4: (-6.301, -18.004, -0.126, -0.150, -0.318, -0.409, -0.391),
    -0.5: (-8.410, -21.201, -0.150, -0.187, -0.401, -0.504, -0.498),
}
IN_TABLE = ("phi_e", "phi_n", "phi_u", "lat", "lon", "v_e", "v_n")
TABLES = {"fused": TABLE_1, "filter1": TABLE_2}


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count = runs or RUNS
    progress("two days at sea")
    voyage = sail(1.0, seed)
    course = voyage.navigate(voyage.paper_errors())
    cases: dict[str, Case] = {}
    for c in ERRORS:
        progress(f"log error {c:g} m/s")
        cases[name_of(c)] = run_all(voyage, course, voyage.reference(c), workers=workers)
    main = cases[MAIN]
    switched = switches(voyage, main, voyage.reference(-0.3))
    over = overshoot(main, switched)
    sparse, sparse_sigma = without_overlap(voyage, main, voyage.reference(-0.3))
    short = voyage if full else sail(COARSE, seed)
    signs = random_signs(short, -0.3, count, seed, workers, progress)
    nees, heading = consistency(short, count, seed, progress)

    table = Table()
    for name, case in cases.items():
        _add_windows(table, name, case)
    for c in ERRORS[1:]:
        _add_readings(table, name_of(c), TABLES, c, {m: reading(cases[name_of(c)], m) for m in TABLES})
    _add_growth(table, cases)
    slopes = _slopes(cases)
    for quantity, slope, unit in zip(QUANTITIES, slopes, UNITS):
        paper = _paper_slope(quantity)
        table.value("c-0.1", "filter1", quantity, "slope", slope, unit, time=STEADY, paper=paper)
    lines, day = _lines(main)
    for statistic, period in (("min", lines[0]), ("max", lines[1]), ("value", day)):
        table.value("c0", "undamped", "period_min", statistic, period / 60.0, "min")
    table.value(MAIN, "all", "runtime", "max", max(case.runtime for case in cases.values()), "s")
    for way, value in over.items():
        table.value(MAIN, f"network_{way}", "overshoot", "value", value, "m/s")
    drawn: dict[str, Any] = {"time": 48 * HOUR, "noise": "random_walk"}
    table.errors("drawn", "augmented_long", "nees", nees, "1", statistics=("mean",), **drawn)
    ratio = float(OF_RUNS["rms"](heading))
    table.value("drawn", "augmented_long", "phi_u", "rms_over_sigma", ratio, "1", runs=count, **drawn)
    _add_signs(table, "random_signs", signs)
    for name, part in swept_signs(short, -0.3, min(count, choices.RUNS), seed, workers, progress).items():
        _add_signs(table, name, part)
    sweeps = swept(RULES, table, choices.SWEEPS)
    coarse = sail(COARSE, seed)
    fits = search(coarse, {c: _in_our_order(row) for c, row in TABLE_2.items()}, _read, progress)
    best = coarse.paper_errors() * _turned(fits[0].signs)
    for c in ERRORS[1:]:
        left = _read(coarse.truth.time, left_by_filter1(coarse, best, c))
        _add_readings(table, f"{name_of(c)}_best_signs", {"filter1": TABLE_2}, c, {"filter1": left})
    loops = {"undamped": Loop(NO_NETWORK), "network": NETWORK, "network and azimuth": AZIMUTH}
    modes = {name: eigenvalues(course, loop, round(STEADY)) for name, loop in loops.items()}
    of_filters = {
        name: filter_modes(course, main.filters[name], main.estimates[name].P)
        for name in ("filter1", "filter2", "augmented_long")
    }
    pictures = {
        "figure_3_attitude": drawings.draw_errors(main, "attitude"),
        "figure_4_position": drawings.draw_errors(main, "position"),
        "figure_5_velocity": drawings.draw_errors(main, "velocity"),
        "tables_1_and_2": drawings.draw_tables(
            {m: np.array([reading(cases[name_of(c)], m) for c in ERRORS[1:]]) for m in TABLES},
            {m: np.array([_in_our_order(row) for row in rows.values()]) for m, rows in TABLES.items()},
            ERRORS[1:],
        ),
        "windows": drawings.draw_windows(signs, count),
        "spectra": drawings.draw_spectra(main),
        "eigenvalues": drawings.draw_eigenvalues(modes, of_filters),
        "switching": drawings.draw_switching(main, switched),
        "open_choices": draw_sweeps(table, choices.SWEEPS, sweeps, drawings.PAPERS, "phi_u@18h-24h", "deg"),
    }
    words = [f"Eigenvalues, {name}: {in_words(found)}." for name, found in modes.items()]
    words += [f"Eigenvalues, {name} (its own gain at 48 h): {in_words(found)}." for name, found in of_filters.items()]
    late = (18, 24)  # h
    return TEXTS.study(
        table,
        pictures,
        [*words, *dependences(sweeps)],
        count=count,
        seconds=max(case.runtime for case in cases.values()),
        correlation=", ".join(f"{q} {r:+.2f}" for q, r in zip(QUANTITIES, _correlation(signs))),
        too_small=", ".join(f"{q} {r:.1f}" for q, r in zip(QUANTITIES, signs.fused_ratio)),
        sparse=_rms_in(main.time, sparse, late)[PHI_U],
        overlapping=window_rms(main, "filter2", late)[PHI_U],
        sparse_sigma=_last(sparse_sigma),
        overlapping_sigma=_last(main.estimates["filter2"].sigma),
        slope_e=1e3 * slopes[0],
        slope_n=1e3 * slopes[1],
        paper_e=1e3 * _paper_slope("phi_e"),
        paper_n=1e3 * _paper_slope("phi_n"),
        fused_v_e=reading(main, "fused")[DV.start],
        paper_v_e=TABLE_1[-0.3][5],
        best=str(fits[0]),
        misfit=fits[0].misfit,
        positive=next(f.misfit for f in fits if min(f.signs) > 0),
    )


def name_of(c: float) -> str:
    """Of a case, by the log's error."""
    return f"c{c:g}"


def reading(case: Case, method: str) -> Array:
    """(7,) mean error about 20 h, m/s and degrees."""
    return _read(case.time, case.errors[method])


def _read(time: Array, errors: Array) -> Array:
    return np.asarray(errors[np.abs(time - STEADY) <= AROUND].mean(axis=0) * SCALE)


def _in_our_order(row: Sequence[float]) -> list[float]:
    """A row of the paper's tables in the order of `QUANTITIES`, deg and m/s."""
    of = dict(zip(IN_TABLE, row))
    return [of[q] * (1e-3 if q in ("phi_e", "phi_n") else 1.0) for q in QUANTITIES]


def _turned(signs: Sequence[int]) -> Array:
    """(13,) factors of the paper's errors."""
    factors = np.ones(13)
    factors[list(BIASES.values())] = signs
    return factors


def window_rms(case: Case, method: str, hours: tuple[int, int]) -> Array:
    """(7,) RMS over a window, m/s and degrees."""
    return _rms_in(case.time, case.errors[method], hours)


def run_rms(signs: Signs, method: str, hours: tuple[int, int]) -> Array:
    """(N, 7) RMS of each run over a window, m/s and degrees."""
    return _rms_in(signs.time, signs.errors[method], hours)


def _rms_in(time: Array, errors: Array, hours: tuple[int, int]) -> Array:
    """(..., 7) RMS of errors (..., K+1, 7) over a window, m/s and degrees."""
    window = (time >= hours[0] * HOUR) & (time < hours[1] * HOUR)
    return np.asarray(np.sqrt(np.mean(errors[..., window, :] ** 2, axis=-2)) * SCALE)


def _last(sigma: Array) -> float:
    """Of heading, deg."""
    return math.degrees(sigma[-1, PHI_U])


def _add_windows(table: Table, name: str, case: Case) -> None:
    for method in case.errors:
        for hours in WINDOWS:
            for quantity, value, unit in zip(QUANTITIES, window_rms(case, method, hours), UNITS):
                table.value(name, method, quantity, "rms", value, unit, time=hours[1] * HOUR, start=hours[0] * HOUR)


def _add_readings(
    table: Table,
    name: str,
    papers: Mapping[str, Mapping[float, Sequence[float]]],
    c: float,
    ours: Mapping[str, Array],
) -> None:
    for method, rows in papers.items():
        for quantity, value, paper, unit in zip(QUANTITIES, ours[method], _in_our_order(rows[c]), UNITS):
            table.value(name, method, quantity, "value", value, unit, time=STEADY, paper=paper)


def _add_growth(table: Table, cases: Mapping[str, Case]) -> None:
    """Sizes of errors at 20 h, their change against a log without a constant error, and filter 2's largest change of all."""
    none = cases["c0"]
    for c in ERRORS[1:]:
        case = cases[name_of(c)]
        for method in ("filter1", "fused"):
            size, offset = reading(case, method), reading(case, method) - reading(none, method)
            for i, (quantity, unit) in enumerate(zip(QUANTITIES, UNITS)):
                table.value(name_of(c), method, f"size_{quantity}", "value", abs(size[i]), unit, time=STEADY)
                table.value(name_of(c), method, f"offset_{quantity}", "value", abs(offset[i]), unit, time=STEADY)
    for method in ("filter2", "filter2_raw"):
        change = [np.abs(cases[name_of(c)].errors[method] - none.errors[method]).max(axis=0) for c in ERRORS[1:]]
        share = np.max(np.array(change) / np.abs(none.errors[method]).max(axis=0))
        table.value("all", method, "largest_change", "value", float(share), "1")


def _slopes(cases: Mapping[str, Case]) -> Array:
    """(7,) change of filter 1's error at 20 h for each -.1 m/s."""
    at = np.array([reading(cases[name_of(c)], "filter1") for c in ERRORS])
    return np.polyfit(np.array(ERRORS) / -0.1, at, 1)[0]


def _paper_slope(quantity: str) -> float:
    column = IN_TABLE.index(quantity)
    scale = 1e-3 if quantity in ("phi_e", "phi_n") else 1.0
    return float(scale * np.polyfit(np.array(list(TABLE_2)) / -0.1, [row[column] for row in TABLE_2.values()], 1)[0])


def _lines(case: Case) -> tuple[tuple[float, float], float]:
    free = case.errors["undamped"]
    return schuler_lines(free[:, DV], case.course.interval), earth_line(free[:, DP.start], case.course.interval)[0]


def _add_signs(table: Table, case: str, signs: Signs) -> None:
    for method in signs.errors:
        for hours in WINDOWS:
            each = run_rms(signs, method, hours)
            for i, (quantity, unit) in enumerate(zip(QUANTITIES, UNITS)):
                window = {"time": hours[1] * HOUR, "start": hours[0] * HOUR}
                table.errors(case, method, quantity, each[:, i], unit, statistics=("rms",), **window)  # type: ignore[arg-type]


def _correlation(signs: Signs) -> Array:
    since = signs.time[-len(signs.correlation) :]
    window = (since >= 18 * HOUR) & (since < 24 * HOUR)
    return np.asarray(np.median(signs.correlation[window], axis=0))


assert SWITCH == 2.5 * HOUR  # the paper's t_0, which the captions name
