"""NMEA 0183 of any talker: GGA (position), RMC (position, speed, course), VTG (speed, course), HDT and THS (true heading), ZDA."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.nmea_dates import midnight_of, midnights
from truenorth.formats.order import put_in_order
from truenorth.records import GnssRecord

NMEA_SUFFIXES = (".nmea", ".nma")
KNOT = 1852.0 / 3600.0
HEAD = 4096
KINDS = (b"GGA", b"RMC", b"VTG", b"HDT", b"THS", b"ZDA")
TIMED = ("GGA", "RMC", "ZDA")
DIGITS = {"GGA": {1: 6, 2: 4, 4: 5}, "RMC": {1: 6, 3: 4, 5: 5, 9: 6}, "ZDA": {1: 6, 2: 2, 3: 2}}  # before the point
HEADINGS = ("HDT", "THS")  # true ones, without a time of their own


def is_nmea(path: Path) -> bool:
    """Whether a file begins with sentences of this kind."""
    with path.open("rb") as file:
        lines = file.read(HEAD).splitlines()
    return any(line[:1] == b"$" and line[3:6] in KINDS and b"," in line for line in lines)


def read_nmea(path: Path) -> GnssRecord:
    """Read a log of NMEA sentences; what is none of `KINDS` is passed over, and so are broken sentences at both ends.

    Sentences of one epoch make one row: position, height above the ellipsoid (height above the geoid plus the geoid's), quality
    and HDOP from GGA, velocity from RMC (or from the VTG that follows), heading from HDT or THS: of the epoch whose sentences stand
    before it, or after it where the log begins with a heading. Of several in an epoch the first is taken. Time is UTC as the
    receiver stamps it: seconds since 1970 where RMC or ZDA have dates (:mod:`truenorth.formats.nmea_dates`), else from midnight of
    the first day.

    Raises
    ------
    DataError
        A wrong checksum, a field that is no number, an epoch too late, no sentence of these kinds: with the line.
    """
    rows: dict[float, dict[str, float]] = {}
    lines: dict[float, int] = {}
    time = math.nan
    sentences = list(_sentences(path))
    stamps = iter(_stamps(sentences, path.name))
    ahead: float | None = None  # a heading whose epoch follows
    leads: bool | None = None  # whether headings stand before the sentences of their epoch
    for number, kind, body in sentences:
        cells, where = body.split(","), f"{path.name}: line {number}, {kind}"
        if kind == "ZDA":
            time = next(stamps) if cells[1] else time
            continue
        if kind in HEADINGS:
            heading = _heading(cells, where)
            leads = True if leads is None else leads
            if leads:
                ahead = heading
            elif math.isfinite(time):
                rows[time].setdefault("heading", heading)
            continue
        leads = False if leads is None else leads
        if kind == "VTG":
            if math.isfinite(time) and len(cells) > 6:
                _velocity(rows[time], _number(cells[5], where, "speed"), _number(cells[1], where, "course"))
            continue
        if not cells[1]:  # before its first fix a receiver does not know the time
            time = math.nan
            continue
        time = next(stamps)
        row = rows.setdefault(time, {})
        lines.setdefault(time, number)
        if ahead is not None:
            row.setdefault("heading", ahead)
            ahead = None
        if kind == "GGA":
            row |= _place(cells, 2, where)
            row["quality"] = _number(cells[6], where, "quality")
            row["hdop"] = _number(cells[8], where, "HDOP")
            row["alt"] = _number(cells[9], where, "altitude") + _number(cells[11] or "0", where, "geoid separation")
            if row["quality"] == 0:
                row |= {"lat": math.nan, "lon": math.nan, "alt": math.nan}
        elif cells[2] == "A":
            if "lat" not in row:
                row |= _place(cells, 3, where)
            _velocity(row, _number(cells[7], where, "speed"), _number(cells[8], where, "course"))
    if len(rows) < 2:
        raise DataError(f"{path.name}: {len(rows)} epoch(s) of GGA or RMC sentences; at least 2 are needed")
    return _record(rows, list(lines.values()), path.name)


def _record(rows: dict[float, dict[str, float]], lines: list[int], source: str) -> GnssRecord:
    time = np.array(list(rows))
    order, late = put_in_order(time, "time", source, lambda row: f"line {lines[row]}")
    order = np.arange(len(rows)) if order is None else order

    def column(name: str) -> Any:
        return np.array([row.get(name, math.nan) for row in rows.values()])[order]

    v_n = np.column_stack([column("VE"), column("VN"), np.full(len(rows), math.nan)])
    hdop = column("hdop")
    dop = np.column_stack([np.where(hdop > 0, hdop, math.nan), np.full(len(rows), math.nan)])
    quality, heading = column("quality"), column("heading")
    return GnssRecord(
        time=time[order],
        lat=column("lat"),
        lon=column("lon"),
        alt=column("alt"),
        v_n=v_n if np.isfinite(v_n).any() else None,
        dop=dop if np.isfinite(dop).any() else None,
        quality=quality if np.isfinite(quality).any() else None,
        heading=heading if np.isfinite(heading).any() else None,
        source=source,
        late=late,
    )


def _stamps(sentences: Sequence[tuple[int, str, str]], source: str) -> list[float]:
    """Time of each sentence that has one, s; dates are those of RMC with a fix, or else of ZDA."""
    clock: list[float] = []
    dates: dict[str, list[float]] = {"RMC": [], "ZDA": []}
    for number, kind, body in sentences:
        cells, where = body.split(","), f"{source}: line {number}, {kind}"
        if kind not in TIMED or not cells[1]:
            continue
        clock.append(_clock(cells[1], where))
        good = kind == "ZDA" or cells[2] == "A"  # before its first fix a receiver may think that it is 1980
        for name, known in dates.items():
            known.append(midnight_of(kind, cells, where) if name == kind and good else math.nan)
    if not clock:
        return []
    now, by_rmc, by_zda = np.array(clock), *map(np.array, dates.values())
    return (now + midnights(now, by_rmc if np.isfinite(by_rmc).any() else by_zda)).tolist()


def _sentences(path: Path) -> Iterator[tuple[int, str, str]]:
    """Line number, kind and fields of each sentence that is wanted."""
    lines = path.read_bytes().splitlines()
    for number, line in enumerate(lines, 1):
        start = line.find(b"$")
        if start < 0 or line[start + 3 : start + 6] not in KINDS:
            continue
        kind = line[start + 3 : start + 6].decode()
        body, star, check = line[start + 1 :].partition(b"*")
        end = number in (1, len(lines))
        forms = [_with_zeros(body, kind), body] if check[2:3] == b"," else [body]  # two zeros that are left out cancel
        fits = [form for form in forms if not star or check[:2].upper() == _checksum(form)]
        if not fits:
            if end:
                continue
            raise DataError(
                f"{path.name}: line {number}: checksum {check[:2].decode(errors='replace')!r}; expected "
                f"{_checksum(body).decode()}: the sentence is damaged, remove the line"
            )
        text = fits[0].decode("ascii", "replace")
        cells = text.split(",")
        wanted = {"GGA": 12, "RMC": 9, "VTG": 6, "HDT": 3, "THS": 3, "ZDA": 5}[kind]
        if len(cells) >= wanted and cells[0][2:] == kind:
            yield number, kind, text
        elif not end:
            raise DataError(
                f"{path.name}: line {number}: {len(cells)} fields; expected {wanted} of {kind}: the sentence is cut short"
            )


def _checksum(body: bytes) -> bytes:
    return b"%02X" % reduce(lambda a, b: a ^ b, body, 0)


def _with_zeros(body: bytes, kind: str) -> bytes:
    """A sentence that a spreadsheet saved, which fills up its lines with commas, and leaves out the zeros of ``050420``."""
    cells = body.split(b",")
    for at, digits in DIGITS.get(kind, {}).items():
        if at < len(cells) and cells[at]:
            whole, point, rest = cells[at].partition(b".")
            cells[at] = whole.rjust(digits, b"0") + point + rest
    return b",".join(cells)


def _number(text: str, where: str, what: str) -> float:
    try:
        value = float(text) if text else math.nan
    except ValueError:
        value = math.inf
    if math.isinf(value):
        raise DataError(f"{where}: {what} {text!r}; expected a number")
    return value


def _clock(text: str, where: str) -> float:
    """Seconds of the day of ``hhmmss.ss``."""
    value = _number(text, where, "time")
    hours, minutes, seconds = value // 10000, value // 100 % 100, _number(text[4:], where, "seconds")
    if not (0 <= hours < 24 and minutes < 60 and seconds < 61):
        raise DataError(f"{where}: time {text!r}; expected hhmmss.ss")
    return 3600.0 * hours + 60.0 * minutes + seconds


def _heading(cells: list[str], where: str) -> float:
    """Radians of ``HDT,123.4,T`` or ``THS,123.4,A``; NaN where it is not true, or THS not autonomous."""
    sound = cells[2] in ("T", "A")
    return math.radians(_number(cells[1], where, "heading")) if sound else math.nan


def _place(cells: list[str], first: int, where: str) -> dict[str, float]:
    """Latitude and longitude from ``ddmm.mmmm, N, dddmm.mmmm, E``."""
    result = {}
    for name, at, digits, positive, negative in (("lat", first, 2, "N", "S"), ("lon", first + 2, 3, "E", "W")):
        text, side = cells[at : at + 2]
        if not text:
            result[name] = math.nan
            continue
        angle = _number(text[:digits], where, name) + _number(text[digits:], where, name) / 60.0
        if side not in (positive, negative):
            raise DataError(f"{where}: {name} on the side {side!r}; expected {positive} or {negative}")
        result[name] = math.radians(angle if side == positive else -angle)
    return result


def _velocity(row: dict[str, float], knots: float, course: float) -> None:
    """Add velocity east and north of speed (kn) and course (deg); a receiver that stands still leaves its course empty."""
    if math.isnan(knots) or "VE" in row:
        return
    course = 0.0 if math.isnan(course) and knots == 0.0 else math.radians(course)
    row["VE"], row["VN"] = knots * KNOT * math.sin(course), knots * KNOT * math.cos(course)
