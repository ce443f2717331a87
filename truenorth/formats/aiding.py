"""Readers of aiding logs: odometer, velocity log, height, encoder; how every aiding log is opened.

CSV (comma, semicolon, tab or blanks), Parquet, npz and mat files of named columns. Rows that are late by no more than
`LONGEST_LATE` are put in order and counted. A YAML file next to the log (``LOG.yaml``
for ``LOG.csv``) may hold the same options as the call; those of the call win.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.paths import as_path, unreadable
from truenorth.formats import devices
from truenorth.formats.clock_file import with_clock_file
from truenorth.formats.detect import AIDING_SUFFIXES, format_of
from truenorth.formats.guesses import UnsureError
from truenorth.formats.layout import options_for, without_imu
from truenorth.formats.opening import columns_of
from truenorth.formats.order import ordered
from truenorth.formats.phone import new_fixes
from truenorth.formats.positions import columns_of_positions
from truenorth.formats.quantities import TIME, Found, Options, Quantity, checked_options, find, understood
from truenorth.formats.zipped import of_folder, unpacked
from truenorth.records import EncoderRecord, HeightRecord, OdometerRecord, VelocityRecord

Array = NDArray[np.float64]
FilePath = str | PathLike[str]
Pairs = str | Mapping[str, str]

SLOW, MOSTLY = 0.2, 3.0  # m/s, and how many times the speed aside the one along a vehicle is
COUNTS = ("pulses", "distance", "pulses_total", "distance_total", "speed")
ODOMETER = (
    TIME,
    Quantity("pulses", aliases=("counts", "ticks")),
    Quantity("pulses_unsigned"),
    Quantity("pulses_total", aliases=("counts_total", "ticks_total", "encoder")),
    Quantity("distance", "length", "m", ("increment",)),
    Quantity("distance_unsigned", "length", "m"),
    Quantity("distance_total", "length", "m", ("mileage", "odometer")),
    Quantity("speed", "speed", "m/s", ("velocity", "v", "wheel_speed"), otherwise=("odo",)),
    Quantity("speed_unsigned", "speed", "m/s"),
    Quantity("pulse_size", "length", "m"),
)
BODY = (
    Quantity("v_right", "speed", "m/s", ("v_starboard",), ("v_left", "v_port"), "velocity"),
    Quantity("v_forward", "speed", "m/s", ("v_ahead", "v_surge", "speed"), ("v_back", "v_astern"), "velocity"),
    Quantity("v_up", "speed", "m/s", (), ("v_down",), "velocity"),
)
AXES = tuple(Quantity(f"v_{axis}", "speed", "m/s", (f"v{axis}",), (), "velocity") for axis in "xyz")
NAVIGATION = (
    Quantity("VE", "speed", "m/s", ("v_east", "vel_e", "v_e", "velned_e"), ("v_west",), "velocity"),
    Quantity("VN", "speed", "m/s", ("v_north", "vel_n", "v_n", "velned_n"), ("v_south",), "velocity"),
    Quantity(
        "VU", "speed", "m/s", ("vel_u", "v_u", "v_upward"), ("VD", "vel_d", "v_d", "v_downward", "velned_d"), "velocity"
    ),
)
PLACE = (
    Quantity("lat", "angle", "deg", ("latitude", "location_latitude"), (), "position"),
    Quantity("lon", "angle", "deg", ("longitude", "lng", "long", "location_longitude"), (), "position"),
    Quantity(
        "alt",
        "length",
        "m",
        ("altitude", "height", "h", "hgt", "ellipsoidal_height", "location_altitude"),
        ("depth",),
        "height",
    ),
)
INDEXER = tuple(
    Quantity(f"angle_{i}", "angle", "deg", (f"axis_{i}", "angle") if i == 1 else (f"axis_{i}",), (), "angles")
    for i in (1, 2, 3)
)


WORDS = {"E": ("e", "east"), "N": ("n", "north"), "U": ("u", "up", "d", "down")}


def sigmas(names: Sequence[str], dimension: str, unit: str, group: str) -> tuple[Quantity, ...]:
    """The standard deviations of columns."""
    return tuple(Quantity(f"sigma_{name}", dimension, unit, _deviations(name), (), group) for name in names)


def _deviations(name: str) -> tuple[str, ...]:
    """How the standard deviation of a column is called: ``VE_sigma``, ``sd_e``, ``std_vel_east``, ``sdve``."""
    axis, prefixes = (name[1:], ("v", "v_", "vel_")) if name[:1] == "V" else (name, ("",))
    called = [prefix + word for word in WORDS.get(axis, ()) for prefix in prefixes]
    apart = [
        form for one in called for sd in ("sigma", "std", "sd", "stdev") for form in (f"{sd}_{one}", f"{one}_{sd}")
    ]
    joined = [sd + one for one in called if len(one) <= len(name) for sd in ("sd", "std")]
    return tuple(dict.fromkeys((f"{name}_sigma", f"{name}_std", *apart, *joined)))


def read_odometer(
    path: FilePath,
    *,
    format: str | None = None,
    columns: Pairs | None = None,
    units: Pairs | None = None,
    pulse_size: float | str | None = None,
    signed: bool | None = None,
) -> OdometerRecord:
    """Read an odometer's log.

    Columns ``time`` and one of ``pulses, distance`` (of the interval that ends at each row), ``pulses_total,
    distance_total`` (counted from the start: the first row only says where it stood), ``speed``; with several the first of these,
    or the one that `columns` names. Names that end in ``_unsigned`` say that reverse driving has no sign.

    Parameters
    ----------
    path : path
    format : {"csv", "parquet", "npz", "mat"}, optional
        By the suffix when left out.
    columns : mapping or str, optional
        Our names to the log's, such as ``"time=odo_t,speed=odo_speed"``.
    units : mapping or str, optional
        By column, such as ``"speed=km/h,time=ms"``; they win over those in the header; SI where neither says.
    pulse_size : float or str, optional
        Metres a pulse, or text with a unit, such as ``"2 cm"``; wins over a column ``pulse_size``.
    signed : bool, optional
        Whether reverse driving is negative; by the names when left out, and true where they do not say.

    Raises
    ------
    UsageError
        No such file, an unknown format, column or unit.
    DataError
        Bad data: with file, line (or row) and column.
    """
    given = {"columns": columns, "units": units, "pulse_size": pulse_size, "signed": signed}
    with unpacked(as_path(path, "log"), "odometer") as log:
        found, others = open_log(of_folder(log, "odometer"), format, ODOMETER, given)
    asked = [name for name in COUNTS if {name, f"{name}_unsigned"} & found.asked]
    present = [name for name in COUNTS if found.has(name) or found.has(f"{name}_unsigned")]
    if not present:
        raise found.missing("time and one of " + ", ".join(COUNTS))
    chosen = (asked or present)[0]
    name = chosen if found.has(chosen) else f"{chosen}_unsigned"
    found.require(name)
    time, values = found.values["time"], found.values[name]
    kind: Any = chosen.removesuffix("_total")
    if chosen.endswith("_total"):
        time, values = time[1:], np.diff(values)
    is_signed = others.get("signed")
    size = _pulse_size(found, others.get("pulse_size")) if kind == "pulses" else None
    return OdometerRecord(
        time,
        values,
        kind,
        size,
        name == chosen if is_signed is None else is_signed,
        source=found.source,
        late=found.late,
    )


def read_velocity(
    path: FilePath,
    *,
    format: str | None = None,
    columns: Pairs | None = None,
    units: Pairs | None = None,
    axes: str | None = None,
    frame: Literal["body", "navigation"] | None = None,
    topic: str | None = None,
) -> VelocityRecord:
    """Read the log of a Doppler or speed log, or of any reference velocity.

    Columns ``time`` and ``v_right, v_forward, v_up`` (any of them; ``speed`` is the forward one), or ``v_x, v_y, v_z`` with
    `axes`, or ``VE, VN, VU`` (``VD`` is the negative of the last); with ``sigma_`` before their names their standard
    deviations. Empty cells are absent values.

    Parameters
    ----------
    path, format, columns, units
        As for :func:`read_odometer`.
    axes : str, optional
        Where x, y and z point, such as ``"FRD"``; RFU when left out.
    frame : {"body", "navigation"}, optional
        Where a log has columns of both.
    topic : str, optional
        Of a ROS bag with several.

    Raises
    ------
    UsageError, DataError
        As for :func:`read_odometer`.
    """
    names = {"body": [q.name for q in BODY], "navigation": [q.name for q in NAVIGATION]}
    three = sigmas([*names["body"], *names["navigation"]], "speed", "m/s", "sigma")
    quantities = (TIME, *BODY, *AXES, *NAVIGATION, *three)
    found, others = open_log(
        path,
        format,
        quantities,
        {"columns": columns, "units": units, "axes": axes, "frame": frame, "topic": topic},
        "velocity",
    )
    frames = [key for key, of in names.items() if any(found.has(name) for name in of)]
    if any(found.has(q.name) for q in AXES):
        velocity = turned(found.stack(*(q.name for q in AXES)), others.get("axes"))
        if others.get("axes") is None:
            _ask_forward(found.source, velocity)
        frames = frames or ["body"]
    chosen: Any = others.get("frame") or (frames[0] if len(frames) == 1 else None)
    if not frames:
        raise found.missing("time and v_forward (with v_right, v_up), or VE, VN, VU")
    if chosen not in frames:
        raise UsageError(
            f"{found.source}: columns of the frames {' and '.join(frames)}; say which with frame (body or navigation)"
        )
    given = found.stack(*names[chosen])
    return made(
        found,
        VelocityRecord,
        velocity=velocity if given is None else given,
        frame=chosen,
        sigma=known(found.stack(*(f"sigma_{name}" for name in names[chosen]))),
    )


def read_encoder(
    path: FilePath, *, format: str | None = None, columns: Pairs | None = None, units: Pairs | None = None
) -> EncoderRecord:
    """Read the log of an indexer's encoder: ``time`` and ``angle_1``, ``angle_2``, ... (degrees), the outermost axis first.

    Angles that jump by about a turn are counted on.

    Raises
    ------
    UsageError, DataError
        As for :func:`read_odometer`.
    """
    found, _ = open_log(path, format, (TIME, *INDEXER), {"columns": columns, "units": units})
    names = [q.name for q in INDEXER if found.has(q.name)]
    if not names or names != [q.name for q in INDEXER[: len(names)]]:
        raise found.missing("time and angle_1 (with angle_2, angle_3, the outermost axis first)")
    angles = np.unwrap(np.asarray(whole(found, *names)), axis=0)
    record: EncoderRecord = made(found, EncoderRecord, angles=angles[:, 0] if len(names) == 1 else angles)
    return record


def read_height(
    path: FilePath, *, format: str | None = None, columns: Pairs | None = None, units: Pairs | None = None
) -> HeightRecord:
    """Read the log of a barometer or another sensor of height: ``time``, ``alt``, and ``sigma_U`` where there is one.

    Raises
    ------
    UsageError, DataError
        As for :func:`read_odometer`.
    """
    height = replace(PLACE[2], aliases=(*PLACE[2].aliases, "baro", "baro_alt"))
    quantities = (TIME, height, *sigmas(["U"], "length", "m", "sigma"))
    found, _ = open_log(path, format, quantities, {"columns": columns, "units": units})
    if not found.has("alt"):
        raise found.missing("time and alt")
    found.require("alt")
    return made(found, HeightRecord, alt=found.values["alt"], sigma=known(found.values.get("sigma_U")))


def open_log(
    path: FilePath, format: str | None, quantities: Sequence[Quantity], given: Mapping[str, Any], part: str = ""
) -> tuple[Found, Mapping[str, Any]]:
    """What a log has of some quantities, in order of time, and the options that only its kind has.

    `part` is what is read of a device's log: ``gnss``, ``velocity`` or ``poses``.

    Raises
    ------
    UsageError, DataError
        As for :func:`read_odometer`.
    """
    path = as_path(path, "log")
    known_keys = [key for key in given if key not in ("columns", "units")]
    receiver = part == "gnss"
    try:
        chosen = format_of(path, format, AIDING_SUFFIXES, "a log of named columns")
        device = chosen in devices.DEVICES

        def checked(content: Mapping[Any, Any]) -> dict[str, Any]:
            return checked_options(without_imu(content, known_keys) if device else content, quantities, known_keys)

        values = options_for(path, given, checked)
        others = {key: value for key, value in values.items() if key in known_keys}
        options = Options(values.get("columns", {}), values.get("units", {}), others)
        if device:
            columns = devices.columns(path, chosen, part or "gnss", values.get("topic"))
        else:
            own = columns_of_positions(path) if part == "gnss" and chosen == "csv" else None
            columns = own or columns_of(path, chosen, bool(options.columns), part)
        if not columns.named:
            example = ",".join(q.name for q in quantities[:4])
            raise DataError(
                f"{path.name}: numbers, and no header of names above them; expected one such as {example}: add it"
            )
        times = None
        if chosen == "csv" and columns.named and "time" not in options.columns:
            unknown = [name for name, means in understood(columns.names, quantities, options, receiver) if not means]
            columns, times = with_clock_file(columns, unknown)
        found = ordered(find(columns, quantities, options, receiver))
        if times is not None:
            found = replace(found, source=f"{found.source}, clock of {times}")
        return new_fixes(found, columns.names) if part == "gnss" and not device else found, others
    except OSError as error:
        raise unreadable(path, error) from None


def known(sigma: Array | None) -> Array | None:
    """Standard deviations, where zero and less say that none is known; None without a single one."""
    if sigma is None:
        return None
    positive = np.where(sigma > 0.0, sigma, np.nan)
    return positive if np.isfinite(positive).any() else None


def made(found: Found, kind: type[Any], **values: Any) -> Any:
    """A record of a kind."""
    return kind(time=found.values["time"], source=found.source, late=found.late, **values)


def whole(found: Found, *names: str) -> Array | None:
    """Columns that are all there, and hold a number in every row; None where none of them is."""
    if not any(found.has(name) for name in names):
        return None
    absent = [name for name in names if not found.has(name)]
    if absent:
        raise DataError(f"{found.source}: {', '.join(names)} without {', '.join(absent)}; expected all of them or none")
    found.require(*names)
    return found.stack(*names)


def turned(values: Array | None, axes: str | None) -> Array | None:
    """Columns x, y, z along right, forward, up; NaN stays with its axis."""
    if values is None or axes is None:
        return values
    from truenorth.core.attitude import body_axes

    C = body_axes(axes)
    source = np.abs(C).argmax(axis=1)
    return values[:, source] * C[np.arange(3), source]


def _ask_forward(source: str, velocity: Array | None) -> None:
    """Ask for the axes of a vehicle that goes along x, which is not to the right of any."""
    if velocity is None:
        return
    along, aside = (float(np.sqrt(np.nanmean(axis**2))) if np.isfinite(axis).any() else 0.0 for axis in velocity.T[:2])
    if along > SLOW and along > MOSTLY * aside:
        raise UnsureError(
            f"{source}: the velocity is along x ({along:.3g} m/s RMS, along y {aside:.2g}), which seems to point forward, not "
            "to the right; say which axes they are, in a YAML file next to the log, or to the reader",
            [{"axes": "FRD"}, {"axes": "FLU"}, {"axes": "RFU"}],
        )


def _pulse_size(found: Found, given: float | str | None) -> float | None:
    if given is not None:
        from truenorth.core.units import parse

        return parse(given, "length") if isinstance(given, str) else float(given)
    if not found.has("pulse_size"):
        raise UsageError(f"{found.source}: pulses without their size; give pulse_size, such as '2 cm'")
    found.require("pulse_size")
    sizes = np.unique(found.values["pulse_size"])
    if len(sizes) > 1:
        raise DataError(
            f"{found.source}: column {found.labels['pulse_size']}: {sizes[:3]} ...; expected one size throughout"
        )
    return float(sizes[0])
