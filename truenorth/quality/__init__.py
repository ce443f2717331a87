"""What is wrong with a record: gaps, units, axes, noise, and how the base moved."""

from truenorth.quality.inspection import Inspection, inspect
from truenorth.quality.regimes import MotionSummary, Regime, motion_summary
from truenorth.quality.sampling import Finding

__all__ = ["Finding", "Inspection", "MotionSummary", "Regime", "inspect", "motion_summary"]
