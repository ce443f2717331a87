# %% [markdown]
# # A first alignment, on a real recording
#
# A ring-laser IMU on a parked vehicle. People get in and out, the engine runs. The mean rate over 300 s would give a heading of 83 deg.
# What does the inertial frame give, and how sure is it?
#
# 300 s of it come with the package (`truenorth example rlg`).

# %%
import tempfile

import numpy as np

import truenorth as tn
from truenorth.formats.samples import write_sample

(log,) = write_sample("rlg", tempfile.mkdtemp())
record = tn.read_imu(log)
place = tn.Position.from_degrees(34.246, 108.910, 380.0)

# %% [markdown]
# Look at the log first. Nothing is assumed: rate, gaps, units, axes and motion are checked against the earth and against gravity.

# %%
tn.inspect(record, place.lat)

# %% [markdown]
# Now align 300 s. No specification is given, so the scale of the sensor errors is inferred from the log itself.

# %%
answer = tn.align(record, place)
answer

# %% [markdown]
# The floor is the part of sigma that waiting does not improve. Here it is nearly everything, and it is gyro bias: a second position on a
# turntable would help, more time would not.

# %%
windows = [(start, start + 100.0) for start in (0.0, 100.0, 200.0)]
for start, stop in windows:
    window = tn.align(record.between(start, stop), place)
    heading, sigma, floor = np.degrees([window.heading, window.euler_sigma[0], window.euler_sigma_floor[0]])
    random_part = np.sqrt(sigma**2 - floor**2)
    print(
        f"{start:3.0f} to {stop:3.0f} s: {heading:.3f} deg, sigma {sigma:.3f}, random part {random_part:.3f} ({window.status})"
    )

# %% [markdown]
# The three windows differ by their random parts: the bias is the same in all of them, and cancels in their difference.
#
# Align the first 150 s only, and let the INS go on by itself for the rest.

# %%
track = tn.navigate(record, tn.align(record.between(None, 150.0), place))
track
