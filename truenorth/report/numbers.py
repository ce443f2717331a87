"""Figures spelt for reading."""

from __future__ import annotations

import numpy as np

from truenorth.core.units import parse_unit

LEAST = 1e-12  # of any quantity in its unit


def short(x: float) -> str:
    """Three significant digits, never with an exponent; what is zero but for rounding is zero."""
    return "0" if abs(x) < LEAST else str(np.format_float_positional(x, precision=3, fractional=False, trim="-"))


def of_sigma(x: float, sigma: float) -> str:
    """A value to the third digit of its sigma: smaller ones are chance."""
    if not 0.0 < sigma < np.inf:
        return short(x)
    rounded = round(float(x), 2 - int(np.floor(np.log10(sigma)))) + 0.0  # no minus zero
    return np.format_float_positional(rounded, trim="-")


def quantity(value: float, unit: str) -> str:
    """An SI value in a datasheet unit."""
    spelt = unit.replace("ug", "µg").replace("sqrt(h)", "√h").replace("sqrt(Hz)", "√Hz")
    return f"{short(value / parse_unit(unit)[0])} {spelt}"
