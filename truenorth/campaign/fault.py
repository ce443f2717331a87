"""A fault: one thing that goes wrong with the inputs of a procedure, by a drawn size."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

Inputs = dict[str, Any]  # of a procedure: its records, its place, its specification, its start
Rng = np.random.Generator


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong."""

    name: str
    needs: str  # the input that it spoils; procedures without it are not asked
    apply: Callable[[Inputs, Rng], tuple[Inputs, str]]  # to the spoilt inputs and the drawn size in words


def of_log(name: str, key: str, spoil: Callable[[Any, Rng], tuple[Any, str]]) -> Fault:
    """A fault of one log: the function takes the log and gives the spoilt one, and the size in words."""

    def apply(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
        log, size = spoil(inputs[key], rng)
        return inputs | {key: log}, size

    return Fault(name, key, apply)


def either(rng: Rng, low: float, high: float) -> float:
    """A size between two, up or down."""
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))


def over_decades(rng: Rng, low: float, high: float) -> float:
    """A size between two, all decades alike."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def clock_rate(record: Any, rng: Rng) -> tuple[Any, str]:
    """A clock that runs fast or slow by .5 to 3 %."""
    k = 1.0 + either(rng, 0.005, 0.03)
    return replace(record, time=record.time[0] + k * (record.time - record.time[0])), f"{100 * (k - 1):+.2f} %"
