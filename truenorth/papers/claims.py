"""What a paper claims, and whether it holds: each claim with the number of runs and how sure the answer is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["holds", "does not hold", "holds in part"]


@dataclass(frozen=True)
class Claim:
    """A claim of a paper, settled.

    Attributes
    ----------
    text : str
        As the paper means it.
    verdict : str
    evidence : str
        Ours, with figures.
    runs : int
    p_value : float or None
        Of the paired sign test, where two methods are compared.
    """

    text: str
    verdict: Verdict
    evidence: str
    runs: int
    p_value: float | None = None


def markdown(title: str, claims: Sequence[Claim], remarks: Sequence[str] = ()) -> str:
    """The text of claims.md."""
    lines = [f"# {title}: the paper's claims", ""]
    for number, claim in enumerate(claims, 1):
        lines += [
            f"## {number}. {claim.text}",
            "",
            f"**{claim.verdict.capitalize()}.** {claim.evidence}",
            "",
            _basis(claim),
            "",
        ]
    if remarks:
        lines += ["## Remarks", "", *(f"- {remark}" for remark in remarks), ""]
    return "\n".join(lines)


def _basis(claim: Claim) -> str:
    runs = f"{claim.runs} run{'s' if claim.runs != 1 else ''}"
    if claim.p_value is None:
        return f"Basis: {runs}."
    p = "p < 0.0001" if claim.p_value < 1e-4 else f"p = {claim.p_value:.4f}"
    return f"Basis: {runs}, the same data for both; two-sided sign test {p}."
