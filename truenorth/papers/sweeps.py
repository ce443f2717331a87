"""Choices that a paper leaves open, changed one by one, and whether a verdict depends on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from truenorth.papers.claims import Condition, Rule, Verdict, settled
from truenorth.papers.table import Reference, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ACROSS = 3  # panels in a row


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
    study: Verdict  # of the study itself, which may have more runs

    @property
    def depends(self) -> bool:
        """Whether they differ; never where there are too few runs."""
        return not self.open and len(set(self.verdicts.values())) > 1

    @property
    def open(self) -> bool:
        """Whether there are too few runs to say, or too few to say at our choice what all runs of the study say."""
        return (
            "too few runs" in self.verdicts.values() or self.verdicts.get(self.sweep.chosen, self.study) != self.study
        )

    @property
    def always(self) -> Verdict:
        """Of one that does not depend on the choice."""
        return next(iter(self.verdicts.values()))

    def __str__(self) -> str:
        """In words."""
        name = f"{self.sweep.label} ({', '.join(f'{value:g}' for value in self.verdicts)})"
        if self.open:
            ours = self.verdicts.get(self.sweep.chosen, self.study)
            why = (
                "" if ours == self.study else f" (at our choice they say: {ours}; all runs of the study: {self.study})"
            )
            return f'Whether "{self.claim}" depends on {name}: too few runs{why}.'
        if not self.depends:
            return f'"{self.claim}" does not depend on {name}: {self.always}.'
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
                ours = replace(rule, words="") if _there(rule, table) else moved[sweep.chosen]
                found.append(Swept(sweep, rule.claim, verdicts, settled(ours, table, {}).verdict))
    return found


def dependences(found: Sequence[Swept]) -> list[str]:
    """What depends on each choice, claim by claim; what does not, and what too few runs leave open, together."""
    lines = []
    for sweep in dict.fromkeys(s.sweep for s in found):
        own = [s for s in found if s.sweep == sweep]
        name = f"{sweep.label} ({', '.join(f'{value:g}' for value in sweep.values)})"
        same = [s for s in own if not s.depends and not s.open]
        few = [s for s in own if s.open]
        lines += [str(s) for s in own if s.depends]
        if same:
            claims = "; ".join(f'"{s.claim}" ({s.always})' for s in same)
            lines.append(f"Not dependent on {name}: {claims}.")
        if few:
            claims = "; ".join(f'"{s.claim}"' for s in few)
            lines.append(f"Too few runs to say whether it depends on {name}: {claims}.")
    return lines


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
    table: Table,
    sweeps: Sequence[Sweep],
    found: Sequence[Swept],
    names: Mapping[str, str],
    quantity: str = "heading@600",
    unit: str = "arcmin",
) -> Figure:
    """RMS of a quantity over the values of each choice, a line a method; the title says which verdicts depend on it.

    `names` are what the methods are called, each with the colour of its place.
    """
    from matplotlib.ticker import LogLocator, NullLocator

    from truenorth.figures.style import COLOURS, REFERENCE
    from truenorth.papers.drawing import sheet

    of, _, at = quantity.partition("@")
    when = f"{at.replace('h', '')} {'h' if 'h' in at else 's'}"
    columns = 2 if len(sweeps) == 4 else min(len(sweeps), ACROSS)
    rows = -(-len(sweeps) // columns)
    with sheet(4.2 * columns + 0.6, 3.8 * rows + 0.6, rows, columns, sharey=True, legend=6) as (figure, axes):
        grid = np.reshape(axes, -1)
        for ax, sweep in zip(grid, sweeps, strict=False):
            first = sweep.case_of(sweep.values[0])
            methods = {f.method for f in table.figures if f.case == first}
            for number, (method, name) in enumerate(names.items()):  # one order, one legend for all
                if method not in methods:
                    continue
                values = [table.number_of(f"{sweep.case_of(v)} {method} {quantity}") for v in sweep.values]
                width = max(1.0, 3.0 - 0.5 * number)
                ax.plot(sweep.values, values, "o-", markersize=4, linewidth=width, color=COLOURS[number], label=name)
            ax.axvline(sweep.chosen, color=REFERENCE, linestyle="--", linewidth=0.8)
            ax.set(yscale="log", xlabel=sweep.label, xscale="log" if sweep.logarithmic else "linear")
            ax.set_xticks(sweep.values, [f"{v:g}" for v in sweep.values], fontsize=8)
            ax.xaxis.set_minor_locator(NullLocator())
            ax.margins(x=0.07)
            depend = sum(s.depends for s in found if s.sweep == sweep)
            all_of = sum(s.sweep == sweep for s in found)
            unsettled = any(s.open for s in found if s.sweep == sweep)
            words = "too few runs to say" if unsettled else f"changes {depend} of {all_of} verdicts"
            ax.set_title(words if all_of else "no verdict to be changed", fontsize=9)
        low, high = grid[0].get_ylim()
        for ax in grid[::columns]:  # the others share it
            ax.yaxis.set_major_locator(
                LogLocator(subs=(1.0, 2.0, 5.0) if high > 10.0 * low else (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
            )
            ax.yaxis.set_major_formatter("{x:g}")
            ax.yaxis.set_minor_locator(NullLocator())
            ax.set_ylabel(f"{of.replace('_', ' ')} RMS at {when}, {unit}")
        for ax in grid[len(sweeps) :]:
            ax.set_visible(False)
    return figure
