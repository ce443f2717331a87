# %% [markdown]
# # Transfer alignment
#
# A slave IMU takes its attitude from a master INS on the same aircraft. The master's rows arrive 30 ms late, and the slave sits a lever
# arm away. Both are estimated.

# %%
import numpy as np

import truenorth as tn
from truenorth.core.attitude import euler_from_dcm
from truenorth.simulation.scenario import read_scenario

scenario = read_scenario("transfer_flat_turn")  # 200 m/s, a flat turn of 90 deg from 120 to 150 s
run, logs = scenario.simulate(run=0), scenario.simulate_aiding(run=0)
spec = {
    "gyro": {"bias": "1 deg/h", "random_walk": "0.05 deg/sqrt(h)"},
    "accel": {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)"},
}
place = tn.Position.from_degrees(34.0, 109.0, 5000.0)
master = tn.Master(logs["master"].record, matching="velocity")

# %%
answer = tn.align(run.record, place, spec, aid=master)
true = np.degrees(np.ravel(euler_from_dcm(run.motion.states(answer.time).C_nb)))
error = (np.degrees(answer.euler) - true + 180.0) % 360.0 - 180.0
for name, e, s in zip(("heading", "pitch", "roll"), 60 * error, 60 * np.degrees(answer.euler_sigma), strict=True):
    print(f"{name:8} error {e:+6.2f} arcmin, one sigma {s:.2f}")
answer

# %% [markdown]
# Delay and lever arm, and what this motion cannot separate: in a steady turn the delay and the forward arm are one number.

# %%
t = answer.transfer
print(f"delay {1e3 * t.delay:.1f} ± {1e3 * t.delay_sigma:.1f} ms (true: 30)")
print(
    f"lever arm {np.round(t.lever_arm, 2)} ± {np.round(t.lever_arm_sigma, 2)} m (true: 1, 0.1, 0.2, as the master sits)"
)
print(*answer.reasons, sep="\n")

# %% [markdown]
# Which manoeuvre helps most? Ask before you fly.

# %%
advice = tn.advise_manoeuvre(spec, place, speed=200.0, wanted=np.radians(10 / 60))
print(advice)
tn.plot(advice)
