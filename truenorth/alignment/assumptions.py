"""The published filters, and what each assumes of the base, the vehicle and the noise: said with every answer that it gives.

Sources: as :mod:`truenorth.alignment.published` and :mod:`truenorth.alignment.azimuth` have them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NoReturn

from truenorth.core.errors import UsageError

if TYPE_CHECKING:
    from truenorth.filters.fading import Fading

Published = Literal["kf", "sakf", "makf", "imakf", "states10", "states8"]

# Kind of fading of each; SAKF of the paper's introduction corrects the measurement noise.
FADING: dict[str, Fading | None] = {"kf": None, "sakf": "noise", "makf": "multiple", "imakf": "improved"}
STATIONARY = {"states10": 10, "states8": 8}

BASE = "what the base moves is white noise of one size"
LEVEL = "a still base and a level IMU"
WHEEL = "the wheel sits at the IMU, its mounting is known, and its noise is white"

STAYING = {
    "kf": BASE,
    "sakf": f"{BASE}; larger innovations are noise",
    "makf": f"{BASE}; larger innovations are news of the state",
    "imakf": f"{BASE}; larger innovations are news of the state and of its noise",
    "states10": LEVEL,
    "states8": f"{LEVEL}; what the base moves is white in the accelerometers",
}
MOVING = {
    **dict.fromkeys(("ekf", "ukf", "ckf"), WHEEL),
    **dict.fromkeys(("gh3", "gh5", "gh7"), f"{WHEEL}; nonlinear in the azimuth alone"),
    **dict.fromkeys(
        ("sgkf3", "sgkf7", "sgkf"), f"{WHEEL}; nonlinear in the azimuth alone; larger innovations are news of the state"
    ),
}


def reason(method: str, acted: float | None = None) -> str:
    """Of a published filter that was asked for: what it assumes, and in which share of the epochs its factors acted."""
    words = f"asked for, a published filter to be compared, which assumes: {(STAYING | MOVING)[method]}"
    return words if acted is None else f"{words}; a factor acted in {acted:.1%} of the epochs"


def refuse(method: str, choices: Sequence[str]) -> NoReturn:
    """Refuse a method that an alignment does not have, and say of which it is.

    Raises
    ------
    UsageError
        Always.
    """
    known = {**dict.fromkeys(STAYING, "a base that stays"), **dict.fromkeys(MOVING, "a vehicle with an odometer")}
    known |= {"states10": LEVEL, "states8": LEVEL}
    if method in known:
        raise UsageError(f"method {method!r} is that of {known[method]}; choose one of {', '.join(choices)}")
    raise UsageError(f"method {method!r} is not known; choose one of {', '.join(choices)}")
