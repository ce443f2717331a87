"""What to do, by the keys of evidence, and words for values that a sentence names, in English."""

from __future__ import annotations

REMEDIES = {
    "record_longer": "record longer",
    "more_digits": "log more digits",
    "record_calmer": "record longer, or with less motion",
    "end_before": "align a part in which the base stands",
    "still_part": "align a part in which the base stays",
    "begin_after": "align the part after it, or the part before it",
    "latitude": "check the latitude",
    "base_stays": "check that the base stays where it is",
    "height": "check the height",
    "place": "check the position at the start, or say how rough it is",
    "units": "check the units",
    "specification": "check the specification",
    "source": "check axes, units, clock, lever arm and sigmas of that sensor",
    "given": "check their times, numbers and sigmas",
    "raw_rates": "log the rates of the sensor, not those that a filter has corrected, or align from a stop on",
    "common_clock": "check that both come from one clock and one filter",
    "grid_north": "check whether they count from grid north",
    "encoder": "check the order, signs, zero and clock of the indexer's angles",
    "turn_back": "let the axis turn both ways, rest, or turn at another rate for a while",
    "bandwidths": "give the bandwidths of gyros and accelerometers in the specification",
    "sensor_axes": "check its axes and unit",
    "imu_axes": "check the IMU's axes",
    "mounting": "give the mounting",
    "mounting_said": "check the mounting that was given, or leave it to be found",
    "baseline": "say in which direction the second antenna lies from the first, and check the heading at the start",
    "estimate.lag": "let it be estimated",
    "estimate.scale": "let it be estimated",
    "estimate.mounting": "let it be estimated",
    "latency": "give it a latency of {latency:.3f} s",
    "offset": "shift the times of that log by {offset:.3f} s",
    "arm_unit": "was it given in {unit}?",
    "arm.gnss": "check the arm; metres are expected",
    "arm.odometer": "check the arm, to the axle that nothing steers; metres are expected",
    "arm.velocity": "check the arm; metres are expected",
    "height_sensor": "give a sensor of height, or let the height be free, where the vehicle climbs",
    "level.apart": (
        "set the barometer's pressure at sea level, count both from one level (heights above the ellipsoid and above the sea "
        "differ by up to 106 m, the geoid's undulation), say how far the barometer may be off (bias_sigma), or keep the height by "
        "GNSS"
    ),
    "level.either": (
        "count both from one level (heights above the ellipsoid and above the sea differ by up to 106 m, the geoid's undulation), "
        "set the barometer's pressure at sea level, say how far the barometer may be off (bias_sigma), or leave it out"
    ),
    "level.first": (
        "set the barometer's pressure at sea level, say how far it may be off (bias_sigma), or correct the height of the start"
    ),
    "height_in_feet": "times 0.3048 they fit: they are in feet (3.28 to a metre), and metres are expected",
    "use_barometer": "for its heights keep the height by the barometer",
    "part_of_logs": "align a part of the logs",
    "rows_of_one": "align the rows of one sensor",
    "put_times_right": "correct the times",
    "transfer_geometry": "check the axes, the lever arm, the mounting and the delay",
    "without_filter": "give the master's velocity without a filter, or with a faster one",
    "flexure": "check whether both sit on one rigid body",
    "bending": "say how much it bends, and for how long",
    "slave_axes": "check the slave's axes",
    "transfer.delay": "check the delay",
    "transfer.lever_arm": "check the lever arm",
    "transfer.mounting": "check the mounting",
    "level_specification": "give a specification of the IMU, or its calibration",
    "master_drift": "say how far the master's heading drifts, or give the slave's right specification",
    "slave_specification": "give the right specification",
    "without_jump": "align a part without the jump, which may be an error of the master",
    "match_velocity": (
        "attitude matching knows the slave only as well as its mounting on the master is known; match velocity too"
    ),
    "manoeuvre": "velocity shows heading by horizontal acceleration alone; make a turn, an S-turn, a change of speed",
    "stops": "where the vehicle stands, let stops be found (zupt)",
    "log": "check its units, axes, mounting, and whether it works",
    "log_kind": "say what kind of log it is: doppler-bottom where it sees the ground",
    "log_arm": "measure the arm from the IMU to the log, and give it",
    "log_error": "check the error that was stated for it",
    "manoeuvre_gnss": "the vehicle must accelerate and turn while GNSS sees it",
    "north": "velocity along the vehicle does not show north; use gyros that see the earth turn, or GNSS",
}

TERMS = {
    "inferred from the log": "inferred from the log",
    "exchanged": "their axes exchanged",
    "first_reversed": "the other sign of the first angle",
    "last_reversed": "the other sign of the last angle",
}
