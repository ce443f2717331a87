"""What MATLAB toolboxes keep under names of their own: the arrays ``gps`` and ``avp`` of PSINS, the structs of NaveGo.

- **PSINS** (G. Yan): ``imu`` has angle and velocity increments and time; ``gps`` velocity east, north, up, latitude, longitude
  (rad), height and time; ``avp`` pitch, roll, yaw (rad, counterclockwise from north), velocity, place and time. Axes
  right-forward-up.
- **NaveGo** (R. Gonzalez): an IMU's struct has ``t``, ``fb`` (m/s^2) and ``wb`` (rad/s) next to its specification, a receiver's
  ``t``, ``lat``, ``lon`` (rad), ``h`` and ``vel`` (north, east, down) next to ``stdm`` and ``stdv``; a reference adds ``roll``,
  ``pitch``, ``yaw`` (rad, clockwise). Axes forward-right-down.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from truenorth.formats.layout import Layout
from truenorth.records import Guess

PSINS_IMU = {"dtheta": "imu[0:3]", "dvel": "imu[3:6]", "time": "imu[6]"}
PSINS_GPS = ("VE [m/s]", "VN [m/s]", "VU [m/s]", "lat [rad]", "lon [rad]", "alt [m]", "time [s]")
PSINS_AVP = ("pitch [rad]", "roll [rad]", "yaw_ccw [rad]", *PSINS_GPS)
NAVEGO_IMU = {"t", "fb", "wb"}
NAVEGO_SPECIFICATION = {"arw", "vrw", "gb_sta", "ab_sta"}  # one of them at least
NAVEGO_FIXES = {"t", "lat", "lon", "h", "vel"}
NAVEGO_NAMES = {
    "t": "time [s]", "lat": "lat [rad]", "lon": "lon [rad]", "h": "alt [m]", "roll": "roll [rad]", "pitch": "pitch [rad]",
    "yaw": "heading [rad]",
}  # fmt: skip
NED = ("VN [m/s]", "VE [m/s]", "VD [m/s]")
NAVEGO_SIGMAS = {
    "stdm": ("sigma_N [m]", "sigma_E [m]", "sigma_U [m]"),
    "stdv": ("sigma_VN [m/s]", "sigma_VE [m/s]", "sigma_VU [m/s]"),
}  # of a receiver, the same for all rows


def imu_layout(variables: Mapping[str, Any], layout: Layout) -> tuple[Layout, Guess | None]:
    """The layout with what a toolbox's names say of an IMU, where the caller names no columns; and whose they are."""
    if layout.columns:
        return layout, None
    if np.shape(variables.get("imu", 0))[1:] == (7,):
        units = {"gyro": "rad", "accel": "m/s", "time": "s", **layout.units}
        why = Guess(
            "columns", "angle and velocity increments and time, as PSINS keeps them", "seven columns of imu", 1.0, {}
        )
        return replace(layout, columns=PSINS_IMU, units=units), why
    structs = [name for name, keys in _structs(variables).items() if keys >= NAVEGO_IMU and keys & NAVEGO_SPECIFICATION]
    if len(structs) != 1:
        return layout, None
    of = structs[0]
    found = replace(
        layout,
        columns={"gyro": f"{of}.wb", "accel": f"{of}.fb", "time": f"{of}.t"},
        units={"gyro": "rad/s", "accel": "m/s^2", "time": "s", **layout.units},
        axes=layout.axes or "FRD",
    )
    return found, Guess(
        "columns", "rad/s and m/s^2, forward, right, down, as NaveGo keeps them", f"the fields of {of}", 1.0, {}
    )


def aiding(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """A receiver's, master's or trajectory's columns under names that we read; all variables where no toolbox wrote them."""
    for name, names in (("gps", PSINS_GPS), ("avp", PSINS_AVP)):
        arrays = [key for key in variables if key == name or key.endswith(f".{name}")]
        if len(arrays) == 1 and np.shape(variables[arrays[0]])[1:] == (len(names),):
            return dict(zip(names, np.asarray(variables[arrays[0]], dtype=np.float64).T))
    structs = [name for name, keys in _structs(variables).items() if keys >= NAVEGO_FIXES]
    if len(structs) != 1:
        return variables
    time = np.ravel(variables[f"{structs[0]}.t"])
    fields = {
        key: variables[f"{structs[0]}.{key}"] for key in (*NAVEGO_NAMES, "vel") if f"{structs[0]}.{key}" in variables
    }
    if np.shape(fields["vel"]) != (len(time), 3):
        return variables
    columns = {ours: np.ravel(fields[key]) for key, ours in NAVEGO_NAMES.items() if key in fields}
    columns |= dict(zip(NED, np.asarray(fields["vel"], dtype=np.float64).T))
    for key, ours in NAVEGO_SIGMAS.items():
        sigmas = np.ravel(np.asarray(variables.get(f"{structs[0]}.{key}", ()), dtype=np.float64))
        if len(sigmas) == 3 and np.all(sigmas > 0.0):
            columns |= {name: np.full(len(time), sigma) for name, sigma in zip(ours, sigmas)}
    return columns


def _structs(variables: Mapping[str, Any]) -> dict[str, set[str]]:
    """The fields of each struct of a file."""
    structs: dict[str, set[str]] = {}
    for name in variables:
        of, dot, key = name.rpartition(".")
        if dot:
            structs.setdefault(of, set()).add(key)
    return structs
