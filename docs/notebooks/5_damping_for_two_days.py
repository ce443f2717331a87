# %% [markdown]
# # Damping for two days
#
# A free INS at sea swings: with Schuler's period of 84.4 min, which Foucault splits in two, and with 24 h. A speed log takes the swing
# away. Its own constant error (here 0.3 m/s on both axes) is what the methods treat differently.

# %%
import numpy as np

import truenorth as tn
from truenorth.damping import Damper
from truenorth.simulation.scenario import read_scenario

# 1000 s at rest, then two days at 10 m/s east and 8 m/s north. The paper's IMU has no noise; this one has.
gyro = {"bias": "0.005 deg/h", "random_walk": "0.0005 deg/sqrt(h)"}
accel = {"bias": "50 ug", "random_walk": "5 ug/sqrt(Hz)"}
spec = {"gyro": gyro, "accel": accel}
scenario = read_scenario(read_scenario("marine_damping").to_mapping() | {"imu": spec})
run, logs = scenario.simulate(run=0), scenario.simulate_aiding(run=0)
place = tn.Position.from_degrees(45.78, 126.67)
start = tn.align(run.record.between(None, 900.0), place, spec)
start

# %%
log = tn.VelocityLog(logs["velocity_log"].record)
truth = None
for method in ("none", "external", "kalman", "double", "augmented"):
    track = tn.navigate(run.record, start, aid=log, altitude="fixed", damping=Damper(method))
    truth = run.motion.states(track.time) if truth is None else truth
    late = track.time > 86_400.0  # the second day
    speed = np.sqrt(np.mean((track.v_n - truth.v_n)[late, :2] ** 2))
    place_error = np.abs(track.position[late, 0] - truth.lat[late]) * 6.37e3
    print(
        f"{method:10} second day: velocity {speed:.3f} m/s RMS, latitude {np.sqrt(np.mean(place_error**2)):6.2f} km RMS"
    )

# %% [markdown]
# `augmented` estimates the constant error of the log, and wins. The others cannot know it: `kalman` and `double` follow it in velocity.
# The place of the free INS (`none`) stays good here, since the alignment left it balanced: tilt against accelerometer bias, heading against
# gyro bias; its velocity swings with the gyros' noise.
# A disturbance at sea ends that balance, and then the swing lasts.

# %%
print(track.status, track.reasons)
print(track.damping.in_words())
track
