"""What a row of a measurement is called, and where its figures and states stand: for kernels."""

from __future__ import annotations

NOTHING, POSITION, VELOCITY, BODY_VELOCITY, HEIGHT, ROTATION, DISTURBANCE = range(7)

# Columns of a source's figures and states.
ARM, MOUNT, GATES = slice(0, 3), slice(3, 12), slice(12, 15)
FIRST_GATE, LOOP, FIGURES = 12, 15, 16
AT_ARM, AT_SCALE, AT_MOUNT, AT_BIAS, AT_LAG, PLACES = range(6)
