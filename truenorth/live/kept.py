"""A live run on the disk: all that it goes on from, in one file that is written whole or not at all."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from truenorth.core.archive import read_archive, write_archive
from truenorth.core.atomic import atomic_path
from truenorth.core.errors import DataError
from truenorth.live.carry import Carry
from truenorth.live.felt import Felt
from truenorth.live.going import Going
from truenorth.live.intake import Intake
from truenorth.live.known_feeds import FEEDS
from truenorth.live.log import Log
from truenorth.live.loop import Loop
from truenorth.live.noise_seen import NoiseSeen
from truenorth.live.past import Past
from truenorth.live.recent import Recent
from truenorth.live.siblings import Siblings

PLAIN: dict[str, type[Any]] = {
    kind.__name__: kind for kind in (Log, Intake, Felt, Past, Recent, Carry, Going, Loop, NoiseSeen, Siblings)
}
PLAIN |= {kind.__name__: kind for kind in FEEDS.values()}  # type: ignore[misc]  # classes, called as functions


FORMAT = 2  # one more whenever what a run holds changes its names


def keep(path: str | PathLike[str], kind: str, state: Mapping[str, Any]) -> Path:
    """Write the state of a run of this kind."""
    target = Path(path)
    with atomic_path(target) as temporary, temporary.open("wb") as file:
        write_archive({"kind": kind, "format": FORMAT, **{name: _packed(value) for name, value in state.items()}}, file)
    return target


def kept(path: str | PathLike[str], kind: str, names: Collection[str] = ()) -> dict[str, Any]:
    """What :func:`keep` wrote, with all of these names.

    Raises
    ------
    DataError
        No such file, a damaged one, or one of another kind or version.
    """
    state = read_archive(path)
    if not isinstance(state, dict) or state.pop("kind", None) != kind:
        raise DataError(f"{path}: holds no {kind}; expected a file that {kind}.save wrote")
    missing = sorted(set(names) - state.keys())
    if (written := state.pop("format", 1)) != FORMAT or missing:
        what = missing[0] if missing else f"format {written}, not {FORMAT}"
        raise DataError(f"{path}: not a result of this version of Truenorth ({what}); write it again with this version")
    return {name: _unpacked(value) for name, value in state.items()}


def _packed(value: Any) -> Any:
    if type(value).__name__ in PLAIN:
        left_out = getattr(value, "made_anew", ())
        state = {name: _packed(part) for name, part in vars(value).items() if name not in left_out}
        return {"plain": type(value).__name__, "state": state}
    if isinstance(value, deque):
        return {"deque": [_packed(part) for part in value]}
    if isinstance(value, list):
        return [_packed(part) for part in value]
    if isinstance(value, dict):
        return {"dict": {key: _packed(part) for key, part in value.items()}}
    return value


def _unpacked(value: Any) -> Any:
    if isinstance(value, list):
        return [_unpacked(part) for part in value]
    if not isinstance(value, dict):
        return value
    if "plain" in value:
        made = object.__new__(PLAIN[value["plain"]])
        vars(made).update({name: _unpacked(part) for name, part in value["state"].items()})
        return made
    if "deque" in value:
        return deque(_unpacked(part) for part in value["deque"])
    return {key: _unpacked(part) for key, part in value["dict"].items()}
