"""The names of a text's columns, from the lines above its rows: names, units and sources below them, groups above them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from truenorth.core.errors import DataError
from truenorth.formats.dialect import DELIMITERS, Dialect, is_remark

SENTENCE = re.compile(r"\$?[A-Z]{5},.*\*[0-9A-F]{2}")


def header_of(
    path: Path, dialect: Dialect, above: list[tuple[int, str]], count: int, first_cells: list[str]
) -> tuple[list[str], set[int]]:
    """Names of the columns from the lines above the first row, and which of these lines they are.

    Raises
    ------
    DataError
        A header of another number of columns.
    """
    units: list[str] | None = None
    sources: list[str] | None = None
    unit_line = source_line = -1
    for k in range(len(above) - 1, -1, -1):
        line = above[k][1]
        if not line.strip(",;|\t ") or SENTENCE.fullmatch(line.strip()):
            continue  # separators and nothing between them, or what a receiver says
        plain = line.lstrip("#%/ \t") if is_remark(line) else line
        for delimiter in (dialect.delimiter, *DELIMITERS):
            names = Dialect(delimiter, ".").cells(plain)
            if 2 < len(names) < count and not any(first_cells[len(names) :]) and not all(map(dialect.is_number, names)):
                names += [""] * (count - len(names))  # separators at the end of each row
            if len(names) == count + 1 and not names[-1]:
                names = names[:-1]  # a separator at the end of the header alone
            if len(names) == count and not all(map(dialect.is_number, names)):
                break
        else:
            cells = dialect.cells(line)
            listed = dialect.delimiter is not None and not is_remark(line) and k == len(above) - 1
            # Numbers alone are no header but a row that lacks its beginning: a logger that was switched on in its midst.
            if listed and len(cells) >= max(3, count // 2) and dialect.share(cells) < 0.5:
                raise DataError(
                    f"{path.name}: line {above[k][0]}: a header of {len(cells)} columns above rows of {count}; "
                    "expected as many of each: if commas stand both between columns and in decimals, write the log with "
                    "another separator"
                )
            continue
        if units is None and _are_units(names) and k > 0:
            units, unit_line = names, k
            continue
        if k > 1 and units is sources is None and _are_sources(names, dialect.cells(above[k - 1][1])):
            sources, source_line = names, k
            continue
        if sources is not None:
            names = _of_sources(names, sources)
        if units is not None:
            names = [f"{name} [{_bare(unit)}]" if unit.strip("[]()- ") else name for name, unit in zip(names, units)]
        if sources is None and k > 0 and (whole := _of_groups(dialect.cells(above[k - 1][1]), names)):
            return whole, {k, k - 1, unit_line}
        return names, {k, unit_line, source_line}
    return [], set()


def _of_groups(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    """Names under the cells of a spreadsheet that span several columns: ``IMU Gyroscope;;`` above ``X;Y;Z``; empty: no such line.

    Only where names alone do not tell the columns apart.
    """
    listed = sum(map(bool, groups))
    if len(set(names)) == len(names) or not 1 < listed < len(names) or len(groups) > len(names) + 1 or not groups[0]:
        return []
    whole, group = [], ""
    for k, name in enumerate(names):
        group = (groups[k] if k < len(groups) else "") or group
        whole.append(f"{group} {name}".strip())
    return whole


def _are_sources(cells: Sequence[str], above: Sequence[str]) -> bool:
    """Whether a line under that of the units says which device each column is of: few words that come again, or none."""
    return len(above) == len(cells) and 2 * len(set(cells) - {""}) <= len(cells) and _are_units(above)


def _of_sources(names: Sequence[str], sources: Sequence[str]) -> list[str]:
    """Names that several devices have, with the device in front: ``100: gps::speed``; the others as they are."""
    return [f"{source}::{name}" if source and names.count(name) > 1 else name for name, source in zip(names, sources)]


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a line under the header holds the units."""
    from truenorth.formats.units import unit_in

    said = [_bare(cell) for cell in cells]
    known = [unit_in(cell) is not None or cell in ("", "-") for cell in said]
    return sum(known) >= 0.7 * len(cells) and any(unit_in(cell) is not None and len(cell) > 1 for cell in said)


def _bare(cell: str) -> str:
    """A unit without the brackets around it; those inside stay: ``m/(s^2)``."""
    cell = cell.strip()
    while len(cell) > 1 and cell[0] + cell[-1] in ("[]", "()"):
        cell = cell[1:-1].strip()
    return cell
