"""The version of the package; what is written names it."""

__version__ = "0.2.0"
