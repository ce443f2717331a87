"""Truenorth: initial alignment and navigation of strapdown inertial navigation systems."""

__version__ = "0.1.0"
