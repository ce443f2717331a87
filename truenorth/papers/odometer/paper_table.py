"""The paper's table 1 in the paper's own way, the difference to a static alignment after the drive, and in truth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import align
from truenorth.core.attitude import euler_from_dcm
from truenorth.papers.odometer.invariant import coarse_errors, run_invariant
from truenorth.papers.odometer.loop import run_method
from truenorth.papers.odometer.scenario import STOPPED, Drives, drive, with_stop
from truenorth.papers.table import Table

Array = NDArray[np.float64]

ARCMIN = math.radians(1.0) / 60.0
ANGLES = ("heading", "phi_e", "phi_n")  # of the table: heading, pitch and roll
PAPER = {
    "sgkf3": {"phi_e": 0.5657, "phi_n": 0.5582, "heading": 5.5541},
    "ckf": {"phi_e": 0.5921, "phi_n": 0.5907, "heading": 5.7304},
}  # arcmin, the standard deviation over three runs, of pitch, roll and heading
CHAIN_SIGMA = math.radians(3.0)


def add_paper_table(table: Table, runs: int, seed: int) -> None:
    """Drive, stop, align at rest for five minutes; compare the drive's alignment with that, and both with the truth."""
    scenario = with_stop()
    drives = drive(scenario, runs, seed, until=STOPPED)
    at_rest = _static(drives, seed)
    phi0 = coarse_errors(drives, 120.0)
    which, sigma = np.arange(runs), np.full(runs, CHAIN_SIGMA)
    true = _euler(drives.truth.C_nb[-1:])
    found: dict[str, Array] = {"static_reference": _euler(at_rest)}
    for method in PAPER:
        found[method] = _euler(run_method(drives, which, phi0, sigma, method).C_nb)
    found["invariant_ekf"] = _euler(run_invariant(drives, which, phi0, sigma).C_nb)
    common: dict[str, Any] = {"time": STOPPED, "noise": "random_walk"}
    for method, angles in found.items():
        off, against = _difference(angles, true), _difference(angles, found["static_reference"])
        for i, name in enumerate(ANGLES):
            table.errors("paper_table", method, name, off[:, i], "arcmin", statistics=("rms",), **common)
            if method != "static_reference":
                paper = PAPER.get(method, {}).get(name, math.nan)
                scatter = float(np.std(against[:, i], ddof=1))
                table.value("paper_table", method, name, "value", scatter, "arcmin", paper=paper, runs=runs, **common)


def _static(drives: Drives, seed: int) -> Array:
    """(R, 3, 3) of a static alignment over the five minutes after the drive."""
    ideal = drives.scenario.ideal()
    found = []
    for run in range(len(drives.records)):
        record = drives.scenario.simulate(seed=seed, run=run, ideal=ideal).record
        rest = record.between(STOPPED, drives.scenario.duration)
        found.append(align(rest, drives.position, drives.spec, method="oba").C_nb)
    return np.stack(found)


def _euler(C_nb: Array) -> Array:
    """(R, 3) heading, pitch, roll, rad."""
    return np.stack(euler_from_dcm(C_nb), axis=-1)


def _difference(one: Array, other: Array) -> Array:
    """Of angles, arcmin."""
    return np.asarray(((one - other + math.pi) % (2.0 * math.pi) - math.pi) / ARCMIN)
