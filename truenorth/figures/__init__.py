"""Figures with matplotlib: plain arrays or results in, a `Figure` out, units on every axis."""
