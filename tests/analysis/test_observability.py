"""Observability against systems whose unobservable part is known: built so, or published."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm, subspace_angles

from truenorth.analysis.combinations import entangled_states
from truenorth.analysis.observability import Segment, observability, piecewise_observability
from truenorth.core.attitude import skew
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, kalman

G, RADIUS, W_IE = 9.806, 6.371e6, 7.292115e-5


class Static:
    """The filters of "Kalman filters for static alignment": 10 states with velocity, or 8 that measure force."""

    names = ("phi_E", "phi_N", "phi_U", "eps_E", "eps_N", "eps_U", "nabla_E", "nabla_N", "dv_E", "dv_N")
    units = ("rad",) * 3 + ("rad/s",) * 3 + ("m/s^2",) * 2 + ("m/s",) * 2
    scale = np.array([3e-3, 3e-3, 2e-2, *[5e-8] * 3, 1e-3, 1e-3, 0.1, 0.1])

    def __init__(self, states: int, turn: float = 0.0):
        ws, wc = W_IE * np.sin(np.pi / 4), W_IE * np.cos(np.pi / 4)
        C = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
        F = np.zeros((10, 10))
        F[:3, :3] = [[0, ws, -wc], [-ws, 0, 0], [wc, 0, 0]]
        F[:3, 3:6] = -C
        F[0, 9], F[1, 8] = -1 / RADIUS, 1 / RADIUS
        F[8, 1], F[9, 0] = -G, G
        F[8:, 6:8] = C[:2, :2]
        H = np.eye(10)[8:] if states == 10 else F[8:, :8]
        self.F, self.H = F[:states, :states], H
        self.segment = Segment(self.F, self.H, 300.0)

    def system(self, interval: float, epochs: int, constant: bool = True) -> LinearSystem:
        n = len(self.F)
        Phi = expm(self.F * interval)
        return LinearSystem(
            Phi=Phi[None] if constant else np.repeat(Phi[None], epochs, axis=0),
            Q=np.zeros((1, n, n)),
            H=self.H[None],
            R=1e-6 * np.eye(2)[None],
            z=np.zeros((epochs, 2)),
            x0=np.zeros(n),
            P0=np.diag(self.scale[:n] ** 2),
        )


@pytest.mark.parametrize(("states", "rank"), [(10, 7), (8, 5)])
@pytest.mark.parametrize("scale", ["physical", "ones"])
def test_static_alignment_has_the_published_rank(states, rank, scale):
    model = Static(states)
    size = model.scale[:states] if scale == "physical" else np.ones(states)
    result = piecewise_observability([model.segment], size, model.names[:states], model.units[:states])
    assert result.rank.tolist() == result.stripped_rank.tolist() == [rank]
    assert {name for group in result.entangled for name in group.free} == {"eps_E", "nabla_E", "nabla_N"}
    said = [str(c) for group in result.entangled for c in group.observable]
    # phi_E = -nabla_N/g, phi_N = nabla_E/g, phi_U = -eps_E/(w cos L) + phi_N tan L: what alignment is limited by.
    assert "nabla_N + 9.81 m/s^2 * phi_E" in said
    assert "nabla_E - 9.81 m/s^2 * phi_N" in said
    slope = 1.0 / (W_IE * np.cos(np.pi / 4))
    assert f"phi_U + {slope:.3g} s * eps_E - 0.102 s^2/m * nabla_E" in said
    assert not {"dv_E", "dv_N"} & {name for group in result.entangled for name in group.states}


@pytest.mark.parametrize("constant", [True, False])
@pytest.mark.parametrize(("states", "rank"), [(10, 7), (8, 5)])
def test_the_rank_of_the_discrete_system_is_the_same(states, rank, constant):
    model = Static(states)
    interval = 0.02 if constant else 1.0
    result = observability(model.system(interval, 600, constant), model.names[:states], model.units[:states])
    assert result.rank == rank
    continuous = piecewise_observability(
        [model.segment], model.scale[:states], model.names[:states], model.units[:states]
    )
    apart = subspace_angles(
        result.unobservable / model.scale[:states, None], continuous.unobservable / model.scale[:states, None]
    )
    assert apart.max() < 1e-6
    assert {name for group in result.entangled for name in group.free} == {"eps_E", "nabla_E", "nabla_N"}


def test_a_second_position_shows_everything():
    model = Static(10)
    result = piecewise_observability([model.segment, Static(10, np.pi).segment], model.scale, model.names, model.units)
    assert result.rank.tolist() == [7, 10]
    assert result.entangled == ()
    assert str(result) == "rank 7, 10 of 10"


TRANSFER_NAMES = [f"{state}_{axis}" for state in ("dv", "phi") for axis in "ENU"]
TRANSFER_NAMES += [f"{state}_{axis}" for state in ("nabla", "eps") for axis in "xyz"]
TRANSFER_NAMES += ["tau", "r_right", "r_forward", "r_up"]
TRANSFER_UNITS = ["m/s"] * 3 + ["rad"] * 3 + ["m/s^2"] * 3 + ["rad/s"] * 3 + ["s"] + ["m"] * 3
TRANSFER_SIGMAS = np.array([0.2] * 3 + [9e-3, 9e-3, 17e-3] + [5e-4] * 3 + [5e-6] * 3 + [0.05] + [1.0] * 3)


def transfer(speed: float = 200.0, acceleration: float = 0.0) -> LinearSystem:
    """Velocity matching in level flight, 20 s straight and 30 s of turning right at 3 deg/s; no Earth rate."""
    interval, rate = 0.1, np.radians(3.0)
    t = interval * np.arange(500)
    turning = (t >= 20.0) * 1.0
    heading = rate * np.clip(t - 20.0, 0.0, None)
    v = speed + acceleration * np.clip(t - 20.0, 0.0, None)
    Phi, H = np.empty((500, 16, 16)), np.zeros((500, 3, 16))
    for k in range(500):
        c, s = np.cos(heading[k]), np.sin(heading[k])
        C = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        a = C @ [v[k] * rate * turning[k], acceleration * turning[k], 0.0]
        F = np.zeros((16, 16))
        F[0:3, 3:6] = skew(a + np.array([0.0, 0.0, G]))
        F[0:3, 6:9] = C
        F[3:6, 9:12] = -C
        Phi[k] = expm(F * interval)
        H[k, :, 0:3] = np.eye(3)
        H[k, :, 12] = a
        H[k, :, 13:] = C @ skew(np.array([0.0, 0.0, -rate * turning[k]]))
    Q = np.diag([1e-8] * 3 + [2e-11] * 3 + [0.0] * 10)
    return LinearSystem(
        Phi, Q[None], H, 0.04 * np.eye(3)[None], np.zeros((500, 3)), np.zeros(16), np.diag(TRANSFER_SIGMAS**2)
    )


def test_at_constant_speed_delay_and_lever_arm_are_one():
    result = observability(transfer(), TRANSFER_NAMES, TRANSFER_UNITS)
    assert result.rank == 14
    assert [str(group) for group in result.entangled] == [
        "of tau and r_forward only r_forward + 200 m/s * tau is observable",
        "r_up is not seen at all",
    ]
    both = np.zeros(16)
    both[[12, 14]] = 200.0, 1.0
    P = kalman(transfer()).P[-1]
    assert np.sqrt(both @ P @ both) < 0.7  # m: the combination, of 10 before
    assert np.sqrt(P[14, 14]) > 0.99  # m: the lever arm alone, of 1 before


def test_acceleration_tells_delay_from_lever_arm():
    result = observability(transfer(acceleration=2.0), TRANSFER_NAMES, TRANSFER_UNITS)
    assert [str(group) for group in result.entangled] == ["r_up is not seen at all"]


def test_what_noise_hides_is_said():
    # An acceleration of 1 mm/s^2 tells them apart in principle, never in practice.
    result = observability(transfer(acceleration=1e-3), TRANSFER_NAMES, TRANSFER_UNITS)
    assert result.rank == 15
    hidden = [group for group in result.hardly if group.states == ("tau", "r_forward")]
    assert str(hidden[0]) == "of tau and r_forward only r_forward + 200 m/s * tau is observable"
    assert "with this noise and prior (sigma above 0.9 of the prior's):" in str(result)


def test_degrees_are_those_of_the_information():
    # Without process noise: singular values of R^-1/2 H_k Phi(k, 0) P0^1/2.
    rng = np.random.default_rng(0)
    Phi = np.eye(4) + 0.2 * rng.standard_normal((6, 4, 4))
    H, root = rng.standard_normal((6, 1, 4)), rng.standard_normal((4, 4))
    z = np.zeros((6, 1))
    z[[1, 4]] = np.nan
    system = LinearSystem(Phi, np.zeros((1, 4, 4)), H, 0.3 * np.eye(1)[None], z, np.zeros(4), root @ root.T)
    since, rows = np.eye(4), []
    for k in range(6):
        since = Phi[k] @ since
        rows += [] if k in (1, 4) else [H[k] @ since]
    seen = np.vstack(rows) / np.sqrt(0.3)
    result = observability(system, list("abcd"), ["1"] * 4)
    assert_allclose(result.degrees, np.linalg.svd(seen @ root, compute_uv=False), rtol=1e-8)
    after = np.linalg.inv(seen.T @ seen + np.linalg.inv(system.P0))
    assert_allclose(result.sigma_ratio, np.sqrt(np.diag(after) / np.diag(system.P0)), rtol=1e-9)
    # Directions: one prior sigma long, with and without the measurements uncorrelated.
    V = np.linalg.solve(root, result.directions)
    assert_allclose(V.T @ V, np.eye(4), atol=1e-9)
    assert_allclose(
        np.diag(np.linalg.inv(result.directions.T @ np.linalg.inv(after) @ result.directions)),
        1 / (1 + result.degrees**2),
        rtol=1e-8,
    )


@given(st.integers(1, 5), st.integers(0, 4), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_a_hidden_part_is_found_whatever_the_axes_and_units(seen, hidden, seed):
    # (A 0; B D) seen through (H 0) hides the second block; random axes and units hide that it does.
    rng = np.random.default_rng(seed)
    n = seen + hidden
    F = rng.standard_normal((n, n))
    F[:seen, seen:] = 0.0
    H = np.hstack([rng.standard_normal((2, seen)), np.zeros((2, hidden))])
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
    units = 10.0 ** rng.uniform(-6, 6, n)
    T = turn * units[:, None]
    F, H = T @ F @ turn.T / units, H @ turn.T / units
    names = [f"x{i}" for i in range(n)]
    result = piecewise_observability([Segment(F, H)], units, names, ["1"] * n)
    assert result.rank[-1] == seen
    if hidden:
        assert subspace_angles(result.unobservable / units[:, None], turn[:, seen:]).max() < 1e-6
    free = [name for group in result.entangled for name in group.free]
    assert len(free) == hidden
    # In words: each combination is blind to every hidden direction.
    for group in result.entangled:
        for combination in group.observable:
            row = np.zeros(n)
            row[[names.index(name) for name in combination.names]] = combination.coefficients
            assert_allclose(row @ T[:, seen:] / np.linalg.norm(row * units), 0.0, atol=1e-4)


def test_total_and_stripped_matrix_differ_where_the_theorem_does_not_hold():
    # Position is seen first, velocity moves it unseen: segment 1 sees x + y's drift, segment 2 sees nothing new.
    drift = np.array([[0.0, 1.0], [0.0, 0.0]])
    blind, seeing = np.zeros((1, 2)), np.array([[1.0, 0.0]])
    names, units = ["x", "v"], ["m", "m/s"]
    # The velocity is an unseen one that turns into the position between two looks at which nothing moves.
    segments = [
        Segment(np.zeros((2, 2)), seeing, 1.0),
        Segment(drift, blind, 2.0),
        Segment(np.zeros((2, 2)), seeing, 1.0),
    ]
    result = piecewise_observability(segments, np.ones(2), names, units)
    assert result.rank.tolist() == [1, 1, 2]
    assert result.stripped_rank.tolist() == [1, 1, 1]
    assert not result.stripped_holds
    calm = piecewise_observability([segments[0], segments[2]], np.ones(2), names, units)
    assert calm.stripped_holds
    assert calm.rank.tolist() == calm.stripped_rank.tolist() == [1, 1]


def test_absent_rows_see_nothing():
    system = Static(10).system(1.0, 600, constant=False)
    z = np.full((600, 2), np.nan)
    z[:3] = 0.0
    few = LinearSystem(system.Phi, system.Q, system.H, system.R, z, system.x0, system.P0)
    assert observability(few, Static.names, Static.units).rank == 6


def test_words():
    # a + 2 b is seen, c is not, d is.
    null = np.array([[-2.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    groups = entangled_states(null, np.ones(4), list("abcd"), ["m", "m", "rad", "s"])
    assert [str(g) for g in groups] == ["of a and b only a + 2 * b is observable", "c is not seen at all"]
    same = entangled_states(np.array([[1.0], [1.0]]), np.ones(2), ["a", "b"], ["deg/h", "rad/s"])
    assert str(same[0]) == "of a and b only a - b is observable"
    assert entangled_states(np.zeros((2, 0)), np.ones(2), ["a", "b"], ["1", "1"]) == ()
    whole = entangled_states(np.eye(2), np.ones(2), ["a", "b"], ["1", "1"])
    assert [str(g) for g in whole] == ["a is not seen at all", "b is not seen at all"]
    chain = entangled_states(
        np.array([[1.0], [1e-3], [2.0]]), np.array([1.0, 1e-3, 1.0]), ["a", "b", "c"], ["m/s", "s", "m/s^2"]
    )
    assert str(chain[0]) == "of a, b and c only c - 2 /s * a and c - 2e+03 m/s^3 * b are observable"


def test_bad_input_is_said():
    model = Static(8)
    with pytest.raises(UsageError, match=r"segment 0: F has shape \(8, 8\) and H \(2, 8\), expected \(9, 9\)"):
        piecewise_observability([model.segment], np.ones(9), ["a"] * 9, ["1"] * 9)
    with pytest.raises(UsageError, match="no segments"):
        piecewise_observability([], np.ones(9), ["a"] * 9, ["1"] * 9)
    with pytest.raises(UsageError, match="with 2 names"):
        entangled_states(np.ones((3, 1)), np.ones(3), ["a", "b"], ["1"] * 3)
    with pytest.raises(UsageError, match=r"scale of b is 0\.0"):
        entangled_states(np.ones((2, 1)), np.array([1.0, 0.0]), ["a", "b"], ["1"] * 2)
    system = model.system(1.0, 10)
    known = LinearSystem(system.Phi, system.Q, system.H, system.R, system.z, system.x0, 0.0 * system.P0)
    with pytest.raises(UsageError, match="P0 is singular"):
        observability(known, model.names[:8], model.units[:8])
    with pytest.raises(UsageError, match="not_estimated is 2"):
        observability(system, model.names[:8], model.units[:8], not_estimated=2.0)
