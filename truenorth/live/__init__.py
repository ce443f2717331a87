"""Alignment and navigation while the log is still running: rows come in, heading and its uncertainty come out."""

from truenorth.live.aligner import Aligner
from truenorth.live.answer import Answer, Motion
from truenorth.live.feeds import Feed, GnssFeed, HeightFeed, OdometerFeed, VelocityFeed
from truenorth.live.intake import Counts
from truenorth.live.master_feed import MasterFeed
from truenorth.live.navigator import Navigator

__all__ = [
    "Aligner",
    "Answer",
    "Counts",
    "Feed",
    "GnssFeed",
    "HeightFeed",
    "MasterFeed",
    "Motion",
    "Navigator",
    "OdometerFeed",
    "VelocityFeed",
]
