"""Filters and smoothers for linear systems; they know nothing of navigation."""

from truenorth.filters.kalman import kalman
from truenorth.filters.smoother import Smoothed, smoother
from truenorth.filters.system import Estimates, FilterState, LinearSystem

__all__ = ["Estimates", "FilterState", "LinearSystem", "Smoothed", "kalman", "smoother"]
