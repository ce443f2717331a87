"""What is wrong with a record: gaps, units, axes, noise, and how the base moved."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.quality.inspection import Inspection, inspect
    from truenorth.quality.regimes import MotionSummary, Regime, motion_summary
    from truenorth.quality.sampling import Finding

__all__ = [
    "Finding",
    "Inspection",
    "MotionSummary",
    "Regime",
    "inspect",
    "motion_summary",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Finding": "sampling",
        "Inspection": "inspection",
        "MotionSummary": "regimes",
        "Regime": "regimes",
        "inspect": "inspection",
        "motion_summary": "regimes",
    },
)
