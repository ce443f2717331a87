"""Choices that a paper leaves open, changed one by one, and whether a verdict depends on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from truenorth.papers.claims import Condition, Rule, Verdict, settled
from truenorth.papers.table import Reference, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Sweep:
    """One choice."""

    case: str  # in which our choice is made
    name: str  # of the choice; its cases in the table are `case`_`name`_`value`
    label: str  # with the unit
    chosen: float  # ours
    values: tuple[float, ...]
    logarithmic: bool = True  # the axis

    def case_of(self, value: float) -> str:
        """Name of the case with a value."""
        return f"{self.case}_{self.name}_{value:g}"


@dataclass(frozen=True)
class Swept:
    """The verdicts on one claim over the values of a choice."""

    sweep: Sweep
    claim: str
    verdicts: dict[float, Verdict]

    @property
    def depends(self) -> bool:
        """Whether they differ; never where there are too few runs."""
        return not self.open and len(set(self.verdicts.values())) > 1

    @property
    def open(self) -> bool:
        """Whether there are too few runs to say."""
        return "too few runs" in self.verdicts.values()

    def __str__(self) -> str:
        """In words."""
        name = f"{self.sweep.label} ({', '.join(f'{value:g}' for value in self.verdicts)})"
        if self.open:
            return f'Whether "{self.claim}" depends on {name}: too few runs.'
        if not self.depends:
            return f'"{self.claim}" does not depend on {name}: {next(iter(self.verdicts.values()))}.'
        each = "; ".join(f"{value:g}: {verdict}" for value, verdict in self.verdicts.items())
        return f'"{self.claim}" depends on {self.sweep.label}: {each}.'


def swept(rules: Sequence[Rule], table: Table, sweeps: Sequence[Sweep]) -> list[Swept]:
    """Settle anew, for each value of each choice, the rules that ask for its case and whose conditions can all be had there."""
    found = []
    for sweep in sweeps:
        for rule in rules:
            moved = {value: _moved(rule, sweep, value) for value in sweep.values}
            if moved[sweep.values[0]].conditions != rule.conditions and all(_there(m, table) for m in moved.values()):
                verdicts = {value: settled(m, table, {}).verdict for value, m in moved.items()}
                found.append(Swept(sweep, rule.claim, verdicts))
    return found


def _moved(rule: Rule, sweep: Sweep, value: float) -> Rule:
    def move(text: str) -> str:
        case, rest = text.split(" ", 1)
        return f"{sweep.case_of(value)} {rest}" if case.partition("/")[0] == sweep.case else text

    def condition(c: Condition) -> Condition:
        return replace(c, one=move(c.one), other=move(c.other) if isinstance(c.other, str) else c.other)

    return replace(rule, conditions=tuple(condition(c) for c in rule.conditions), words="")


def _there(rule: Rule, table: Table) -> bool:
    cases = {f.case for f in table.figures}
    keys = {(key[0], key[2], key[3]) for key in table.samples} | {(f.case, f.method, f.quantity) for f in table.figures}
    references = [Reference.read(text) for c in rule.conditions for text in (c.one, c.other) if isinstance(text, str)]
    return all(r.case in cases and (r.case, r.method, r.quantity) in keys for r in references)


def draw_sweeps(
    table: Table, sweeps: Sequence[Sweep], found: Sequence[Swept], quantity: str = "heading@600", unit: str = "arcmin"
) -> Figure:
    """RMS of a quantity over the values of each choice, a line a method; the title says which verdicts depend on it."""
    from matplotlib.ticker import LogLocator, NullLocator

    from truenorth.figures.style import COLOURS, REFERENCE, new_figure, style

    with style():
        figure = new_figure(4.2 * len(sweeps) + 0.6, 4.6)
        axes = np.atleast_1d(figure.subplots(1, len(sweeps), sharey=True))
        for ax, sweep in zip(axes, sweeps, strict=True):
            first = sweep.case_of(sweep.values[0])
            methods = sorted({f.method for f in table.figures if f.case == first})  # one order, one legend for all
            for number, (method, colour) in enumerate(zip(methods, COLOURS, strict=False)):
                values = [table.number_of(f"{sweep.case_of(v)} {method} {quantity}") for v in sweep.values]
                ax.plot(
                    sweep.values,
                    values,
                    "o-",
                    markersize=4,
                    linewidth=max(1.0, 3.0 - 0.5 * number),
                    color=colour,
                    label=method,
                )
            ax.axvline(sweep.chosen, color=REFERENCE, linestyle="--", linewidth=0.8)
            ax.set(yscale="log", xlabel=sweep.label, xscale="log" if sweep.logarithmic else "linear")
            ax.set_xticks(sweep.values, [f"{v:g}" for v in sweep.values])
            ax.xaxis.set_minor_locator(NullLocator())
            ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            ax.yaxis.set_major_formatter("{x:g}")
            ax.yaxis.set_minor_locator(NullLocator())
            depend = sum(s.depends for s in found if s.sweep == sweep)
            of = sum(s.sweep == sweep for s in found)
            unsettled = any(s.open for s in found if s.sweep == sweep)
            words = "too few runs to say" if unsettled else f"{depend} of {of} verdicts depend on it"
            ax.set_title(words if of else "no verdict to be changed", fontsize=9)
        axes[0].set_ylabel(f"{quantity.partition('@')[0]} RMS, {unit}")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=6)
    return figure
