"""Models of the nonlinear filters' tests: a linear one in disguise, tracking by range and bearing, a heading."""

import numpy as np

from truenorth.filters import LinearSystem, NonlinearSystem, matrix_function, vector_function


@vector_function
def linear_transition(x, p, out):
    n = len(x)
    for i in range(n):
        out[i] = p[n * n + i]
        for j in range(n):
            out[i] += p[i * n + j] * x[j]


@matrix_function
def linear_transition_jacobian(x, p, out):
    n = len(x)
    for i in range(n):
        for j in range(n):
            out[i, j] = p[i * n + j]


@vector_function
def linear_measurement(x, p, out):
    n = len(x)
    for i in range(len(out)):
        out[i] = 0.0
        for j in range(n):
            out[i] += p[n * n + n + i * n + j] * x[j]


@matrix_function
def linear_measurement_jacobian(x, p, out):
    n = len(x)
    for i in range(len(out)):
        for j in range(n):
            out[i, j] = p[n * n + n + i * n + j]


def in_disguise(system: LinearSystem, jacobians=True) -> NonlinearSystem:
    """A linear system as a nonlinear one: its matrices are the parameters."""
    shape = (*system.runs, system.epochs)

    def numbers(a, axes):
        return np.broadcast_to(a.reshape(*a.shape[: a.ndim - axes], -1), (*shape, int(np.prod(a.shape[-axes:]))))

    u = np.zeros((1, system.states)) if system.u is None else system.u
    return NonlinearSystem(
        transition=linear_transition,
        measurement=linear_measurement,
        Q=system.Q,
        R=system.R,
        z=system.z,
        x0=system.x0,
        P0=system.P0,
        p=np.concatenate([numbers(system.Phi, 2), numbers(u, 1), numbers(system.H, 2)], axis=-1),
        transition_jacobian=linear_transition_jacobian if jacobians else None,
        measurement_jacobian=linear_measurement_jacobian if jacobians else None,
    )


# Tracking in the plane: position and velocity (m, m/s) move straight on, range and bearing are seen from the origin.


@vector_function
def straight_on(x, p, out):
    out[0] = x[0] + p[0] * x[2]
    out[1] = x[1] + p[0] * x[3]
    out[2] = x[2]
    out[3] = x[3]


@matrix_function
def straight_on_jacobian(x, p, out):
    for i in range(4):
        out[i, i] = 1.0
    out[0, 2] = out[1, 3] = p[0]


@vector_function
def range_and_bearing(x, p, out):
    out[0] = np.hypot(x[0], x[1])
    out[1] = np.arctan2(x[0], x[1])


@matrix_function
def range_and_bearing_jacobian(x, p, out):
    r = np.hypot(x[0], x[1])
    out[0, 0], out[0, 1] = x[0] / r, x[1] / r
    out[1, 0], out[1, 1] = x[1] / r**2, -x[0] / r**2


def tracking(runs, epochs, rng, missing=0.0, q=0.05, coarse=1.0):
    """Targets some 1000 m off, seen to 5 m and 5 mrad; the system and the true states (runs, epochs, 4).

    They accelerate with the density q, m^2/s^3; a `coarse` sensor has so many times the sigma.
    """
    dt = 1.0
    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt
    Q = q * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(2))
    R = np.diag([5.0 * coarse, 5e-3 * coarse]) ** 2
    x0, P0 = np.array([600.0, 800.0, 5.0, -3.0]), np.diag([30.0, 30.0, 3.0, 3.0]) ** 2
    truth = np.empty((runs, epochs, 4))
    x = x0 + rng.standard_normal((runs, 4)) @ np.linalg.cholesky(P0).T
    for k in range(epochs):
        x = x @ F.T + rng.standard_normal((runs, 4)) @ np.linalg.cholesky(Q).T
        truth[:, k] = x
    seen = np.stack([np.hypot(truth[..., 0], truth[..., 1]), np.arctan2(truth[..., 0], truth[..., 1])], axis=-1)
    z = seen + rng.standard_normal(seen.shape) @ np.sqrt(R)
    z[rng.random(z.shape) < missing] = np.nan
    system = NonlinearSystem(
        straight_on,
        range_and_bearing,
        Q[None],
        R[None],
        z,
        x0,
        P0,
        np.array([[dt]]),
        straight_on_jacobian,
        range_and_bearing_jacobian,
    )
    return system, truth


# Conditionally linear: an angle u turns a linear system, as an azimuth turns tilts and velocities; u itself drifts with
# a linear state. States u, a, b, c; f and h are linear in a, b, c once u is given, with parts in u alone.


@vector_function
def turning(x, p, out):
    s, c = np.sin(x[2]), np.cos(x[2])
    out[0] = 0.9 * x[0] + 0.2 * c * x[1] + 0.3 * s
    out[1] = 0.8 * x[1] - 0.2 * s * x[0] + 0.1 * x[3] + p[0]
    out[2] = x[2] + 0.05 * x[3]
    out[3] = 0.95 * x[3] + 0.1 * x[0]


@matrix_function
def turning_jacobian(x, p, out):
    s, c = np.sin(x[2]), np.cos(x[2])
    out[0, 0], out[0, 1], out[0, 2] = 0.9, 0.2 * c, -0.2 * s * x[1] + 0.3 * c
    out[1, 0], out[1, 1], out[1, 2], out[1, 3] = -0.2 * s, 0.8, -0.2 * c * x[0], 0.1
    out[2, 2], out[2, 3] = 1.0, 0.05
    out[3, 0], out[3, 3] = 0.1, 0.95


@vector_function
def turned(x, p, out):
    s, c = np.sin(x[2]), np.cos(x[2])
    out[0] = c * x[0] + s * x[1] + 0.5 * c
    out[1] = x[1] + x[3]


@matrix_function
def turned_jacobian(x, p, out):
    s, c = np.sin(x[2]), np.cos(x[2])
    out[0, 0], out[0, 1], out[0, 2] = c, s, -s * x[0] + c * x[1] - 0.5 * s
    out[1, 1] = out[1, 3] = 1.0


TURNING = 2  # the nonlinear state


def conditionally_linear(epochs, rng, runs=(), missing=0.2):
    """The turning system, measured as it is; its prior correlated in all states, half a radian in the angle."""
    root = rng.standard_normal((4, 4))
    P0 = 0.05 * root @ root.T + np.diag([0.1, 0.1, 0.25, 0.1])
    Q, R = np.diag([0.02, 0.01, 0.02, 0.01]), np.array([[0.3, 0.1], [0.1, 0.5]])
    x0, p = np.array([1.0, -0.5, 0.7, 0.2]), rng.standard_normal((epochs, 1))
    z = np.empty((*runs, epochs, 2))
    for run in np.ndindex(*runs):
        x, y, h = rng.multivariate_normal(x0, P0), np.empty(4), np.empty(2)
        for k in range(epochs):
            turning(x, p[k], y)
            x = rng.multivariate_normal(y, Q)
            turned(x, p[k], h)
            z[(*run, k)] = rng.multivariate_normal(h, R)
    z[rng.random(z.shape) < missing] = np.nan
    return NonlinearSystem(turning, turned, Q[None], R[None], z, x0, P0, p, turning_jacobian, turned_jacobian)


# The growth model that particle filters are tried on: two valleys wherever x is, since only its square is seen.


@vector_function
def growth(x, p, out):
    out[0] = 0.5 * x[0] + 25.0 * x[0] / (1.0 + x[0] ** 2) + p[0]


@vector_function
def squared(x, p, out):
    out[0] = x[0] ** 2 / 20.0
