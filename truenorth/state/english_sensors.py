"""English: a sentence for each piece of evidence against a log, a sensor or its specification."""

from __future__ import annotations

OF_SENSORS = {
    # ---- the record itself
    "record.line": (
        "accelerometers show a line from 5 Hz on, and the gyros no turn that explains it: a vibration, or a hum that is no motion; "
        "velocity at a row may be off by {size:.2g} m/s (RMS)"
    ),
    # ---- its sensors, against each other, the measurements and the specification
    "tilt.axes": (
        "the gyros do not turn as gravity does in the accelerometers: {given:.2g} m/s^2 are left, and {best:.2g} m/s^2 with the "
        "gyro columns x y z read as {axes}"
    ),
    "response.gyros_late": (
        "gyros {delay:.4f} s late against the accelerometers fit the log better (likelihood ratio {ratio:.0f}, chance gives "
        "{chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle} as the IMU turns"
    ),
    "response.gyros_early": (
        "gyros {delay:.4f} s early against the accelerometers fit the log better (likelihood ratio {ratio:.0f}, chance gives "
        "{chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle} as the IMU turns"
    ),
    "response.gyro_late": (
        "the {axis} gyro {delay:+.4f} s late against the two others fits the log better (likelihood ratio {ratio:.0f}, chance "
        "gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle} as the IMU turns"
    ),
    "axes.half_turn": (
        "gyros turned by half a turn about the vertical, x and y reversed, fit the measurements better (likelihood ratio "
        "{ratio:.0f}, chance gives {chance:.0f} at most): gyros and accelerometers have other axes"
    ),
    "heave.delay": (
        "gyros {delay:+.3f} ± {sigma:.3f} s late fit the slow vertical motion better (likelihood ratio {ratio:.0f}, chance gives "
        "{chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle} as the IMU turns"
    ),
    "tilt.gyros_late": "the gyros are {delay:.3f} s late against the accelerometers, by how gravity turns in these",
    "tilt.gyros_early": "the gyros are {delay:.3f} s early against the accelerometers, by how gravity turns in these",
    "tilt.scale": "the {axis} gyro turns {scale:+.1%} ± {sigma:.1%} too far, by how gravity turns in the accelerometers",
    "tilt.turned": "axes of the gyros are off by {turn:angle} ± {sigma:angle} against the accelerometers, by how gravity swings",
    "bias.gyro": (
        "the {axis} gyro's bias comes out {bias:deg/h|} deg/h, where the specification ({imu:imu}) allows {allowed:deg/h|} deg/h"
    ),
    "bias.accel": (
        "the {axis} accelerometer's bias comes out {bias:ug|} ug, where the specification ({imu:imu}) allows {allowed:ug|} ug"
    ),
    "bias.together": (
        "the {count} biases that the measurements show are together {factor:.1f} times as large as the specification ({imu:imu}) "
        "allows"
    ),
    "bias.accel_scale": (
        "the {axis} accelerometer reads {scale:+.1%} ± {sigma:.1%} too much (likelihood ratio {ratio:.0f}); heading moves by "
        "{heading:angle}, level by {level:angle}"
    ),
    "bias.accel_may_scale": (
        "the base moves in more ways than its model, or the {axis} accelerometer reads {scale:+.1%} too much (likelihood ratio "
        "{ratio:.0f}, too little to tell); heading would move by {heading:angle}, level by {level:angle}, which sigma allows for"
    ),
    "bias.gyro_steps": (
        "the {axis} gyro's bias changes by about {size:deg/h|} deg/h near {onset:.0f} s (likelihood ratio {ratio:.0f}, chance "
        "gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "bias.accel_steps": (
        "the {axis} accelerometer's bias changes by about {size:ug|} ug near {onset:.0f} s (likelihood ratio {ratio:.0f}, chance "
        "gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "bias.accel_steps_level": (
        "the {axis} accelerometer's bias changes by about {size:ug|} ug near {onset:.0f} s (likelihood ratio {ratio:.0f}, chance "
        "gives {chance:.0f} at most); level moves by {level:angle}"
    ),
    "rival.gyro_wanders": (
        "gyro biases that change by some {size:deg/h|} deg/h over the log fit the measurements better than those of the "
        "specification (likelihood ratio {ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level "
        "by {level:angle}"
    ),
    "rival.accel_wanders": (
        "accelerometer biases that change by some {size:ug|} ug over the log fit the measurements better than those of the "
        "specification (likelihood ratio {ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level "
        "by {level:angle}"
    ),
    "rival.gyro_steps": (
        "a step of the {axis} gyro's bias by about {size:deg/h|} deg/h near {onset:.0f} s fits the measurements better (as rare by "
        "chance as a likelihood ratio of {ratio:.0f}, a sound log gives {chance:.0f} at most); heading moves by {heading:angle}, "
        "level by {level:angle}"
    ),
    "rival.master_heading": (
        "a master whose heading drifts by some {size:angle} within the log, more than was said, fits the measurements better "
        "(likelihood ratio {ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, "
        "level by {level:angle}"
    ),
    "rival.accels_warm_up": (
        "accelerometer biases that move together by up to {size:ug|} ug, as sensors that warm up within {time:.0f} s, fit the "
        "measurements better (as rare by chance as a likelihood ratio of {ratio:.0f}, a sound log gives {chance:.0f} at most); "
        "heading moves by {heading:angle}, level by {level:angle}"
    ),
    "rival.spikes": (
        "{count} single rows of the IMU stand out of their neighbours; with values between these neighbours instead the "
        "measurements fit as well or better (likelihood ratio {ratio:.3g}); heading moves by {heading:angle}, "
        "level by {level:angle}"
    ),
    "rival.poorer": (
        "an IMU {factor:.0f} times as poor as the specification fits the measurements as well (likelihood ratio {ratio:.3g}); "
        "heading moves by {heading:angle}, level by {level:angle}"
    ),
    "rival.scale_factors": (
        "scale factors {factor:.0f} times as large as the specification says fit the measurements better (likelihood ratio "
        "{ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "rival.gyro_biases": (
        "gyro biases {factor:.0f} times as large as the specification says fit the measurements better (likelihood ratio "
        "{ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "rival.misalignments": (
        "misalignments {factor:.0f} times as large as the specification says fit the measurements better (likelihood ratio "
        "{ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "delay.gyros_late": (
        "gyros taken {delay:.3f} s earlier fit the measurements better (likelihood ratio {ratio:.0f}, chance gives {chance:.0f} at "
        "most): they are late against the accelerometers; heading moves by {heading:angle}, level by {level:angle}"
    ),
    "delay.gyros_early": (
        "gyros taken {delay:.3f} s later fit the measurements better (likelihood ratio {ratio:.0f}, chance gives {chance:.0f} at "
        "most): they are early against the accelerometers; heading moves by {heading:angle}, level by {level:angle}"
    ),
    "noise.gyro_stretch": (
        "the gyros are noisier than elsewhere between {begin:.0f} s and {end:.0f} s: heading errs by {heading:angle} more"
    ),
    "noise.accel_stretch": (
        "the accelerometers are noisier than elsewhere between {begin:.0f} s and {end:.0f} s: heading errs by {heading:angle} more"
    ),
    "specification.gyro_noise": (
        "the gyros' white noise is {noise:deg/sqrt(h)|} deg/sqrt(h), where the specification ({imu:imu}) says "
        "{said:deg/sqrt(h)|}: it is another sensor's, and so may be what it says of biases"
    ),
    "specification.accel_noise": (
        "the accelerometers' white noise is {noise:ug/sqrt(Hz)|} ug/sqrt(Hz), where the specification ({imu:imu}) says "
        "{said:ug/sqrt(Hz)|}: it is another sensor's, and so may be what it says of biases"
    ),
    "specification.gyro_rows": (
        "above the sway the gyros' white noise is {noise:deg/sqrt(h)|} deg/sqrt(h), where the specification ({imu:imu}) says "
        "{said:deg/sqrt(h)|}; under it the log allows {allowed:deg/sqrt(h)|}: heading errs by {heading:angle} more, level by "
        "{level:angle}"
    ),
    "specification.accel_rows": (
        "above the sway the accelerometers' white noise is {noise:ug/sqrt(Hz)|} ug/sqrt(Hz), where the specification ({imu:imu}) "
        "says {said:ug/sqrt(Hz)|}; under it the log allows {allowed:ug/sqrt(Hz)|}: heading errs by {heading:angle} more, level by "
        "{level:angle}"
    ),
    "specification.noisier": (
        "the white noise of the rows (gyros {gyro:deg/sqrt(h)|} deg/sqrt(h), accelerometers {accel:ug/sqrt(Hz)|} ug/sqrt(Hz)) is "
        "far more than the specification ({imu:imu}) says: a vehicle that vibrates, or another sensor; the answer counts it, and "
        "such noise hides other errors, as of gyros that are late"
    ),
    "specification.gyro_unsaid": (
        "the specification ({imu:imu}) does not name all errors of the gyros: as of sensors with such noise, a bias of "
        "{bias:deg/h|.2g} deg/h, scale factors of {scale:ppm|.2g} ppm and misalignments of {misalignment:arcmin|.2g} arcmin are "
        "possible (one sigma)"
    ),
    "specification.accel_unsaid": (
        "the specification ({imu:imu}) does not name all errors of the accelerometers: as of sensors with such noise, a bias of "
        "{bias:ug|.2g} ug, scale factors of {scale:ppm|.2g} ppm and misalignments of {misalignment:arcmin|.2g} arcmin are possible "
        "(one sigma)"
    ),
    "specification.noise_alone": (
        "the specification ({imu:imu}) names no bias of the gyros: the errors of the IMU are inferred from the log instead; name "
        "one, 0 deg/h where there is none"
    ),
    "specification.suspect": (
        "the specification ({imu:imu}) is the suspect: with an IMU {factor:.0f} times as poor the measurements fit"
    ),
    "bias.vertical_steps": (
        "near {onset:.0f} s the rate about the vertical changes by {size:deg/h|} deg/h and stays so: heading moves by "
        "{heading:angle}"
    ),
    "bias.gravity_drifts": (
        "gravity moves by {tilt:angle} in the axes of the IMU (likelihood ratio {ratio:.3g}), and the base is still: an "
        "accelerometer drifts by {moved:ug|.3g} ug, which moves heading by {heading:angle}, or the base tilts as steadily"
    ),
    # ---- an indexer's angles, and aids that contradict themselves
    "encoder.gyro_matrix": (
        "by the encoder's angles the {axis} gyro shows turns about {about} with an error of {found:+.1%}, where the specification "
        "({imu:imu}) allows {allowed:.1%}"
    ),
    "encoder.turns": (
        "the base would turn by {given:deg/s|.2g} deg/s RMS with these angles of the indexer, and by {best:deg/s|.2g} deg/s with "
        "{reading:term}"
    ),
    "encoder.drifts": (
        "with these angles of the indexer the base turns by {net:deg|.0f} deg from the first third of the log to the last "
        "({rate:deg/s|.2g} deg/s RMS): no base that stays does"
    ),
    "encoder.jumps": (
        "angle {axis} of the encoder jumps by {size:deg|+.3f} deg at {time:.1f} s, where the gyros see no turn of that axis: it "
        "slips, or its count was set anew"
    ),
    "encoder.slips": (
        "angle {axis} of the encoder slips by {size:deg|+.3f} ± {sigma:deg|.3f} deg near {time:.1f} s: from there on the base "
        "would stand turned about that axis"
    ),
    "encoder.disc": (
        "angle {axis} of the encoder is off by {size:deg|.3f} ± {sigma:deg|.3f} deg to and fro, once a turn, as of a disc out of "
        "centre: the base would wobble as the axis turns"
    ),
    "encoder.disc_twice": (
        "angle {axis} of the encoder is off by {size:deg|.3f} ± {sigma:deg|.3f} deg to and fro, twice a turn: the base would "
        "wobble as the axis turns"
    ),
    "encoder.disc_or_sway": (
        "angle {axis} of the encoder may be off by {size:deg|.3f} ± {sigma:deg|.3f} deg to and fro as the axis turns, or the base "
        "sways as fast: while the axis turns at one rate, nothing tells the one from the other"
    ),
    "encoder.zero": (
        "the zero of the inner axis' angle is off by {off:deg|+.3f} ± {sigma:deg|.3f} deg, or the encoder is late or early: the "
        "base would wobble as the outer axis turns"
    ),
    "encoder.late": (
        "the encoder is late by {late:ms|+.2f} ± {sigma:ms|.2f} ms, as the base would turn at each start and stop of an axis, and "
        "the axes turn where the answer is asked for: the body is off by as much as they turn in that time"
    ),
    "encoder.late_taken": (
        "the encoder is late by {late:ms|+.2f} ± {sigma:ms|.2f} ms, as the base would turn at each start and stop of an axis: that "
        "is taken off its times"
    ),
    "gnss.turned": "the GNSS velocities are turned by {angle:deg|+.2f} ± {sigma:deg|.2f} deg against the changes of its positions",
    "gnss.height_drifts": "the GNSS heights drift by {size:.2g} m against the velocities, {rate:+.2g} m/s (ratio {ratio:.0f})",
    "gnss.height_steps": (
        "the GNSS heights step by {size:+.2g} m at {time:.0f} s, and the velocities do not (ratio {ratio:.0f}): another datum, "
        "geoid or reference station from there on?"
    ),
    "gnss.velocity": "the GNSS velocities are not the changes of its positions, whatever way they are turned",
    "master.turned": (
        "the master's velocities are turned by {angle:deg|+.2f} ± {sigma:deg|.2f} deg against the changes of its positions"
    ),
    "master.velocity": "the master's velocities are not the changes of its positions, whatever way they are turned",
}
