"""How far the end of a structure moves for what it turns: the coupling of an arm that bends.

A wing, a pylon or a hull that bends turns the slave at its end by `theta` against the rigid body (slave axes), and moves it, too:
at an arm `r` from where the structure is clamped by

    delta = (k theta) x r,    k by axis

so that the chord of the arm turns by ``k theta``. Of a slender beam that is clamped at one end (`P` a force, `q` a force a metre,
`M` a moment, `E I` the stiffness):

    | bent by                          | end moves by      | end turns by     | k     |
    | moment at the end                | M L^2 / (2 E I)   | M L / (E I)      | 1/2   |
    | force at the end                 | P L^3 / (3 E I)   | P L^2 / (2 E I)  | 2/3   |
    | middle to end of a free hull, first mode             |                  | 0.692 |
    | first mode of a uniform beam     |                   |                  | 0.726 |
    | force spread evenly              | q L^4 / (8 E I)   | q L^3 / (6 E I)  | 3/4   |
    | rigid, about a hinge at the root | theta L           | theta            | 1     |

Gyros of the slave show ``theta'`` with the body's rate `w`, and a lever arm that is worked out by them has ``k = 1``. What its end
does against the master is

    v - v_master = C ((w - (1 - k) theta') x r),    p - p_master = C (r - ((1 - k) theta) x r)

to first order in theta: a wing of 6 m that bends by .2 deg (RMS) at 3 Hz is .13 m/s off where k is taken for 1. The states are true
less assumed k about right, forward and up.

Sources: J. Gere, B. Goodno, "Mechanics of materials", 8th ed. (2013), appendix H (deflections and slopes of beams); R. Blevins,
"Formulas for natural frequency and mode shape" (1979), table 8-1 (slopes and deflections of first modes).
"""

from __future__ import annotations

import numpy as np

from truenorth.errors.group import Group

BENDING = "bending arm"


def bending(sigma: float) -> Group:
    """The coupling about each axis, uncertain by `sigma` before the log."""
    return Group(BENDING, np.full(3, sigma))
