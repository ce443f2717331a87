"""Columns of aiding logs: found by our names and their usual others, with the unit that a header gives.

A header cell may hold its unit: ``speed [km/h]``, ``speed (km/h)`` or ``speed_kmh``. Names are compared without regard to
case, blanks and hyphens.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import SEMI_MAJOR
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import eastward
from truenorth.core.units import DIMENSIONS, parse_quantity, parse_unit
from truenorth.core.yaml_file import unknown_key
from truenorth.formats.behaviour import EPOCH
from truenorth.formats.checks import check_finite
from truenorth.formats.clock_face import clock_face, of_clock_face
from truenorth.formats.columns import Columns, listed
from truenorth.formats.guesses import UnsureError
from truenorth.formats.hemispheres import with_signs
from truenorth.formats.names import clock_of
from truenorth.formats.units import split, unit_in
from truenorth.records import IN_ORDER, Late

Array = NDArray[np.float64]

LONG_STEP = 100.0  # s: sensors that aid seldom wait so long
FASTEST = 1000.0  # m/s, of what carries a receiver
RECEIVER = re.compile(r"(?:gps|gnss)[_ .-]", re.IGNORECASE)  # in front of all headings of a receiver: ``gps_lat``
RECEIVERS = re.compile(
    r"(?:\d+: ?)?(?:gps|gnss)(?![a-z])", re.IGNORECASE
)  # devices: ``GNSS1``, RaceChrono's ``100: gps``
PATH = re.compile(r"::|[./]")  # between a device and what it measures


@dataclass(frozen=True)
class Quantity:
    """A column that a reader understands."""

    name: str  # ours
    dimension: str = "ratio"  # a key of :data:`truenorth.core.units.DIMENSIONS`
    unit: str = "1"  # where neither the file nor the caller names one
    aliases: tuple[str, ...] = ()  # other usual names
    opposite: tuple[str, ...] = ()  # names of the same quantity counted the other way, such as ``VD`` of ``VU``
    group: str = ""  # by which `units` may name it along with others, such as ``velocity``
    # names that mean it where no heading means anything else, in a unit of its dimension: ``odo (m/s)`` is a speed
    otherwise: tuple[str, ...] = ()
    # units of another dimension that an app writes by mistake over numbers in `unit`
    miswritten: tuple[str, ...] = ()


Meaning = tuple[Quantity, float, str | None]  # a quantity, its sign, and the unit that the heading names

TIME = Quantity("time", "time", "s", ("t", "timestamp", "time_stamp", "tow", "gps_time", "utc", "time_since_start_in"))


@dataclass(frozen=True)
class Options:
    """How an aiding log is to be read."""

    # our names to the log's; a minus before the latter turns the sign
    columns: Mapping[str, str] = field(default_factory=dict)
    # of columns or their groups; they win over those in the header
    units: Mapping[str, str] = field(default_factory=dict)
    others: Mapping[str, Any] = field(default_factory=dict)  # what only one kind of log has


@dataclass(frozen=True)
class Found:
    """What a log has of the columns that a reader understands."""

    source: str
    labels: Mapping[str, str]  # our names to the log's
    values: Mapping[str, Array]  # our names to (N,) arrays in SI; NaN where a cell is empty
    factors: Mapping[str, float]  # our names to what the log's numbers were multiplied with
    place: Callable[[int], str]  # where a row stands in the file, in words
    asked: frozenset[str]  # our names of those that the caller named
    stated: frozenset[str] = frozenset()  # our names of those whose unit the file or the caller says
    late: Late = IN_ORDER  # rows that were put in order

    def has(self, *names: str) -> bool:
        """Whether all of these columns are there."""
        return all(name in self.values for name in names)

    def stack(self, *names: str) -> Array | None:
        """(N, len(names)) array, NaN where a column is not there; None where none of them is."""
        if not any(name in self.values for name in names):
            return None
        absent = np.full(len(self.values["time"]), np.nan)
        return np.column_stack([self.values.get(name, absent) for name in names])

    def require(self, *names: str) -> None:
        """Refuse an empty cell, NaN or inf in these columns.

        Raises
        ------
        DataError
            With the place and the column of the file.
        """
        for name in names:
            check_finite(self.values[name][:, None], [self.labels[name]], self.source, self.place)

    def missing(self, wanted: str) -> DataError:
        """The error for a log without the columns that are `wanted`, in words."""
        found = ", ".join(self.labels.values())
        return DataError(
            f"{self.source}: expected {wanted}; understood only {found}: name the columns, in the call or a YAML "
            "file next to the log"
        )


def checked_options(
    content: Mapping[Any, Any], quantities: Iterable[Quantity], others: Iterable[str]
) -> dict[str, Any]:
    """The options of a log: ``columns``, ``units`` and those of its kind.

    Raises
    ------
    UsageError
        A key that is not known, or names and units in another form.
    """
    known = {q.name for q in quantities}
    groups = {q.group for q in quantities if q.group}
    keys = ["columns", "units", *others]
    for key in content:
        if key not in keys:
            raise UsageError(unknown_key("layout", key, keys))
    result = dict(content)
    for key, allowed in (("columns", known), ("units", known | groups)):
        if key in result:
            result[key] = _pairs(key, result[key], sorted(allowed))
    return result


def _pairs(key: str, value: Any, allowed: Sequence[str]) -> dict[str, str]:
    if isinstance(value, str):
        parts = [part.partition("=") for part in value.split(",")]
        value = {name.strip(): text.strip() for name, _, text in parts}
    if not isinstance(value, Mapping) or not all(value.values()):
        raise UsageError(f"{key} are {value!r}; expected pairs such as {allowed[0]}=...")
    for name in value:
        if name not in allowed:
            raise UsageError(unknown_key(key, name, allowed))
    return {name: str(text) for name, text in value.items()}


def find(columns: Columns, quantities: Sequence[Quantity], options: Options, receiver: bool = False) -> Found:
    """Read what a log has of the `quantities`, in SI; of a `receiver`, whose headings may all begin with ``gps_``.

    Raises
    ------
    DataError
        No time, a column that the caller names and is not there, two columns for one quantity, an empty log.
    UsageError
        A unit of another dimension.
    """
    source = columns.path.name
    claims: dict[str, list[tuple[str, float]]] = {}
    stated: set[str] = set()
    named = {ours: text if text in columns.names else text.removeprefix("-") for ours, text in options.columns.items()}
    for name, meanings in understood(columns.names, quantities, options, receiver):
        if name in named.values():
            continue
        for quantity, sign, unit in meanings:
            if quantity.name not in options.columns:
                stated |= {quantity.name} if _unit(quantity, unit, options) else set()
                claims.setdefault(quantity.name, []).append(
                    (name, sign * _factor(quantity, unit, name, options, source))
                )
    for quantity in quantities:
        if quantity.name in options.columns:
            name = named[quantity.name]
            if name not in columns.names:
                near = get_close_matches(name, columns.names, n=1)
                hint = f"; is it {near[0]!r}?" if near else ""
                raise DataError(f"{source}: column {name!r} is missing; found {listed(columns.names)}{hint}")
            unit = split(name)[1]
            stated |= {quantity.name} if _unit(quantity, unit, options) else set()
            sign = 1.0 if name == options.columns[quantity.name] else -1.0
            claims[quantity.name] = [(name, sign * _factor(quantity, unit, name, options, source))]
    for ours, claim in claims.items():
        if len(claim) > 1:
            both = " and ".join(repr(name) for name, _ in claim)
            raise DataError(f"{source}: columns {both} are both {ours}; say which, columns: {{{ours}: ...}}")
    labels = {ours: claim[0][0] for ours, claim in claims.items()}
    if "time" not in labels:
        raise DataError(
            f"{source}: no column of time among {listed(columns.names)}; expected time in seconds: name it, in the "
            "call or a YAML file next to the log"
        )
    if receiver and len(devices := _receivers(columns.names)) > 1:
        taken = [device for device in devices if any(_path(label)[0] == device for label in labels.values())]
        source += f", {' and '.join(taken)} of {', '.join(devices)}" if taken else ""
    source += _mistaken_units(labels, quantities, options)
    factors = {ours: claim[0][1] for ours, claim in claims.items()}
    time, said = columns.clock(labels["time"])
    if said is None and "time" not in stated and factors["time"] == 1.0 and (face := clock_face(time)) is not None:
        time, said = of_clock_face(time / face[1]), "times of day"
    factors["time"] = 1.0 if said is not None else _of_epoch(time, factors["time"])
    numbers = list(dict.fromkeys(label for ours, label in labels.items() if ours != "time"))
    table = columns.read(numbers, True) if numbers else np.zeros((len(time), 0))
    if len(table) != len(time):
        raise DataError(
            f"{source}: columns of different length (time {len(time)}, {numbers[0]} {len(table)}); expected as many of each: name "
            "those of one sensor"
        )
    values = {ours: table[:, numbers.index(label)] * factors[ours] for ours, label in labels.items() if ours != "time"}
    values = {"time": time * factors["time"], **with_signs(columns, values)}
    found = Found(source, labels, values, factors, columns.place, frozenset(options.columns), frozenset(stated))
    found.require("time")
    if said is None and "time" not in stated and factors["time"] == 1.0:
        _ask_clock(found)
    return found


def _ask_clock(found: Found) -> None:
    """Ask where whole numbers so far apart stand under a name without a unit that they seem to count parts of a second.

    Where places would then move faster than anything does, they are seconds.
    """
    time = found.values["time"]
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if step < LONG_STEP or np.any(time != np.round(time)):
        return
    size = 1e-3 if step < 1e3 * LONG_STEP else 1e-6
    if found.has("lat", "lon"):
        lat, lon = found.values["lat"], found.values["lon"]
        moved = np.hypot(np.diff(lat), eastward(lon[1:], lon[:-1]) * np.cos(lat[1:]))
        if np.nanmax(moved / np.diff(time), initial=0.0) * SEMI_MAJOR > FASTEST * size:
            return
    unit = {1e-3: "ms", 1e-6: "us"}[size]
    raise UnsureError(
        f"{found.source}: column {found.labels['time']}: rows are {step:g} apart and say no unit; seconds, or {unit}? Say "
        "which, in a YAML file next to the log, or to the reader",
        [{"units": {"time": unit}}, {"units": {"time": "s"}}],
    )


def _of_epoch(time: Array, factor: float) -> float:
    """Factor of a clock, which counts ms, us or ns where only these give a date since 1970 in this century."""
    first = float(time[0]) if len(time) else 0.0
    if factor == 1.0 and first > EPOCH[1]:
        return next((f for f in (1e-3, 1e-6, 1e-9) if EPOCH[0] < first * f < EPOCH[1]), factor)
    return factor


def understood(
    names: Iterable[str], quantities: Sequence[Quantity], options: Options, receiver: bool
) -> list[tuple[str, list[Meaning]]]:
    """What each heading may mean.

    Where none but the clock's means anything, and the caller names none, headings are read once more: without ``gps_`` in front of
    those of a receiver, and by the names that mean a quantity in its own unit alone. A second clock is not looked for so. What is
    then not found is looked for in the headings of one device (:func:`of_device`). A clock may have any name that one of an IMU's
    log may have, where it is the only one of them.
    """
    found = _quantities_of(names, quantities, options, receiver)
    if "time" in options.columns or any(
        quantity.name == "time" for _, meanings in found for quantity, _, _ in meanings
    ):
        return found
    clocks = {name: unit for name, meanings in found if not meanings for unit in _clock(name)}
    time = [quantity for quantity in quantities if quantity.name == "time"]
    if len(clocks) != 1 or not time:
        return found
    return [(name, [(time[0], 1.0, clocks[name])] if name in clocks else meanings) for name, meanings in found]


def _clock(name: str) -> list[str | None]:
    """The unit that the heading of a clock names, if any; empty for others, and for ``t`` or ``epoch``, which may be anything."""
    is_clock, unit = clock_of(name)
    return [unit] if is_clock and re.search("time|stamp", name, re.IGNORECASE) else []


def _quantities_of(
    names: Iterable[str], quantities: Sequence[Quantity], options: Options, receiver: bool
) -> list[tuple[str, list[Meaning]]]:
    found = [(name, list(_meanings(name, quantities))) for name in names]
    if not set(options.columns) <= {"time"}:
        return found
    if not options.columns and not _beyond_time(found):
        others = [quantity for quantity in quantities if quantity.name != "time"]
        found = [(name, meanings or list(_once_more(name, others, receiver))) for name, meanings in found]
    known = {quantity.name for _, meanings in found for quantity, _, _ in meanings} | set(options.columns)
    if not receiver and _beyond_time(found):
        return found
    more = of_device([name for name, _ in found], [q for q in quantities if q.name not in known], receiver)
    return [(name, meanings or more.get(name, [])) for name, meanings in found]


def _beyond_time(found: Iterable[tuple[str, list[Meaning]]]) -> bool:
    return any(quantity.name != "time" for _, meanings in found for quantity, _, _ in meanings)


def _once_more(name: str, quantities: Sequence[Quantity], receiver: bool) -> Iterable[Meaning]:
    """What a heading means without a receiver's name in front, or by its unit."""
    if receiver and RECEIVER.match(name):
        yield from _meanings(RECEIVER.sub("", name, count=1), quantities)
    plain, unit = split(name)
    written = None if unit is None else unit_in(unit)
    dimension = None if written is None else parse_unit(written)[1]
    for quantity in quantities:
        if _key(plain) in quantity.otherwise and dimension == DIMENSIONS[quantity.dimension][0]:
            yield quantity, 1.0, unit


