"""Does a base swing on lines, or did something begin within the log? Only what a swing explains by far the best is taken for one.

A base that leaves, a bias that steps, sensors that are noisier than specified: each looks slow, and a motion with more freedom
would explain a part of it. So a swing is asked for where something looks as if it had begun, and is
believed where it is likelier than the usual motion together with the best of all that may have begun, by more than chance
and its own freedom give (Schwarz), where nothing else is slow, nothing is left that chance does not give, and where it is as
small as that of a ship which her lines hold. Else the answer and the evidence are those of the usual motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from truenorth.alignment.bias_step import bias_signatures
from truenorth.alignment.drift import drift_signatures
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.hemisphere import hemisphere_signature
from truenorth.alignment.matched import innovations_of, matched, matched_whole
from truenorth.alignment.swing_fit import MOST, is_swing, long_enough
from truenorth.core.position import Position
from truenorth.errors.sway import AxisMotion, Oscillator
from truenorth.state.evidence import Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

PARAMETERS = 6  # frequency and size of two lines, two components of the arm


def may_swing(fine: FineAlignment, position: Position, suspect: Callable[[], bool]) -> bool:
    """Whether a swing is worth asking for: something looks as if it had begun, or the motion is suspect.

    Whether a part of the motion goes slowly is not asked: both oscillators of an axis may be the sea's, and the swing is then what
    looks as if it had begun. What takes longer to know, whether the motion is suspect, is asked last.
    """
    if not long_enough(float(fine.integrals.time[-1])):
        return False
    return not may_be_chance(_likeliest(fine, position)) or suspect()


def swings(
    fine: FineAlignment,
    motion: Sequence[AxisMotion],
    plain: FineAlignment,
    begun: Callable[[], Sequence[Evidence]],
    position: Position,
) -> bool:
    """Whether a base swings on lines.

    Parameters
    ----------
    fine : FineAlignment
        With the swing.
    motion : three AxisMotion
        The swing's.
    plain : FineAlignment
        With the usual motion.
    begun : callable
        Gives evidence of what may have begun instead, by a filter with the usual motion; asked last.
    """
    slow = [[item for item in axis.oscillators if is_swing(item)] for axis in motion[:2]]
    if any(len(items) != 1 or amplitude(items[0]) > MOST for items in slow):
        return False
    if not (fine.settled and may_be_chance(_likeliest(fine, position))):
        return False
    gained = 2.0 * float(fine.estimates.log_likelihood - plain.estimates.log_likelihood)
    needed = limit("drift") + PARAMETERS * math.log(len(fine.integrals.intervals))
    if gained - _likeliest(plain, position) <= needed:
        return False
    return all(gained - float(item.figures["ratio"]) > needed for item in begun())


def amplitude(line: Oscillator) -> float:
    """Of the displacement, m."""
    return math.sqrt(2.0) * line.sigma / line.frequency


def swing_note(motion: Sequence[AxisMotion]) -> Evidence:
    """That a base swings, as far and as slowly as this."""
    lines = zip(("east", "north"), (axis.oscillators[-1] for axis in motion[:2]), strict=True)
    figures: dict[str, Figure] = {}
    for name, line in lines:
        figures |= {name: amplitude(line), f"{name}_period": 2.0 * math.pi / line.frequency}
    return Evidence("sway.swing", figures)


def _likeliest(fine: FineAlignment, position: Position) -> float:
    """Twice the logarithm of the likelihood ratio of the best of what innovations may show to have begun."""
    seen = innovations_of(fine)
    begun = matched(seen, drift_signatures(fine), bias_signatures(fine))
    bent = matched_whole(seen, hemisphere_signature(fine, position))
    return max(float(match.ratio.max()) for match in (*begun, bent))
