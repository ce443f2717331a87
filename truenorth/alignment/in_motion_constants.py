"""Whether the axes of the gyros of a vehicle under way stay as they are."""

from __future__ import annotations

from truenorth.alignment.in_motion_passes import MORE_PASSES, Pass, fits_worse, once_more
from truenorth.alignment.in_motion_start import Guess
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.errors import DataError
from truenorth.quality.slow_aids import FIXES, SPEEDS


def as_specified(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Pass]:
    """Passes with axes of the gyros that are constants, where the log does not speak against them: task, the last pass.

    Noise in turns besides states of the axes is the same error twice. It carries the first passes, of which nobody knows yet
    whether the axes are constants; heading of a vehicle that turns all the time had three times its sigma by it. A log whose wheel
    or velocity log has shown slow errors across its way that nobody spoke of is not as specified: these turn with the vehicle, and
    hide what the axes do, as a wrong heading turns velocity across. Those of a receiver do not turn with it.
    """
    constant = task.with_constant_axes()
    hidden = any(slow.across for name, slow in task.lasting.items() if name not in (FIXES, SPEEDS))
    if constant is task or hidden:
        return task, found
    other = found
    for number in range(MORE_PASSES):
        if number > 0 and other.settled:
            break
        try:
            other = once_more(constant, other, first)
        except DataError:  # the filter broke down: they are not
            return task, found
        if fits_worse(found.track, other.track):
            return task, found
    return constant, other
