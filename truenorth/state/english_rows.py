"""English: a sentence for what the rows of a record show."""

from __future__ import annotations

RECORD = {
    "record.saturated": "{text}",
    "record.constant_channel": "{text}",
    "record.rows_again": "{text}",
    "record.gyro_unit": "{text}",
    "record.accel_unit": "{text}",
    "record.accel_level": "{text}",
    "record.no_gravity": "{text}",
    "record.repeated_rows": "{text}",
    "record.rate_changes": "{text}",
    "record.rounded_stamps": "{text}",
    "record.no_noise": "{text}",
    "record.frozen": "{text}",
    "record.gaps": "{text}",
    "record.jitter": "{text}",
    "record.vibration": (
        "vibration that rows at {rate:.4g} Hz hardly sample turns the attitude at the last one by {size:angle} (one sigma), and "
        "its coning is a gyro bias of {drift:deg/h|.2g} deg/h: log increments, or more rows a second"
    ),
    "record.time_unit": "{text}",
    "record.reordered_rows": "{text}",
    "record.clock_jumps": (
        "the log has {count:d} gap(s) of {lost:.2f} s in all, and fits the measurements better without them (likelihood ratio "
        "{ratio:.0f}): its clock has jumped, no rows are lost"
    ),
    "record.coarse": (
        "{name} is written in steps of {step:.3g}, which hide its noise: its mean may be off by a part of a step; heading by "
        "{heading:angle}, level by {level:angle}"
    ),
    "record.codes": "{name} is {value:.4g} in {rows} rows and no other from {from:.4g} to {to:.4g}: missing codes, or a dead band",
    "record.spikes": (
        "{count} single rows of {name} stand out to one side, and the rows around them show no motion: errors of the log, not "
        "knocks; heading by {heading:angle}, level by {level:angle}"
    ),
    "record.spikes_or_knocks": (
        "{count} single rows of {name} stand out to one side: errors of the log or knocks, which the rows around them do not tell "
        "apart; if they are errors, heading is off by {heading:angle}, level by {level:angle}"
    ),
    "record.hum": (
        "gyros hum by {level:angle} (RMS), and the accelerometers show no tilt of it: no motion, but a turn that nothing has, and "
        "a drift of {drift:deg/h|.2g} deg/h; heading by {heading:angle}, level by {level:angle}"
    ),
    "record.hum_or_slow": (
        "gyros turn to and fro by {level:angle} (RMS), of which the accelerometers show too little tilt: a hum of the gyros, or "
        "accelerometers of a lower bandwidth; if it is a hum, it is a drift of {drift:deg/h|.2g} deg/h, heading is off by "
        "{heading:angle}, level by {level:angle}"
    ),
    "record.alternates": (
        "every second row of the accelerometers differs by {size:.3g} m/s^2 all through the log, as those of two sensors in turn: "
        "their mean is turned against either by {level:angle}"
    ),
    "record.other_counts": (
        "one in {rows} rows of the accelerometers has other counts than the rest: sensors in turn, or rows that were put between "
        "others; by their means the mean of all may be turned by {level:angle} (one sigma)"
    ),
    "record.in_turn": "one in {rows} rows of accelerometers differs by {size:.3g} m/s^2: sensors in turn, {level:angle} apart",
    "record.rolls_over": "{name} stands at {count:.0f} of {range:.0f} counts: gravity may have rolled over at a range's end",
    "record.stuck": "{name} stands still for {length:.1f} s from {begin:.1f} s on",
}