def of_device(names: Sequence[str], quantities: Sequence[Quantity], receiver: bool) -> dict[str, list[Meaning]]:
    """What headings mean that are paths with a device in front: ``GNSS1::PosLla::latitude [deg]``, a struct's field ``fix.lat``.

    Of a table of several devices only a receiver's are known, by its name; of receivers that are numbered the first is taken. Where
    all headings are those of one device its name does not matter.
    """
    paths = {name: parts for name in names if len(parts := _path(name)) > 1}
    devices = {parts[0] for parts in paths.values()}
    receivers = _receivers(names) if receiver else []
    numbered = len({re.sub(r"\d+$", "", device) for device in receivers}) == 1
    chosen = (
        receivers[:1] if numbered else receivers or (devices if len(devices) == 1 and len(paths) == len(names) else ())
    )
    found: dict[str, list[Meaning]] = {}
    for name, parts in paths.items():
        if parts[0] in chosen:
            unit = split(name)[1]
            ends = [part if unit is None else f"{part} [{unit}]" for part in ("_".join(parts[-2:]), parts[-1])]
            found[name] = next((means for end in ends if (means := list(_meanings(end, quantities)))), [])
    return found


def _path(name: str) -> list[str]:
    """The parts of a heading that is a path; one part of any other."""
    return [part.strip() for part in PATH.split(split(name)[0]) if part.strip()]


