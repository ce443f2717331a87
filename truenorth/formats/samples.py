"""Sample recordings of the package, written as logs that every command reads; their licence is in the folder ``data``."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.atomic import atomic_files
from truenorth.core.errors import UsageError
from truenorth.formats.gnss import read_gnss
from truenorth.formats.writing import write_record
from truenorth.records import ImuRecord, MasterRecord, Record

Array = NDArray[np.float64]

DATA = Path(__file__).parent.parent / "data"
MASTER = ("pitch", "roll", "heading", "VE", "VN", "VU", "lat", "lon", "alt", "time")


# What each recording is.
SAMPLES = {
    "rlg": "ring-laser IMU on a parked vehicle that people and its engine move, 300 s at 100 Hz",
    "fog": "fibre-optic IMU with GNSS, vehicle with its engine idling, 68 s at 200 Hz",
    "transfer": "fibre-optic master INS and a MEMS IMU on one car, 50 s",
}


def write_sample(name: str, folder: str | PathLike[str]) -> list[Path]:
    """Write a sample recording as CSV logs.

    Parameters
    ----------
    name : str
        A key of `SAMPLES`.
    folder : path
        Made where it is missing.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    UsageError
        No such sample, or a file of that name is there already: it is not replaced.
    """
    if name not in SAMPLES:
        raise UsageError(f"no sample {name!r}; choose one of {', '.join(SAMPLES)}")
    with np.load(DATA / f"{name}.npz", allow_pickle=False) as archive:
        records = _records(name, dict(archive))
    paths = {Path(folder) / file: record for file, record in records.items()}
    for path in paths:
        if path.exists():
            raise UsageError(f"{path}: is there already; name another folder")
    with atomic_files() as file:
        for path, record in paths.items():
            write_record(record, file(path))
    return list(paths)


def _records(name: str, arrays: Mapping[str, Any]) -> dict[str, Record]:
    increments = arrays["counts"] * arrays["scale"]
    rows = np.arange(1, len(increments) + 1)
    time = np.asarray(arrays["time"] if "time" in arrays else rows * float(arrays["interval"]), dtype=np.float64)
    imu = ImuRecord(time, increments[:, :3], increments[:, 3:], "increments", name)
    if name == "rlg":
        return {"log.csv": imu}
    if name == "fog":
        columns = {"time": "gnss[0]", "lat": "gnss[1]", "lon": "gnss[2]", "alt": "gnss[3]"}
        columns |= {"VN": "gnss[4]", "VE": "gnss[5]", "VU": "-gnss[6]"}
        return {"drive.csv": imu, "gnss.csv": read_gnss(DATA / "fog.npz", columns=columns, units="position=rad")}
    return {"slave.csv": imu, "master.csv": _master(arrays["master"])}


def _master(table: Array) -> MasterRecord:
    from truenorth.core.attitude import dcm_from_euler

    columns = dict(zip(MASTER, table.T))
    C_nb = dcm_from_euler(-columns["heading"], columns["pitch"], columns["roll"])  # the source counts yaw the other way
    v_n = np.stack([columns["VE"], columns["VN"], columns["VU"]], axis=1)
    return MasterRecord(columns["time"], C_nb, v_n, columns["lat"], columns["lon"], columns["alt"], source="master")
