"""Alignment and navigation while the log is still running: rows come in, heading and its uncertainty come out."""

from truenorth.live.aligner import Aligner
from truenorth.live.answer import Answer, Motion
from truenorth.live.attitude_feeds import AttitudeFeed, MagnetometerFeed
from truenorth.live.feed import Feed
from truenorth.live.feeds import GnssFeed, HeightFeed, OdometerFeed, VelocityFeed
from truenorth.live.indexer_feed import IndexerFeed
from truenorth.live.intake import Counts
from truenorth.live.master_feed import MasterFeed
from truenorth.live.navigator import Navigator

__all__ = [
    "Aligner",
    "Answer",
    "AttitudeFeed",
    "Counts",
    "Feed",
    "GnssFeed",
    "HeightFeed",
    "IndexerFeed",
    "MagnetometerFeed",
    "MasterFeed",
    "Motion",
    "Navigator",
    "OdometerFeed",
    "VelocityFeed",
]