def _receivers(names: Sequence[str]) -> list[str]:
    """The receivers whose names stand in front of headings, the first one first."""
    found = {parts[0] for name in names if len(parts := _path(name)) > 1 and RECEIVERS.match(parts[0])}
    return sorted(found, key=lambda device: (len(device), device))


def _meanings(name: str, quantities: Sequence[Quantity]) -> Iterable[Meaning]:
    """What a header cell may mean: a quantity, its sign, and the unit it names."""
    plain, unit = split(name)
    words = _key(plain)
    ends = [(words, unit)]
    if unit is None:
        ends += [(words[: m.start()], unit_in(words[m.end() :])) for m in re.finditer("_", words)]
    for base, stated in ends:
        if base != words and stated is None:
            continue
        for quantity in quantities:
            for sign, names in ((1.0, (quantity.name, *quantity.aliases)), (-1.0, quantity.opposite)):
                if base in map(_key, names):
                    yield quantity, sign, stated
                    return


def _key(name: str) -> str:
    return re.sub(r"[\s\-]+", "_", name.strip(" \t:")).casefold()


def _unit(quantity: Quantity, stated: str | None, options: Options) -> str | None:
    """The unit that the caller says, or else the heading; None: neither does, or the heading's is an app's mistake."""
    written = None if stated is None or stated in quantity.miswritten else unit_in(stated) or stated
    return options.units.get(quantity.name, options.units.get(quantity.group)) or written


def _mistaken_units(labels: Mapping[str, str], quantities: Sequence[Quantity], options: Options) -> str:
    """What to say of headings whose unit is an app's mistake, and is not taken."""
    wrong = {
        labels[quantity.name]: quantity.unit
        for quantity in quantities
        if quantity.name in labels
        and split(labels[quantity.name])[1] in quantity.miswritten
        and not options.units.keys() & {quantity.name, quantity.group}
    }
    return "".join(f", {label} in {unit}" for label, unit in wrong.items())


def _factor(quantity: Quantity, stated: str | None, label: str, options: Options, source: str) -> float:
    """What a column is multiplied with."""
    text = _unit(quantity, stated, options) or quantity.unit
    try:
        factor, found = parse_quantity(text) if text[:1] in "0123456789." and text != "1" else parse_unit(text)
    except UsageError as error:
        raise UsageError(f"{source}: column {label}: {error}") from None
    wanted, example = DIMENSIONS[quantity.dimension]
    if found != wanted:
        raise UsageError(
            f"{source}: column {label}: {quantity.name} cannot be in {text!r}; expected a unit of "
            f"{quantity.dimension.replace('_', ' ')}, such as {example.partition(' ')[2]}"
        )
    return factor
