"""What a paper claims, and whether it holds: rules written as data, settled on the table of a study.

A rule has conditions. All of them met: the claim holds. Some: it holds in part. None: it does not hold. A condition whose
test needs more runs than there are makes it "too few runs". The tests of a condition:

exact     the two numbers are compared as they stand: ranks, and scenarios without random numbers
interval  the 95 % interval of the number (or of the ratio of both numbers), by bootstrap over the runs, lies on the right
          side of the limit
paired    two methods on the same runs: the first has the smaller (or larger) error in most runs, the two-sided sign test
          gives p < .05, and the ratio of the RMS agrees

Source: B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap, 1993, ch. 13; for shares of runs the sign test is
McNemar's.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.comparison import paired as compare_runs
from truenorth.core.errors import UsageError
from truenorth.core.units import significant
from truenorth.papers.table import OF_RUNS, Reference, Table

Array = NDArray[np.float64]
Verdict = Literal["holds", "holds in part", "does not hold", "too few runs"]
Test = Literal["exact", "interval", "paired"]

NEEDED = {"exact": 1, "interval": 10, "paired": 10}  # 10: 9 of 10 give a two-sided p below .05
SURE = 0.05
LEVEL = 0.95
RESAMPLES = 2000


@dataclass(frozen=True)
class Condition:
    """One condition of a rule: ``one < factor * other``, ``>`` likewise, or ``=``."""

    one: str  # a reference to the table; see :class:`truenorth.papers.table.Reference`
    relation: Literal["<", ">", "="]
    other: str | float  # another reference, or a number in the unit of `one`
    test: Test
    factor: float = 1.0  # of `other`
    runs: int = 0  # that the test needs; 0 for its own least number

    @property
    def needed(self) -> int:
        """Runs that the test needs."""
        return max(self.runs, NEEDED[self.test])


def condition(text: str, test: Test, runs: int = 0) -> Condition:
    """Read ``one < other``, ``one < factor * other`` or ``one = number``.

    Raises
    ------
    UsageError
        A text of another form.
    """
    parts = re.fullmatch(r"(.+?) ([<>=]) (?:(\S+) \* )?(.+)", text)
    if parts is None:
        raise UsageError(f"{text!r}: expected one < other, with numbers of the table")
    one, relation, factor, other = parts.groups()
    number = float(other) if " " not in other else other
    return Condition(one, relation, number, test, float(factor or 1.0), runs=runs)  # type: ignore[arg-type]


def exact(text: str, runs: int = 0) -> Condition:
    """Compare two numbers as they stand."""
    return condition(text, "exact", runs)


def interval(text: str, runs: int = 0) -> Condition:
    """Compare by the interval of a bootstrap."""
    return condition(text, "interval", runs)


def paired(text: str, runs: int = 0) -> Condition:
    """Compare two methods run by run."""
    return condition(text, "paired", runs)


@dataclass(frozen=True)
class Rule:
    """A claim and how it is decided."""

    claim: str  # as the paper means it
    conditions: tuple[Condition, ...]
    words: str = ""  # what else is to be said; numbers of the table as ``{case method quantity@time statistic:format}``
    by: Literal["paper", "related work", "ours"] = "paper"  # who claims it


@dataclass(frozen=True)
class Check:
    """A condition, tested."""

    met: bool | None  # None where there are too few runs
    runs: int
    text: str  # with its figures


@dataclass(frozen=True)
class Claim:
    """A claim, settled."""

    text: str
    verdict: Verdict
    checks: tuple[Check, ...]
    evidence: str = ""
    by: str = "paper"

    @property
    def runs(self) -> int:
        """Of the test with the fewest."""
        return min(check.runs for check in self.checks)


def settle(rules: Sequence[Rule], table: Table, more: Mapping[str, Any] | None = None) -> list[Claim]:
    """Settle the claims of a study.

    Parameters
    ----------
    rules : sequence of Rule
    table : Table
    more : mapping, optional
        Texts that the words of a rule name, as ``{name}``.

    Raises
    ------
    UsageError
        A rule that asks for what the table does not have.
    """
    return [settled(rule, table, more or {}) for rule in rules]


def settled(rule: Rule, table: Table, more: Mapping[str, Any]) -> Claim:
    """One of them."""
    checks = tuple(check(condition, table) for condition in rule.conditions)
    met = [c.met for c in checks]
    verdict: Verdict = "holds" if all(met) else "holds in part" if any(met) else "does not hold"
    if None in met:
        verdict = "too few runs"
    return Claim(rule.claim, verdict, checks, filled(rule.words, table, more), rule.by)


def filled(text: str, table: Table, more: Mapping[str, Any]) -> str:
    """A text with the numbers and words that it names."""
    return _Words(table).vformat(text, (), more)


def check(condition: Condition, table: Table) -> Check:
    """Test a condition."""
    one = Reference.read(condition.one)
    other = Reference.read(condition.other) if isinstance(condition.other, str) else None
    a, unit, count = table.number(one)
    b, _, others = table.number(other) if other is not None else (float(condition.other), "", count)
    A, B = _runs(table, one), None if other is None else _runs(table, other)
    if condition.test != "interval" or B is not None:
        count = min(count, others)
    beyond = f"{condition.factor:g} x " if condition.factor != 1.0 else ""
    against = f"{beyond}{other} ({significant(b)})" if other is not None else f"{beyond}{b:g}"
    size = significant(a) if unit == "1" else f"{significant(a)} {unit}"
    text = f"{one}, {one.statistic.replace('_', ' ')} {size} {condition.relation} {against}"
    if count < condition.needed:
        return Check(None, count, f"{text}: {condition.test} test needs {condition.needed} runs, there are {count}")
    met, why = _test(condition, a, b, A, B, one.statistic)
    return Check(met, count, f"{text}: {'yes' if met else 'no'}{why}")


def _test(
    condition: Condition, a: float, b: float, A: Array | None, B: Array | None, statistic: str
) -> tuple[bool, str]:
    limit = condition.factor * b
    smaller = condition.relation == "<"
    if condition.test == "exact":
        met = a == limit if condition.relation == "=" else a < limit if smaller else a > limit
        return bool(met), ""
    if A is None or condition.relation == "=":
        raise UsageError(f"{condition.one}: a test of kind {condition.test} needs single runs, and < or >")
    if condition.test == "interval":
        low, high = _interval(A, B, statistic)
        what = "ratio, " if B is not None else ""
        target = condition.factor if B is not None else limit
        return bool(
            high < target if smaller else low > target
        ), f" ({what}95 % interval {significant(low)} to {significant(high)})"
    if B is None:
        raise UsageError(f"{condition.one}: a paired test needs another method")
    n = min(len(A), len(B))
    first, second = (A[:n], condition.factor * B[:n]) if smaller else (condition.factor * B[:n], A[:n])
    runs, wins, _, ratio, p = compare_runs(first, second)
    met = wins > 0.5 and p < SURE and not ratio > 1.0
    return bool(met), f" (so in {wins:.0%} of {runs} runs, sign test {'p < .0001' if p < 1e-4 else f'p = {p:.3g}'})"


def _runs(table: Table, reference: Reference) -> Array | None:
    sample = table.sample(reference)
    return None if sample is None else sample.of(reference.statistic)


def _interval(A: Array, B: Array | None, statistic: str) -> tuple[float, float]:
    """Percentile interval of a statistic, or of the ratio of two, with runs of the same number drawn together."""
    n = len(A) if B is None else min(len(A), len(B))
    of = OF_RUNS[statistic if statistic in OF_RUNS else "rms"]
    draws = np.random.default_rng(n).integers(0, n, (RESAMPLES, n))
    found = of(A[draws]) / (1.0 if B is None else of(B[draws]))
    low, high = np.quantile(found, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return float(low), float(high)


class _Words(string.Formatter):
    """Fills ``{case method quantity@time statistic:format}`` from a table."""

    def __init__(self, table: Table) -> None:
        self.table = table

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> tuple[Any, str]:
        """The number, or a text by its name."""
        if field_name in kwargs:
            return kwargs[field_name], field_name
        return self.table.number(Reference.read(field_name))[0], field_name


def markdown(title: str, claims: Sequence[Claim], remarks: Sequence[str] = ()) -> str:
    """The text of claims.md."""
    lines = [f"# {title}: the claims", ""]
    for number, claim in enumerate(claims, 1):
        whose = "" if claim.by == "paper" else f" ({claim.by})"
        lines += [f"## {number}. {claim.text}{whose}", "", f"**{claim.verdict.capitalize()}.** {claim.evidence}", ""]
        lines += [*(f"- {check.text}" for check in claim.checks), ""]
    if remarks:
        lines += ["## Remarks", "", *(f"- {remark}" for remark in remarks), ""]
    return "\n".join(lines)
