# %% [markdown]
# # Compare ten methods by a campaign, and write one's own
#
# Every method meets the same data. A run that fails is a row with its reason.

# %%
import tempfile
from dataclasses import replace

import numpy as np

import truenorth as tn

METHODS = ["analytic", "inertial", "oba", "kalman", "swaying", "kf", "sakf", "makf", "imakf", "states10"]
sway = {
    "name": "sway",
    "duration": "150 s",
    "rate": "50 Hz",
    "position": {"lat": "40 deg", "lon": "118 deg"},
    "motion": {
        "kind": "sway",
        "heading": "30 deg",
        "tones": {
            "pitch": [{"amplitude": "2 deg", "period": "5 s"}],
            "roll": [{"amplitude": "3 deg", "period": "6 s"}],
            "east": [{"amplitude": "0.02 m", "period": "7 s"}],
            "up": [{"amplitude": "0.1 m", "period": "8 s"}],
        },
    },
    "imu": "navigation",
}
plan = {"name": "ten methods", "runs": 8, "scenarios": [sway], "methods": METHODS}
folder = tempfile.mkdtemp()
campaign = tn.run_campaign(plan, folder)
heading = campaign.summary.query("quantity == 'phi_u'")[["method", "runs", "rms", "sigma", "rms_over_sigma"]]
heading.sort_values("rms").reset_index(drop=True).round(2)

# %% [markdown]
# RMS in arcmin. `rms_over_sigma` should be near 1: a method that claims too little is worse than one that is merely wide.
# `analytic` and `states10` ask for a base that is still: they refuse heading here, and have no row.

# %%
tn.plot(campaign)["distribution"]

# %% [markdown]
# ## One's own
#
# A filter is a function of a system that returns estimates. Here is the shortest honest one: the Kalman filter with its gain frozen at
# the steady state. `LinearSystem` says what is filtered, and the library's own filter is the judge.

# %%
from truenorth.filters import LinearSystem, kalman

rng = np.random.default_rng(1)
dt, steps, runs = 1.0, 400, 200
Phi = np.array([[1.0, dt], [0.0, 1.0]])
Q = 1e-4 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
H, R = np.array([[1.0, 0.0]]), np.array([[0.04]])
noise = np.linalg.cholesky(Q)
x = rng.standard_normal((runs, 2))
truth, z = np.empty((runs, steps, 2)), np.empty((runs, steps, 1))
for k in range(steps):
    x = x @ Phi.T + rng.standard_normal((runs, 2)) @ noise.T
    truth[:, k], z[:, k] = x, x @ H.T + 0.2 * rng.standard_normal((runs, 1))
system = LinearSystem(Phi[None], Q[None], H[None], R[None], z, np.zeros(2), np.eye(2))


def frozen_gain(system: LinearSystem, after: int) -> np.ndarray:
    """States (runs, K, n) of a filter whose gain stays what it is after this many epochs."""
    P = system.P0
    for _ in range(after):
        P = system.Phi[0] @ P @ system.Phi[0].T + system.Q[0]
        K = P @ system.H[0].T @ np.linalg.inv(system.H[0] @ P @ system.H[0].T + system.R[0])
        P = (np.eye(len(P)) - K @ system.H[0]) @ P
    x = np.broadcast_to(system.x0, (*system.z.shape[:-2], system.x0.shape[-1])).copy()
    found = np.empty((*system.z.shape[:-1], x.shape[-1]))
    for k in range(system.z.shape[-2]):
        x = x @ system.Phi[0].T
        x = x + (system.z[..., k, :] - x @ system.H[0].T) @ K.T
        found[..., k, :] = x
    return found


best = kalman(system, history="full")
mine = frozen_gain(system, after=200)
for name, found in (("Kalman", best.x), ("frozen gain", mine)):
    rms = np.sqrt(np.mean((found - truth) ** 2, axis=0))
    print(f"{name:12} position RMS at epoch 5: {rms[5, 0]:.3f}, at the end: {rms[-1, 0]:.3f}")

# %% [markdown]
# Early the frozen gain is worse, late it is as good: that is what freezing costs.
#
# A method for a whole log is a *recipe*: a function of a request, which `truenorth.align` takes as its `method`. Here, the mean of two halves.

# %%
from truenorth.alignment.procedure import align_base
from truenorth.simulation import rest


def two_halves(request: tn.Request) -> tn.Alignment:
    """Align the second half; say how far the first half is away."""
    record = request.record
    middle = 0.5 * (record.time[0] + record.time[-1])
    first, second = (
        align_base(part, request.needed_place(), request.imu)
        for part in (record.between(None, middle), record.between(middle, None))
    )
    apart = np.degrees(first.heading - second.heading)
    return replace(second, method="two_halves", method_reason=f"the halves are {60 * apart:+.1f} arcmin apart")


still = tn.simulate(
    rest(tn.Position.from_degrees(40.0, 118.0), 0.5),
    rate=50.0,
    duration=300.0,
    imu=tn.imu_spec("navigation"),
    seed=3,
)
answer = tn.align(still.record, (40.0, 118.0), "navigation", method=two_halves)
answer.method_reason
