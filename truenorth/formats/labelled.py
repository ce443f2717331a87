"""Lines whose numbers carry their names: ``ax:0.10 ay:0.02 az:9.81``, as for the plotter of the Arduino IDE, and flat JSON lines.

A sample may take several lines, as in the examples of Adafruit's libraries (``Acceleration X: 0.1, Y: 0.2, Z: 9.8 m/s^2``, then
rates, then the temperature). The lines become a table of commas; each row stays on the last of its lines, so that messages name
lines of the file. What a device says when it starts stands above the first whole row and is counted.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from truenorth.core.errors import DataError
from truenorth.formats.units import split, unit_in

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
TIME = r"(?:\d{4}-\d\d-\d\d[T ])?\d{1,2}:\d\d:\d\d(?:\.\d+)?Z?"
# a label, its mark, a value: a number, a time, or what is written for none
PAIR = re.compile(
    rf"([A-Za-zω_](?:[^,;|\t=]*?[^,;|\t=\s:])??)\s*[:=]\s*({TIME}|{NUMBER}|-?nan\b|-?inf\b|ovf\b|null\b)", re.IGNORECASE
)
STAMP = re.compile(rf"({TIME}|{NUMBER})\s*(?:->|:|,|;|\t|\s|$)\s*")
OF_ESP = re.compile(r"(?:\x1b\[[\d;]*m)?[EWIDV] \((\d+)\) [^:\s]+: ")  # the log of ESP-IDF: ms since the start
NOTE = "labelled values"
FEWEST, MOST_LINES = 3, 6  # values of a sample, and its lines
MOSTLY = 0.9  # of the lines that are alike
SAMPLE = 40  # lines that are looked at
HEAD = 1 << 14  # bytes in which empty lines are looked for
AXIS = re.compile(r"[XYZxyz]")
VALUE = r"([^\s,;|]*?)"


@dataclass(frozen=True)
class Line:
    """The labels of a line, the units behind their values, and the line as a pattern of its values."""

    labels: tuple[str, ...]
    units: tuple[str | None, ...]
    pattern: str


@dataclass(frozen=True)
class Labelled:
    """A table of commas that was made of labelled lines, without a header."""

    text: bytes
    names: list[str]
    skip: int  # lines above the first row
    above: tuple[str, ...]
    notes: tuple[str, ...]


def table_of_labels(name: str, text: bytes, head: Sequence[str]) -> Labelled | None:
    """The table in a text of labelled lines; None where the last lines of its head are no such lines.

    Parameters
    ----------
    name : str
        Of the file, for messages.
    text : bytes
    head : sequence of str
        Its first lines that are not empty.

    Raises
    ------
    DataError
        A line among the rows that has other labels: with its number.
    """
    lines = [_line(line) for line in head[:-1][-SAMPLE:] or head]
    found = sum(line is not None for line in lines)
    if found < MOSTLY * len(lines) or not found:
        return None
    of_head = [line for line in map(_line, head) if line is not None]
    group = _group([line for line in lines if line is not None], of_head, _after_empty_lines(text))
    if group is None or sum(len(line.labels) for line in group) < FEWEST:
        return None
    patterns = [re.compile(line.pattern) for line in group]
    rows: list[str] = []
    above: list[str] = []
    values: list[str] = []
    skip, expected = 0, 0
    raw = [line.decode("utf-8", "replace") for line in text.splitlines()]
    last = max(k for k, line in enumerate(raw) if line.strip())
    cut = ""
    for k, line in enumerate(raw):
        match = patterns[expected].fullmatch(_bare(line)) if line.strip() else None
        if (
            match is None and not skip
        ):  # above the first whole row: what a device says when it starts, or a part of a row
            values, expected = [], 0
            match = patterns[0].fullmatch(_bare(line)) if line.strip() else None
        if match is not None:
            values += match.groups()
            expected = (expected + 1) % len(group)
            skip = skip or (k + 1 if expected == 0 else 0)
        elif line.strip() and k == last and skip:
            cut = "the last line is cut: left out"
        elif line.strip() and skip:
            wanted = ", ".join(group[expected].labels)
            raise DataError(
                f"{name}: line {k + 1}: {line.strip()[:60]!r}; expected values of {wanted}, as in the other lines: remove the line"
            )
        if line.strip() and not skip:
            above.append(line.strip())
        rows.append(",".join(values) if match is not None and expected == 0 else "")
        values = [] if match is not None and expected == 0 else values
    if not skip:
        return None
    if expected:
        cut = "the last sample is cut: left out"
    above = above[: len(above) - (len(group) - 1)]
    boot = f"lines above the first sample left out: {len(above)}, the first is {above[0][:60]!r}" if above else ""
    names = _unique([named for line in _with_stems(group) for named in line])
    # The first row is one line of the file, whatever stood above.
    return Labelled(
        ("\n".join(rows) + "\n" * text.endswith((b"\n", b"\r"))).encode(),
        names,
        skip - 1,
        tuple(above),
        tuple(filter(None, (NOTE, boot, cut))),
    )


def _bare(line: str) -> str:
    """A line without blanks around it; one of flat JSON without its braces and quotes."""
    line = line.strip()
    if line.startswith("{") and line.rstrip(",").endswith("}") and "{" not in line[1:]:
        line = line.rstrip(",")[1:-1].replace('"', "").strip()
    return line.rstrip(",;| \t")


def _line(line: str) -> Line | None:
    """What a labelled line is; None where anything else stands between its values than separators and units."""
    text = _bare(line)
    labels: list[str] = []
    units: list[str | None] = []
    pattern, at = "", 0
    if (start := OF_ESP.match(text) or STAMP.match(text)) is not None:
        labels.append("time_ms" if start.re is OF_ESP else "time" if ":" in start[1] else "first")
        units.append(None)
        pattern = _flexible(text[: start.start(1)]) + VALUE + _flexible(text[start.end(1) : start.end()])
        if start.re is OF_ESP:
            pattern = r"(?:\x1b\[[\d;]*m)?[EWIDV] \((\d+)\) " + _flexible(text[start.end(1) + 2 : start.end()])
        at = start.end()
    for pair in PAIR.finditer(text, at):
        between, label = text[at : pair.start()], pair[1]
        words = label.split()
        for count in range(min(2, len(words) - 1), 0, -1):  # ``0.1 m/s^2 ay: 0.2``: a unit before the label
            if unit_in(" ".join(words[:count])) is not None and units:
                between, label = between + " ".join(words[:count]), " ".join(words[count:])
                break
        if not _is_between(between, units):
            return None
        labels.append(re.sub(r"\s*:\s*", " ", label).strip())
        units.append(None)
        pattern += _flexible(text[at : pair.start(2)]) + VALUE
        at = pair.end()
    if not labels or not _is_between(text[at:].removesuffix("\x1b[0m"), units):
        return None
    return Line(tuple(labels), tuple(units), pattern + _flexible(text[at:]))


def _is_between(between: str, units: list[str | None]) -> bool:
    """Whether separators and the unit of the value before stand there; the unit is noted."""
    said = between.strip(" \t,;|")
    if not said:
        return True
    said = said.strip("[]()").replace("°", "deg")
    known = unit_in(said) or ("degC" if re.fullmatch(r"(?:deg)? ?C(?:elsius)?", said) else None)
    if known is None or not units:
        return False
    units[-1] = known
    return True


def _flexible(literal: str) -> str:
    """A pattern of what stands between values, with blanks of any number."""
    parts = [re.escape(part) for part in re.split(r"\s+", literal)]
    return r"\s*".join(parts)


def _group(sample: Sequence[Line], lines: Sequence[Line], begin: set[tuple[str, ...]]) -> list[Line] | None:
    """The lines that a sample takes, by what repeats in the last lines of the head, from where it first stands whole.

    Where empty lines stand between samples, one of those that `begin` after them is the first: a log may begin inside a sample.
    """
    for count in range(1, MOST_LINES + 1):
        same = [a.labels == b.labels for a, b in zip(sample, sample[count:])]
        if not same or sum(same) < MOSTLY * len(same):
            continue
        common = Counter(line.labels for line in sample).most_common(count)
        if len(common) < count:
            continue
        wanted = {labels for labels, _ in common}
        first = wanted & begin if len(wanted & begin) == 1 else wanted
        for k in range(len(lines) - count + 1):
            if {line.labels for line in lines[k : k + count]} == wanted and lines[k].labels in first:
                return list(lines[k : k + count])
    return None


def _after_empty_lines(text: bytes) -> set[tuple[str, ...]]:
    """The labels of lines that stand behind an empty one, more than once."""
    raw = [line.decode("utf-8", "replace") for line in text[:HEAD].splitlines()]
    behind = [_line(line) for before, line in pairwise(raw) if line.strip() and not before.strip()]
    found = Counter(line.labels for line in behind if line is not None)
    return {labels for labels, count in found.items() if count > 1}


def _with_stems(group: Sequence[Line]) -> list[list[str]]:
    """Names of columns: ``Y`` after ``Acceleration X`` is ``Acceleration Y``, and a unit behind three values is that of all."""
    named: list[list[str]] = []
    for line in group:
        stems: list[str] = []
        stem = ""
        for label in line.labels:
            if AXIS.fullmatch(label) is None:
                stem = label[:-1].rstrip() if AXIS.fullmatch(label[-1]) and not label[-2:-1].isalpha() else ""
                stems.append(stem or label)
            else:
                stems.append(stem)
        said = {stem: unit for stem, unit in zip(stems, line.units) if unit is not None}
        named.append([_of(label, stem, said.get(stem)) for label, stem in zip(line.labels, stems)])
    return named


def _of(label: str, stem: str, unit: str | None) -> str:
    whole = f"{stem} {label}" if AXIS.fullmatch(label) and stem else label
    return f"{whole} [{unit}]" if unit is not None and split(whole)[1] is None else whole


def _unique(names: Sequence[str]) -> list[str]:
    seen: Counter[str] = Counter()
    result = []
    for name in names:
        seen[name] += 1
        result.append(name if seen[name] == 1 else f"{name} {seen[name]}")
    return result
