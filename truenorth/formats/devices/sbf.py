"""Septentrio SBF by pysbf2: PVTGeodetic, with PosCovGeodetic and VelCovGeodetic. Time is the GPS time of week, s.

ExtSensorMeas, the IMU of AsteRx-i receivers, is not among the blocks that pysbf2 decodes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXTRA = "septentrio"
AXES = "FRD"
NONE = -2e10  # what the receiver writes where it knows nothing


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Position and velocity with their sigmas."""
    from pysbf2 import ERR_IGNORE, SBF_PROTOCOL, SBFReader

    blocks: dict[str, dict[int, Any]] = {"PVTGeodetic": {}, "PosCovGeodetic": {}, "VelCovGeodetic": {}}
    with path.open("rb") as stream:
        for _, block in SBFReader(stream, protfilter=SBF_PROTOCOL, quitonerror=ERR_IGNORE):
            if getattr(block, "identity", "") in blocks:
                blocks[block.identity][block.TOW] = block
    fixes = {tow: block for tow, block in blocks["PVTGeodetic"].items() if block.Error == 0 and block.Latitude > NONE}
    if not fixes:
        return {"gnss": {}}

    def of(name: str, source: dict[int, Any], scale: float = 1.0) -> Array:
        values = np.array([float(getattr(source[tow], name)) if tow in source else np.nan for tow in fixes])
        return np.where(values > NONE, values * scale, np.nan)

    table = {"time [s]": np.array([float(tow) for tow in fixes]) * 1e-3}
    for ours, theirs in (("lat [rad]", "Latitude"), ("lon [rad]", "Longitude"), ("alt [m]", "Height"),
                         ("VE [m/s]", "Ve"), ("VN [m/s]", "Vn"), ("VU [m/s]", "Vu")):  # fmt: skip
        table[ours] = of(theirs, fixes)
    for kind, unit, names in (("PosCovGeodetic", "m", ("Cov_lonlon", "Cov_latlat", "Cov_hgthgt")),
                              ("VelCovGeodetic", "m/s", ("Cov_VeVe", "Cov_VnVn", "Cov_VuVu"))):  # fmt: skip
        if blocks[kind]:
            for axis, name in zip(("E", "N", "U"), names):
                letter = axis if unit == "m" else f"V{axis}"
                table[f"sigma_{letter} [{unit}]"] = np.sqrt(of(name, blocks[kind]))
    return {"gnss": table}
