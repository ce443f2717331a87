"""May the answer of an alignment on the move be used? The status, and the reasons in words and figures."""

from __future__ import annotations

import math

import numpy as np

from truenorth.alignment.result import NOT_ESTIMATED, Alignment, Status
from truenorth.navigation.procedure import check_residuals
from truenorth.state.track import Track

LEVEL_LIMIT = math.radians(3.0)  # a tilt less certain than this is no level


def judge_moving(answer: Alignment, track: Track, limit: float) -> tuple[Status, tuple[str, ...]]:
    """Status and reasons of an answer; `limit` is the largest one-sigma heading error of use, rad."""
    sound, notes = check_residuals(track)
    if not sound:
        return "inconsistent", tuple(notes)
    assert answer.moving is not None
    level = float(np.sqrt(np.max(np.linalg.eigvalsh(answer.phi_covariance[:2, :2]))))
    if level > LEVEL_LIMIT:
        return "not_converged", (f"level is known to {math.degrees(level):.2f} deg only: record longer", *notes)
    sigma = float(answer.euler_sigma[0])
    source = answer.moving.heading_from
    if sigma <= limit:
        return "aligned", (f"heading is known to {_angle(sigma)} (one sigma), from {source}", *_wheel(answer), *notes)
    levels = f"level is known to {math.degrees(level) * 60:.2f} arcmin (one sigma)"
    wanted = f"heading is known to {_angle(sigma)} only after {answer.duration:.0f} s, {_angle(limit)} is wanted"
    if answer.method == "motion":
        what = (
            "the vehicle must accelerate and turn while GNSS sees it"
            if any("GNSS" in r.name for r in track.residuals)
            else "an odometer tells nothing of north: gyros that see the earth turn, or GNSS, are needed"
        )
        return "level_only", (f"{wanted}: {what}", levels, *notes)
    return "not_converged", (f"{wanted}: record longer", levels, *notes)


def _wheel(answer: Alignment) -> list[str]:
    """What was found of the odometer."""
    moving = answer.moving
    if moving is None or moving.wheel is None:
        return []
    w, layout = moving.wheel, moving.track.layout
    told = []
    for name, prior in zip(layout.names, layout.priors, strict=True):
        if name == "odometer scale" and w.scale_sigma < NOT_ESTIMATED * prior[0]:
            told.append(f"the odometer counts {100 * w.scale:+.2f} % ({100 * w.scale_sigma:.2g} % one sigma)")
    return told


def _angle(x: float) -> str:
    degrees = math.degrees(x)
    return f"{degrees:.2f} deg" if degrees >= 0.5 else f"{degrees * 60:.2f} arcmin"
