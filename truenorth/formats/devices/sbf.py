"""Septentrio SBF by pysbf2: PVTGeodetic or PVTCartesian with their covariances, AttEuler. Time is the GPS time of week, s.

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


# Of a position block: position, velocity, and covariance blocks with their diagonals, by our headings.
BLOCKS = {
    "PVTGeodetic": {
        "PVTGeodetic": {"lat [rad]": "Latitude", "lon [rad]": "Longitude", "alt [m]": "Height",
                        "VE [m/s]": "Ve", "VN [m/s]": "Vn", "VU [m/s]": "Vu"},
        "PosCovGeodetic": {"sigma_E [m]": "Cov_lonlon", "sigma_N [m]": "Cov_latlat", "sigma_U [m]": "Cov_hgthgt"},
        "VelCovGeodetic": {"sigma_VE [m/s]": "Cov_VeVe", "sigma_VN [m/s]": "Cov_VnVn", "sigma_VU [m/s]": "Cov_VuVu"},
    },
    "PVTCartesian": {
        "PVTCartesian": {"ecef_x [m]": "X", "ecef_y [m]": "Y", "ecef_z [m]": "Z",
                         "ecef_vx [m/s]": "Vx", "ecef_vy [m/s]": "Vy", "ecef_vz [m/s]": "Vz"},
        "PosCovCartesian": {f"sigma_ecef_{a} [m]": f"Cov_{a}{a}" for a in "xyz"},
        "VelCovCartesian": {f"sigma_ecef_v{a} [m/s]": f"Cov_V{a}V{a}" for a in "xyz"},
    },
}  # fmt: skip
ANTENNAS = {"AttEuler": {"heading [deg]": "Heading"}, "AttCovEuler": {"sigma_heading [deg]": "Cov_HeadHead"}}


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Position and velocity with their sigmas; the heading of several antennas."""
    from pysbf2 import ERR_IGNORE, SBF_PROTOCOL, SBFReader

    blocks: dict[str, dict[int, Any]] = {name: {} for kinds in (*BLOCKS.values(), ANTENNAS) for name in kinds}
    with path.open("rb") as stream:
        for _, block in SBFReader(stream, protfilter=SBF_PROTOCOL, quitonerror=ERR_IGNORE):
            if getattr(block, "identity", "") in blocks:
                blocks[block.identity][block.TOW] = block
    main = next((name for name in BLOCKS if blocks[name]), "PVTGeodetic")
    first = next(iter(BLOCKS[main][main].values()))
    fixes = [tow for tow, block in blocks[main].items() if block.Error == 0 and getattr(block, first) > NONE]
    if not fixes:
        return {"gnss": {}}
    table = {"time [s]": np.array(fixes, dtype=np.float64) * 1e-3}
    for name, columns in (BLOCKS[main] | ANTENNAS).items():
        known = blocks[name]
        for ours, theirs in columns.items() if known else ():
            values = np.array([float(getattr(known[tow], theirs)) if tow in known else np.nan for tow in fixes])
            values = np.where(values > NONE, values, np.nan)
            table[ours] = np.sqrt(values) if theirs.startswith("Cov") else values
    if "heading [deg]" in table:  # with a column of sigmas, known or not, it is no course over ground
        table.setdefault("sigma_heading [deg]", np.full(len(fixes), np.nan))
    return {"gnss": table}
