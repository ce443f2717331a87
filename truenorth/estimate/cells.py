"""Logs of bases at rest that share their linear system: attitudes in steps, and what is known of each.

Of a base at rest, times, place, specification and attitude decide the system of its errors, and so all covariances and gains. The
attitude comes in at two places. Innovations are worked out by it, and there it is each log's own. And biases act by it, as
``C_n0_b eps``: there an attitude that is off by an angle takes that part of a bias for one of another axis. An attitude off by a
thousandth of a radian leaves a thousandth of what the bias does, a thousandth of a sigma at the most. So biases act by the nearest
attitude of a grid, the cell: the hundreds of runs of a campaign have a handful of cells, whose covariances are worked out once
(:mod:`truenorth.filters.known`). A log by itself takes the attitude of its cell too: its answer does not depend on the others.

The grid is of quaternions' components: it has no poles. Components are off by half a step at the most, an attitude by
``2 sqrt(4) STEP / 2``, and by half of that in the mean.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion
from truenorth.core.earth import EARTH_RATE
from truenorth.core.remembered import remembered
from truenorth.errors.staying import Form, StaticModel
from truenorth.filters.known import Common
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation

Array = NDArray[np.float64]

STEP = 2.0**-10  # of a quaternion's components: half of a milliradian's worth either way, 2 mrad from cell to cell
NEAR = 4.0 * STEP  # of a direction cosine: what a log turns by besides, and the rounding
FEW = 4.0  # steps of heading, one sigma: with more of them hardly a cell comes again
MOST_EPOCHS = 1000  # of a log whose covariances are kept: 15 MB
MOST_CELLS = 8  # kept; those not asked for for longest go


def in_few_cells(spec: ImuSpec, lat: float) -> bool:
    """Whether logs of such an IMU on a base begin in a few cells: whether the gyros' biases leave heading within some steps."""
    east = math.sqrt(float(spec.bias_variance[:3].max()))
    return east < 2.0 * FEW * STEP * EARTH_RATE * math.cos(lat)


def cell_of(C_n0_i: Array, integrals: InertialIntegrals, lat: float) -> Array | None:
    """The attitude (3, 3) of a log's cell; None of a log that leaves it, or is long."""
    found, key = _cells(integrals), (C_n0_i.tobytes(), lat)
    if key not in found:
        found[key] = _cell_of(C_n0_i, integrals, lat)
    return found[key]


@remembered
def _cells(integrals: InertialIntegrals) -> dict[tuple[bytes, float], Array | None]:
    """Cells of a log by its attitude: its prior, its check and its alignment ask for one."""
    return {}


def _cell_of(C_n0_i: Array, integrals: InertialIntegrals, lat: float) -> Array | None:
    if len(integrals.intervals) > MOST_EPOCHS:
        return None
    q = [round(x / STEP) * STEP for x in _quaternion(C_n0_i.tolist())]
    size = math.sqrt(sum(x * x for x in q))
    cell = dcm_from_quaternion([x / size for x in q])
    means = np.ascontiguousarray(integrals.C_mean.transpose(1, 0, 2)).reshape(3, -1)
    off = C_n0_i @ means - _turned(cell.tobytes(), integrals.time.tobytes(), lat)
    return cell if float(max(off.max(), -off.min())) < NEAR else None


def _quaternion(C: list[list[float]]) -> list[float]:
    """The quaternion of a matrix, scalar first, by the largest of its components: of a single one arrays take ten times as long."""
    trace = C[0][0] + C[1][1] + C[2][2]
    squares = [1.0 + trace, *(1.0 + 2.0 * C[i][i] - trace for i in range(3))]  # four times those of the components
    largest = max(range(4), key=squares.__getitem__)
    off = [C[2][1] - C[1][2], C[0][2] - C[2][0], C[1][0] - C[0][1]]
    if largest == 0:
        row = [squares[0], *off]
    else:
        i = largest - 1
        row = [off[i], *(squares[largest] if j == i else C[i][j] + C[j][i] for j in range(3))]
    return [x / (2.0 * math.sqrt(squares[largest])) for x in row]


@lru_cache(maxsize=MOST_CELLS)
def _turned(cell: bytes, times: bytes, lat: float) -> Array:
    """(3, K 3) attitudes in ``n0`` of a cell in the middle of intervals between times."""
    time = np.frombuffer(times)
    C = earth_rotation((time[1:] + time[:-1]) / 2, lat) @ np.frombuffer(cell).reshape(3, 3)
    return np.ascontiguousarray(C.transpose(1, 0, 2)).reshape(3, -1)


def system_of_cell(cell: Array, model: StaticModel, form: Form, time: Array, lat: float, alt: float) -> Common:
    """What logs of a cell share that have the same noise, times and place."""
    return _common(model, form, cell.tobytes(), time.tobytes(), lat, alt)


@lru_cache(maxsize=2 * MOST_CELLS)
def _common(model: StaticModel, form: Form, cell: bytes, times: bytes, lat: float, alt: float) -> Common:
    time = np.frombuffer(times)
    return Common(model.linearise_at_rest(form, time, np.frombuffer(cell).reshape(3, 3), lat, alt))
