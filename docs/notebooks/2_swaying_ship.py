# %% [markdown]
# # A swaying ship
#
# On a base that sways, mean rates and mean forces say nothing of north. The gyros carry an inertial frame through all motion, and in it
# gravity turns with the earth in a known way. The simulator knows the truth, so sigma can be held against the error.

# %%
import numpy as np

import truenorth as tn
from truenorth.core.attitude import euler_from_dcm
from truenorth.simulation.scenario import read_scenario

scenario = read_scenario("quay")  # moored, a low swell, the IMU high above the centre of rotation
place = tn.Position.from_degrees(53.54, 9.97, 12.0)
run = scenario.simulate(run=0)
tn.plot(run)

# %% [markdown]
# Three methods on the same 300 s. `analytic` takes mean rates and forces and is lost here. `oba` works in the inertial frame.
# `swaying`, which `auto` takes, also estimates the ship's motion and the lever arm to its centre of rotation.

# %%
record = run.record.between(None, 300.0)
truth = np.degrees(np.ravel(euler_from_dcm(run.motion.states(record.time[-1]).C_nb)))
print(f"{'error, arcmin':25} {'heading':>18} {'pitch':>18} {'roll':>18}")
for method in ("analytic", "oba", "swaying"):
    answer = tn.align(record, place, "navigation", method=method)
    error = (np.degrees(answer.euler) - truth + 180.0) % 360.0 - 180.0
    sigma = np.degrees(answer.euler_sigma)
    words = " ".join(f"{60 * e:+8.2f} ± {60 * s:7.2f}" for e, s in zip(error, sigma, strict=True))
    print(f"{method:9} {answer.status:15} {words}")

# %% [markdown]
# How does the heading converge? The band is one sigma, the dark band its floor.

# %%
answer = tn.align(run.record, place, "navigation")
answer

# %% [markdown]
# One run proves little. Twelve runs with fresh errors: the RMS of error over sigma should be near 1.

# %%
ratios = []
for number in range(1, 13):
    run = scenario.simulate(run=number)
    record = run.record.between(None, 300.0)
    answer = tn.align(record, place, "navigation")
    true = np.ravel(euler_from_dcm(run.motion.states(record.time[-1]).C_nb))
    error = (answer.heading - true[0] + np.pi) % (2 * np.pi) - np.pi
    ratios.append(error / answer.euler_sigma[0])
print(f"RMS of error over sigma: {np.sqrt(np.mean(np.square(ratios))):.2f} (12 runs; the 95 % band is 0.61 to 1.39)")
