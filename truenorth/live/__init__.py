"""Alignment while the log is still running: rows come in, heading and its uncertainty come out."""

from truenorth.live.aligner import Aligner, Answer
from truenorth.live.intake import Counts

__all__ = ["Aligner", "Answer", "Counts"]
