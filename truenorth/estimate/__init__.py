"""Estimators: the closed loop with its events, and its smoother."""
