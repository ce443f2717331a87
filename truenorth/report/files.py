"""The files that each type of result is written to: name and writer; :func:`truenorth.save` puts them in place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truenorth.core.arrow import arrow_file
from truenorth.core.atomic import write_text
from truenorth.core.shown import Write, can_draw, plot
from truenorth.formats.arrow import table_from
from truenorth.navigation.export import geojson
from truenorth.navigation.start import navigation_block

if TYPE_CHECKING:
    import pandas as pd

    from truenorth.alignment import Alignment
    from truenorth.campaign.tuning import Tuned
    from truenorth.navigation import Navigation
    from truenorth.quality import Inspection
    from truenorth.simulation import Simulation


def alignment_files(result: Alignment) -> dict[str, Write | None]:
    """summary.json, and history.parquet where there is a history."""
    summary = result.summary() | {"navigation": navigation_block(result)}  # from which navigation goes on
    return {"summary.json": _json(summary), "history.parquet": None if result.history is None else _history(result)}


def _history(result: Alignment) -> Write:
    """As pandas writes it, without the third of a second that pandas takes to load."""

    def write(path: Path) -> None:
        import pyarrow.parquet as pq

        with arrow_file(path, "wb") as file:
            pq.write_table(table_from(result.history_columns(), index="time"), file)

    return write


def navigation_files(result: Navigation) -> dict[str, Write]:
    """summary.json, track.parquet, innovations.parquet and track.geojson."""
    return {
        "summary.json": _json(result.summary()),
        "track.parquet": lambda path: _parquet(result.to_frame(), path),
        "innovations.parquet": lambda path: _parquet(result.innovations(), path),
        "track.geojson": lambda path: write_text(path, geojson(result)),
    }


def _parquet(frame: pd.DataFrame, path: Path) -> None:
    with arrow_file(path, "wb") as file:
        frame.to_parquet(file)


def inspection_files(result: Inspection) -> dict[str, Write]:
    """summary.json."""
    return {"summary.json": _json(result.to_dict())}


def summary_file(result: Any) -> dict[str, Write]:
    """summary.json of a result that has a `summary`."""
    return {"summary.json": _json(result.summary())}


def simulation_files(result: Simulation) -> dict[str, Write]:
    """imu.parquet and truth.parquet, which the readers of logs read."""
    from truenorth.formats import write_imu, write_record

    return {
        "imu.parquet": lambda path: write_imu(result.record, path),
        "truth.parquet": lambda path: write_record(result.truth.trajectory(), path),
    }


def tuned_files(result: Tuned) -> dict[str, Write]:
    """tuned.yaml (the specification), trials.csv and judged.csv; search.png where matplotlib is installed."""
    files: dict[str, Write] = {
        "tuned.yaml": result.spec.to_yaml,
        "trials.csv": lambda path: result.trials.to_csv(path, index=False),
        "judged.csv": lambda path: result.judged.to_csv(path, index=False),
    }
    return files | ({"search.png": lambda path: plot(result).savefig(path)} if can_draw() else {})


def _json(content: dict[str, Any]) -> Write:
    return lambda path: write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")
