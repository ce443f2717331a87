"""What a study says, as data in a YAML file of its own: title, claims with their tests, captions of its drawings, remarks.

    claims:
    - claim: as the paper means it
      by: paper (the default), related work or ours
      if:
      - paired flat_turn states16 level@120-150 < 0.67 * flat_turn states12 level@120-150
      - interval(20) B kf heading@600 rms_over_sigma < 1.5
      words: what else is to be said

A line of ``if`` is a test (with the runs that it needs, where these are more than its own) and a condition of
:mod:`truenorth.papers.claims`. Texts name numbers of the table as ``{case method quantity@time statistic:format}`` and what the
study gives them as ``{name:format}``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truenorth.core.errors import UsageError
from truenorth.core.yaml_file import read_mapping
from truenorth.papers.claims import Condition, Rule, condition, filled, settle
from truenorth.papers.study import Study
from truenorth.papers.table import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Texts:
    """Of a study; numbers of its table not yet filled in."""

    title: str
    rules: tuple[Rule, ...]
    captions: Mapping[str, str]
    remarks: Sequence[str]

    def study(self, table: Table, drawings: Mapping[str, Figure], remarks: Sequence[str] = (), **given: Any) -> Study:
        """The study, its claims settled; `remarks` follow those of the file, texts may name what is `given`."""
        captions = {name: filled(text, table, given) for name, text in self.captions.items()}
        words = [filled(text, table, given) for text in self.remarks]
        return Study(self.title, table, settle(self.rules, table, given), drawings, captions, [*words, *remarks])


def read_texts(module: str) -> Texts:
    """Of the study in a module file: ``claims.yaml`` next to a ``study.py``, ``NAME.yaml`` next to a ``NAME.py``.

    Raises
    ------
    DataError, UsageError
        No such file, or a test that is not understood.
    """
    path = Path(module)
    content = read_mapping(path.with_name("claims.yaml") if path.stem == "study" else path.with_suffix(".yaml"))
    rules = [
        Rule(claim["claim"], tuple(map(_condition, claim["if"])), claim.get("words", ""), claim.get("by", "paper"))
        for claim in content["claims"]
    ]
    return Texts(content["title"], tuple(rules), content["captions"], content.get("remarks", []))


def _condition(text: str) -> Condition:
    parts = re.fullmatch(r"(exact|interval|paired)(?:\((\d+)\))? (.+)", text)
    if parts is None:
        raise UsageError(f"{text!r}: expected exact, interval or paired, and a condition")
    return condition(parts[3], parts[1], int(parts[2] or 0))  # type: ignore[arg-type]
