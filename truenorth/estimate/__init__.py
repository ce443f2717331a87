"""Estimators: the closed loop with its events, its smoother, and whole logs linearised until they settle."""
