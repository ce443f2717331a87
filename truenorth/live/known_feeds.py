"""The feeds that there are, by their keys."""

from __future__ import annotations

from collections.abc import Callable

from truenorth.live.attitude_feeds import AttitudeFeed, MagnetometerFeed
from truenorth.live.feed import Feed
from truenorth.live.feeds import GnssFeed, HeightFeed, OdometerFeed, VelocityFeed
from truenorth.live.indexer_feed import IndexerFeed
from truenorth.live.master_feed import MasterFeed

FEEDS: dict[str, Callable[..., Feed]] = {
    feed.key: feed
    for feed in (
        GnssFeed,
        OdometerFeed,
        VelocityFeed,
        HeightFeed,
        MasterFeed,
        IndexerFeed,
        MagnetometerFeed,
        AttitudeFeed,
    )
}
