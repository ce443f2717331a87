"""A simulated run as a folder: the logs, the truth, the scenario with all its defaults, and where the numbers came from."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from truenorth.core.atomic import atomic_files, check_free, writable_folder, write_text
from truenorth.core.version import __version__
from truenorth.formats import write_imu, write_record

if TYPE_CHECKING:
    from truenorth.simulation.aiding import Aided
    from truenorth.simulation.runs import Simulation
    from truenorth.simulation.scenario import Scenario

Suffix = Literal["parquet", "csv"]
FILES, NOTES, FIGURE = ("imu", "truth"), ("scenario.yaml", "summary.json"), "figure.png"
INDEXED = ("encoder", "truth_body")  # with an indexer


def check_folder(scenario: Scenario, folder: Path, suffix: Suffix, plot: bool) -> None:
    """Refuse, before the work, a folder that will not take a run.

    Raises
    ------
    UsageError
        It cannot be written to, or a file in it is to be kept.
    """
    if not folder.exists():
        return
    writable_folder(folder)
    names = [*FILES, *scenario.aiding_specs, *(INDEXED if scenario.indexer is not None else ())]
    for name in (*(f"{name}.{suffix}" for name in names), *NOTES, *((FIGURE,) if plot else ())):
        check_free(folder / name)


def save_run(
    scenario: Scenario,
    simulation: Simulation,
    folder: str | PathLike[str],
    *,
    seed: int,  # that the run was made with
    run: int = 0,
    suffix: Suffix = "parquet",  # of the logs and the truth
    plot: bool = True,  # also figure.png
) -> list[Path]:
    """Write a run; the same scenario, seed and run give the same bytes of logs and truth.

    Raises
    ------
    UsageError
        The folder cannot be written to.
    """
    import yaml

    target = writable_folder(folder)
    aiding = scenario.simulate_aiding(seed=seed, run=run)
    records = {key: log.record for key, log in aiding.items()}
    if scenario.indexer is not None:  # truth is the IMU's; next to it that of the body in which it turns
        body = scenario.build_motion(seed, run)
        records["truth_body"] = body.states(simulation.record.time).trajectory()
    names = [f"{name}.{suffix}" for name in FILES] + [*NOTES] + [f"{key}.{suffix}" for key in records]
    paths = [target / name for name in names]
    with atomic_files() as file:
        imu, truth, resolved, summary, *others = [file(path) for path in paths]
        write_imu(simulation.record, imu)
        for record, path in zip(records.values(), others, strict=True):
            write_record(record, path)
        write_record(simulation.truth.trajectory(), truth)
        text = yaml.safe_dump(scenario.to_mapping(), sort_keys=False, allow_unicode=True, width=110)
        write_text(resolved, text)
        facts = json.dumps(_facts(scenario, simulation, aiding, seed, run), indent=2, allow_nan=False)
        summary.write_text(f"{facts}\n", encoding="utf-8")
        if plot:
            paths.append(target / FIGURE)
            title = f"{scenario.name}, run {run}, seed {seed}, IMU: {scenario.imu_spec.name}"
            simulation.plot(title=title, aiding=aiding).savefig(file(paths[-1]))
    return paths


def _facts(
    scenario: Scenario, simulation: Simulation, aiding: Mapping[str, Aided[Any]], seed: int, run: int
) -> dict[str, Any]:
    errors = simulation.errors
    return {
        "scenario": scenario.name,
        "seed": seed,
        "run": run,
        "samples": len(simulation.record),
        "duration_s": scenario.duration,
        "rate_hz": scenario.rate,
        "kind": simulation.record.kind,
        "imu": scenario.imu_spec.name,
        "true_errors": {name: value.tolist() for name, value in errors.constants().items()},
        "true_errors_of_aiding": {key: _constants(log) for key, log in aiding.items()},
        "true_errors_unit": "SI",
        "truenorth": __version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
    }


def _constants(log: Aided[Any]) -> dict[str, Any]:
    """What does not change from row to row."""
    rows = len(log.sampled)
    arrays = {name: np.asarray(value, dtype=np.float64) for name, value in log.errors.items()}
    return {name: array.tolist() for name, array in arrays.items() if array.ndim == 0 or len(array) < rows}
