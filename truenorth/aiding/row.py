"""A row of a measurement: one compiled function with one declared signature, which the closed loop calls by its address.

A row is *predicted less measured*, ``z = H x + noise``, with the states of :mod:`truenorth.errors.ins` (errors computed
minus true) and those of groups (what is left of a parameter: true minus assumed). It finds everything about the
vehicle in one vector `now` (:mod:`truenorth.state.now`), and where its groups stand in `at`. Since kernels call it
through a pointer, a row of a user's own module needs no edit here, and no kernel is compiled anew for it (17 ns a call).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from truenorth.core.compiled import Callback, borrowing, compiled, compiled_callback
from truenorth.core.pointers import Pointer
from truenorth.state.now import NOW_BEHIND

SIGNATURE = "void(float64[::1], float64[::1], int64[::1], float64[::1], float64[::1], float64[:, ::1], float64[::1], float64[::1])"

# Figures of a source: lever arm (IMU to sensor, body axes), axes (body to sensor) by rows, then the row's own.
ARM, MOUNT, OWN, FIGURES = 0, 3, 12, 20
# Where a source's groups stand, -1: not estimated. The last are free for a row's own.
AT_ARM, AT_SCALE, AT_MOUNT, AT_BIAS, AT_LAG, AT_FLEXURE, AT_OWN, AT_FILTER, PLACES = range(9)
ROLES = {
    "lever arm": AT_ARM,
    "scale": AT_SCALE,
    "mounting": AT_MOUNT,
    "bias": AT_BIAS,
    "lag": AT_LAG,
    "flexure": AT_FLEXURE,
    "own": AT_OWN,
    "filter": AT_FILTER,
}
_BY_CHANCE = 6.0  # of chi-square with three degrees of freedom a tenth is beyond
LEVEL_FRAME, BODY_FRAME = ("east", "north", "up"), ("right", "forward", "up")


@dataclass(frozen=True)
class Row:
    """A kind of measurement.

    Attributes
    ----------
    name : str
        Such as "position".
    function : compiled callback
        Of the signature `SIGNATURE`: ``row(now, figures, at, assumed, measured, H, z, R)``. `H` (3, N) comes as zeros, `z`
        (3,) as NaN, `R` (3,) holds the variances given, to which a row may add its own.
    sizes : mapping of role to int
        The groups it touches, and how many states each has.
    rows : int
        Components of `z`, 1 to 3.
    width : int
        Numbers in a measurement.
    instant : bool
        It needs rate and specific force at its very time; the loop then waits for the three samples after it.
    swings : bool
        A velocity, or a place that may be late: where its sensor sits on an arm it needs the rate at its very time, too. The mean
        since the last event, T ago, is that of ``T / 2`` before: an antenna two metres away would be off by ``.5 a T l``,
        decimetres a second on rough ground.
    swings_late : bool
        Of those: where its delay is a state alone.
    unit : str
        Of `z`, SI: what its innovations are shown in.
    axes : tuple of str
        Names of the components of `z`.
    """

    name: str
    function: Callback
    sizes: dict[str, int]
    rows: int = 3
    width: int = 3
    instant: bool = False
    swings: bool = False
    swings_late: bool = False
    unit: str = "m/s"
    axes: tuple[str, ...] = LEVEL_FRAME

    @property
    def over_ground(self) -> bool:
        """Whether `z` is a velocity or a place along east and north."""
        return self.axes == LEVEL_FRAME and self.unit in ("m", "m/s")


row = compiled_callback(SIGNATURE)  # compiles a row of a measurement, with the signature that the loop calls
row_at = Pointer(SIGNATURE)


@compiled
def with_state(values: Any, first: int, assumed: Any, at: int) -> Any:
    """Three figures, and what is assumed beyond them where there is a state; a tuple."""
    a, b, c = values[first], values[first + 1], values[first + 2]
    if at >= 0:
        a, b, c = a + assumed[at], b + assumed[at + 1], c + assumed[at + 2]
    return a, b, c


@borrowing
def beyond_noise(rate: Any, variance: float) -> float:
    """Share of a rate that is not within its noise: squares of noise are no knowledge."""
    size = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]
    return max(0.0, 1.0 - _BY_CHANCE * variance / max(size, 1e-30))


@borrowing
def by_axes(assumed: Any, at: int, x: Any) -> Any:
    """``M x``, of what is assumed of a matrix of scale factors and misalignments, by rows; zeros where there is none; a tuple."""
    a, b, c = 0.0, 0.0, 0.0
    if at >= 0:
        a = assumed[at] * x[0] + assumed[at + 1] * x[1] + assumed[at + 2] * x[2]
        b = assumed[at + 3] * x[0] + assumed[at + 4] * x[1] + assumed[at + 5] * x[2]
        c = assumed[at + 6] * x[0] + assumed[at + 7] * x[1] + assumed[at + 8] * x[2]
    return a, b, c


@compiled
def idle_part(figures: Any, first: int, assumed: Any, at: int, measured: Any, behind: int) -> Any:
    """What of three values of a seat that bends its chord does not follow, by the coupling of each axis; a tuple."""
    k = with_state(figures, first, assumed, at)
    return (1.0 - k[0]) * measured[behind], (1.0 - k[1]) * measured[behind + 1], (1.0 - k[2]) * measured[behind + 2]


@compiled
def state_of(assumed: Any, at: int) -> float:
    """What is assumed in a single state, 0 where there is none."""
    value = 0.0
    if at >= 0:
        value = assumed[at]
    return value


@compiled
def lag_now(now: Any, assumed: Any, at: int) -> float:
    """How long before this epoch the measurement holds, s."""
    return state_of(assumed, at) + now[NOW_BEHIND]
