"""Filters and smoothers for linear systems; they know nothing of navigation."""

from truenorth.filters.fading import fading
from truenorth.filters.h_infinity import h_infinity, smallest_bound
from truenorth.filters.information import (
    InformationEstimates,
    InformationState,
    information,
    information_behind,
    no_information,
    two_filter_smoother,
)
from truenorth.filters.kalman import kalman
from truenorth.filters.robust import gated, robust
from truenorth.filters.sage_husa import sage_husa
from truenorth.filters.smoother import Smoothed, smoother
from truenorth.filters.square_root import square_root
from truenorth.filters.strong_tracking import strong_tracking
from truenorth.filters.system import Estimates, FilterState, LinearSystem
from truenorth.filters.variational import variational

__all__ = [
    "Estimates",
    "FilterState",
    "InformationEstimates",
    "InformationState",
    "LinearSystem",
    "Smoothed",
    "fading",
    "gated",
    "h_infinity",
    "information",
    "information_behind",
    "kalman",
    "no_information",
    "robust",
    "sage_husa",
    "smallest_bound",
    "smoother",
    "square_root",
    "strong_tracking",
    "two_filter_smoother",
    "variational",
]
