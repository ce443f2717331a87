"""What aids a solution of the rows so far: what turns the IMU, a master INS, or sensors that say that the vehicle moves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from truenorth.aiding.aids import Indexer, Positions
from truenorth.alignment.encoder_angles import covered_until
from truenorth.alignment.recipes import RECIPES
from truenorth.live.feed import Feed

Turner = Positions | Indexer


def aids_of(turner: Turner | None, feeds: Mapping[str, Feed], end: float) -> list[Any]:
    """The aids; none as long as nothing turns the IMU and the vehicle stays where it is, or no sensor says that it moves.

    Parameters
    ----------
    turner : Positions, Indexer or None
        What turns the IMU, other than an indexer with an encoder among the feeds.
    feeds : mapping of str to Feed
    end : float, s
        Of the IMU's rows.
    """
    if turner is not None:
        return [turner]
    if "indexer" in feeds:
        indexer = feeds["indexer"].until(np.inf)
        return [] if indexer is None else [indexer]
    master = feeds["master"].until(end) if "master" in feeds else None
    if master is not None:
        return [master]
    if all(feed.moves_from() is None for feed in feeds.values()):
        return []
    found = [aid for feed in feeds.values() if (aid := feed.until(end)) is not None]
    moving = {type(aid) for aid in found if any(recipe.fits({type(aid)}) for recipe in RECIPES)}
    kinds = {kind for kind in map(type, found) if any(recipe.fits(moving | {kind}) for recipe in RECIPES)}
    return [aid for aid in found if type(aid) in kinds] if moving else []


def reach(aids: list[Any]) -> float:
    """Up to which time the aids serve, s: angles of an encoder cannot be guessed."""
    encoder = aids[0].record if aids and isinstance(aids[0], Indexer) else None
    return np.inf if encoder is None else covered_until(encoder)
