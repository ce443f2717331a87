# %% [markdown]
# # In motion
#
# A van drives off with an industrial MEMS IMU and no idea of its heading. Its gyros are too poor to find north. GNSS and the wheel show
# how it accelerates, and that shows the heading.

# %%
import numpy as np

import truenorth as tn
from truenorth.core.attitude import euler_from_dcm
from truenorth.simulation.scenario import read_scenario

scenario = read_scenario("van")
run, logs = scenario.simulate(run=0), scenario.simulate_aiding(run=0)
tn.plot(run, aiding=logs)

# %%
odometer = tn.Odometer(logs["odometer"].record)
gnss = tn.Gnss(
    logs["gnss"].record, tn.Mounting(lever_arm=(0.0, -0.5, 1.2), latency=0.1, bias_sigma=1.5, bias_time=60.0)
)

answer = tn.align(run.record.between(None, 180.0), imu="industrial", aid=[odometer, gnss])
true = np.degrees(np.ravel(euler_from_dcm(run.motion.states(answer.time).C_nb)))[0]
error = (np.degrees(answer.heading) - true + 180.0) % 360.0 - 180.0
print(f"heading error {error:+.2f} deg, one sigma {np.degrees(answer.euler_sigma[0]):.2f} deg")
answer

# %% [markdown]
# The wheel was calibrated on the way: scale, mounting angles, and where it sits.

# %%
found = answer.moving.summary()
print(f"scale {100 * found['odometer_scale']:+.3f} ± {100 * found['odometer_scale_sigma']:.3f} %")
print("mounting, heading, pitch, roll:", np.round(found["mounting_deg"], 3), "deg")
print(
    "wheel, right, forward, up:", np.round(found["wheel_arm_m"], 2), "±", np.round(found["wheel_arm_sigma_m"], 2), "m"
)

# %% [markdown]
# Now navigate on, through 40 s without GNSS (200 to 240 s). With the odometer the position stays within metres.

# %%
for name, aids in (("GNSS alone", [gnss]), ("GNSS and odometer", [gnss, odometer])):
    track = tn.navigate(run.record, answer, aid=aids)
    row = int(np.argmin(abs(track.time - 240.0)))
    states = run.motion.states(track.time[row])
    north = (track.position[row, 0] - states.lat) * 6.37e6
    east = (track.position[row, 1] - states.lon) * 6.37e6 * np.cos(states.lat)
    sigma = np.hypot(*track.position_sigma[row, :2])
    print(
        f"{name:18} after the outage: {np.hypot(float(north), float(east)):6.1f} m off, one sigma {sigma:.1f} m; {track.status}"
    )

# %%
track
