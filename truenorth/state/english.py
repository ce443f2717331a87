"""English: a sentence for each piece of evidence; those of logs and sensors stand in a file of their own."""

from __future__ import annotations

from truenorth.state.english_rows import RECORD
from truenorth.state.english_sensors import OF_SENSORS

SENTENCES = {
    **RECORD,
    "text": "{text}",
    # ---- what an alignment reached
    "heading.known": (
        "heading is known to {sigma:angle} (one sigma); {floor:angle} of it is sensor bias, which waiting does not improve"
    ),
    "heading.known_from": "heading is known to {sigma:angle} (one sigma), from {source}",
    "heading.known_with_level": "heading is known to {sigma:angle}, level to {level:angle} (one sigma)",
    "heading.paid": "after {pays_until:.0f} s more time stopped paying: the floor was the larger part",
    "heading.pays": "more time pays until about {pays_until:.0f} s; the log has {duration:.0f} s",
    "heading.curved": (
        "headings up to {off:deg|.1f} deg away are less likely by less than four sigmas, and sigma has them in by their chance: of "
        "an IMU that is turned on and on one way, a scale factor of a gyro makes up for the difference; turn it both ways in turn"
    ),
    "heading.rivals": (
        "a heading {off:deg|.0f} deg away explains the log as well: the IMU is turned on and on one way about an axis that is not "
        "vertical, and a scale factor of the gyro along it makes up for the difference; turn it both ways in turn"
    ),
    "heading.vertical": "pitch is near ±90 deg: only a combination of heading and roll is known (see the combination)",
    "level.upside_down": (
        "z points down: this is the attitude of an IMU that lies upside down; a log whose axes are forward, right, down needs "
        "to be read as such, and has another heading"
    ),
    "heading.hidden": (
        "at latitude {lat:deg|.3f} deg the earth turns by {horizontal:deg/h|.3f} deg/h about the horizontal; gyro biases of "
        "{bias:deg/h|} deg/h hide true north there"
    ),
    "heading.bias": (
        "gyro bias can be {bias:deg/h|} deg/h ({imu:term}); a heading within {limit:deg|g} deg at latitude {lat:deg|.1f} deg needs "
        "{needed:deg/h|.2g} deg/h or better: heading is refused"
    ),
    "heading.short": (
        "heading is known to {sigma:angle} only after {duration:.0f} s, {limit:angle} is wanted; sensor bias would allow "
        "{floor:angle}"
    ),
    "heading.short_until": (
        "heading is known to {sigma:angle} only after {duration:.0f} s, {limit:angle} is wanted; sensor bias would allow "
        "{floor:angle}; about {pays_until:.0f} s in all would bring it near its floor"
    ),
    "heading.wanted": "heading is known to {sigma:angle} only after {duration:.0f} s, {limit:angle} is wanted",
    "level.known": "level is known to {level:deg|.2f} deg (one sigma)",
    "level.known_finely": "level is known to {level:arcmin|.2f} arcmin (one sigma)",
    "level.unknown": "level is known to {level:deg|.2f} deg only; {limit:deg|.0f} deg is the most that passes for level",
    "level.biased": (
        "level is known to {level:deg|.2f} deg only, however long the log is: an accelerometer's bias can be {bias:mg|.2g} mg "
        "({imu:imu}); {limit:deg|.0f} deg is the most that passes for level"
    ),
    "latitude.found": "the latitude was not given: found from the log, {lat:deg|.2f} deg, to {sigma:deg|.2g} deg (one sigma)",
    "latitude.assumed": (
        "the latitude was not given: {lat:deg|.0f} deg assumed; gyros as poor, or a log as short, do not see the difference"
    ),
    "aids.late": "the vehicle drives for {waited:.0f} s before anything aids: the log is used from then on",
    "answers.differ": (
        "the method that the library chooses finds another attitude in the same logs: heading differs by {heading:angle}, level by "
        "{level:angle}, {sigmas:.1f} times what both sigmas allow"
    ),
    "answers.tight": (
        "this method claims more than the one that the library chooses finds in the same logs: heading {heading:angle}, "
        "level {level:angle} are added to sigma"
    ),
    # ---- a base that stays, against earth and gravity
    "base.moves": "the base does not stay where it is: it moves from {until:.1f} s on",
    "base.sets_off": (
        "the base turns and goes away from about {time:.0f} s on: level is that of the rest before, carried on by the gyros"
    ),
    "base.stops": "the base moves until about {time:.0f} s: level is that of the rest behind",
    "base.stays": (
        "that the base stays is taken as given: a steady {speed:.2g} m/s towards north or south would turn heading by its sigma, "
        "and the log would not show it"
    ),
    "base.unsettled": "re-linearisation did not settle: the log does not look like that of a base that stays where it is",
    "base.fast": "a base that stays would move with {speed:.3g} m/s RMS",
    "drift.step": (
        "the base drifts {axis:term}: from about {onset:.0f} s on its velocity shows a step to {velocity:.2g} m/s (likelihood "
        "ratio {ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "drift.ramp": (
        "the base drifts {axis:term}: from about {onset:.0f} s on its velocity grows to {velocity:.2g} m/s (likelihood "
        "ratio {ratio:.0f}, chance gives {chance:.0f} at most); heading moves by {heading:angle}, level by {level:angle}"
    ),
    "sway.slow": (
        "the base moves slowly as well, and the log does not show that it comes back: something that began at about {onset:.0f} s, "
        "such as a base that leaves or a bias that changes, explains the log as well (likelihood ratio {ratio:.0f}); heading moves "
        "by {heading:angle}, level by {level:angle}"
    ),
    "sway.swing": (
        "the base swings slowly, as a ship does on her lines: by {east:.2f} m in {east_period:.0f} s along east, by {north:.2f} m "
        "in {north_period:.0f} s along north"
    ),
    "place.hemisphere_in_doubt": "gravity rather turns as in the other hemisphere (likelihood ratio {ratio:.0f}), a doubt",
    "place.hemisphere": "gravity turns as in the other hemisphere (likelihood ratio {ratio:.0f}): the latitude has the wrong sign",
    "rate.misses": (
        "the gyros' mean rate along {axis:term} misses the earth's by {residual:deg/h|} deg/h, where the specification "
        "({imu:imu}) allows {allowed:deg/h|} deg/h"
    ),
    "rate.doubtful": (
        "the gyros' mean rate along {axis:term} misses the earth's by {residual:deg/h|} deg/h, where the specification "
        "({imu:imu}) allows {allowed:deg/h|} deg/h: a miss of that size towards east is in sigma"
    ),
    "force.misses": (
        "the mean specific force misses gravity by {residual:ug|} ug, where the specification ({imu:imu}) allows "
        "{allowed:ug|} ug"
    ),
    "table.touched": (
        "the table was touched, or an accelerometer's offset jumped, at about {time:.0f} s: the level specific force steps by "
        "{step:mg|.2g} mg (as a tilt of {tilt:angle} would make it; usual {usual:mg|.2g} mg), and the gyros show no turn"
    ),
    # ---- measurements against the prediction
    "innovations.rejected": (
        "{name}: {rejected} of {count} measurements rejected: they contradict the track (half of them by more than "
        "{scatter:.3g} {unit})"
    ),
    "innovations.at_rest": (
        "as of a vehicle at rest from {begin:.0f} to {end:.0f} s the log finds heading {rest:deg|.2f} ± {rest_sigma:deg|.2f} deg, "
        "and its gyros see the earth's rate; its aids move it by up to {speed:.2g} m/s, and turn heading to {heading:deg|.2f} deg: "
        "a receiver that is led away, or a wheel that spins"
    ),
    "innovations.elsewhere": (
        "{name}: {rejected} of {count} measurements rejected: all of them lie about {distance:.3g} m from where the track began"
    ),
    "innovations.height": (
        "{name}: {rejected} of {count} measurements rejected: all of them lie about {distance:.3g} m above or below the height of "
        "the start"
    ),
    "innovations.turned": (
        "{name}: {rejected} of {count} measurements rejected: all of them point about {distance:deg|+.3g} deg from where the track "
        "says that the baseline does, clockwise positive"
    ),
    "innovations.given": (
        "{name}: {rejected} of {count} measurements rejected: they contradict the track, by up to {largest:.3g} sigma of both"
    ),
    "innovations.outliers": "{name}: {rejected} of {count} measurements rejected as outliers",
    "innovations.size": "{name}: innovations are {factor:.1f} times as large as their sigma says: sigma is not to be trusted",
    "innovations.coloured": (
        "{name}: innovations are {size:.2f} times as large as their sigma says and follow each other ({colour:.1f} times the error "
        "of white ones): sigma grows {growth:.1f} times"
    ),
    "innovations.at_end": (
        "from {until:.0f} s to its end the log is {factor:.1f} times as far from what its beginning foretells as sigma says: the "
        "base goes away there"
    ),
    "innovations.left": "{name}: what the answer leaves of it is {size:.2f} times as large as sigma says: sigma grows as much",
    "innovations.late": (
        "{name}: {late} measurements came more than a second after the IMU's rows of their time, or alone at the start, until the "
        "next one came: this running answer leaves them out"
    ),
    "innovations.outside": "{name}: {outside} measurements lie before the start or after the end of the IMU's log",
    "innovations.wander": (
        "{name}: its errors follow each other from row to row (correlation {correlation:.2f}) and wander by {wander:.2g} {unit} or "
        "more: a slow error is estimated, and in sigma"
    ),
    "innovations.step": (
        "{name}: at {onset:.0f} s it steps by {size:.2g} m/s, and the IMU does not (likelihood ratio {ratio:.3g}; chance gives "
        "{chance:.3g}): the receiver may be led away, by {distance:.2g} m until the end"
    ),
    "noise.stamps": (
        "{name}: its stamps scatter by {size:.2g} s about their delay (one sigma): what that makes of speed and acceleration is "
        "in the noise of each row"
    ),
    "noise.swing": (
        "{name}: its antenna swings about the IMU by {size:.2g} m/s (RMS) more than it shows: that is in the noise of each row"
    ),
    "noise.estimated": "{name}: its noise is {factor:.2g} times as large as was said; so it is taken",
    "delay.late": "{name}: its stamps are {size:.3f} ± {sigma:.2g} s late, which is estimated and in sigma",
    "delay.early": "{name}: its stamps are {size:.3f} ± {sigma:.2g} s early, which is estimated and in sigma",
    "rest.shifts": (
        "at {time:.0f} s it stands, and its gyros show {size:deg|.2g} deg/s more than at other stops: biases that change, or a "
        "turn on the spot; such a change turns heading by up to {heading:deg|.2g} deg until the end"
    ),
    "clock.runs_fast": (
        "the IMU's clock runs fast against that of the {name} by {size:.0f} ± {sigma:.2g} ppm: delays change so, "
        "which is estimated and in sigma"
    ),
    "clock.runs_slow": (
        "the IMU's clock runs slow against that of the {name} by {size:.0f} ± {sigma:.2g} ppm: delays change so, "
        "which is estimated and in sigma"
    ),
    "clock.ahead": (
        "{name}: its clock is {size:.0f} s ahead of the IMU's, as the turns that both see show: its rows are taken as {size:.0f} s "
        "earlier"
    ),
    "clock.behind": (
        "{name}: its clock is {size:.0f} s behind the IMU's, as the turns that both see show: its rows are taken as {size:.0f} s "
        "later"
    ),
    "clock.gps_or_utc": "GPS time is 18 s ahead of UTC: one of the two logs may be in GPS time, the other in UTC",
    "delay.one_of_several": (
        "{name}: its stamps are {size:.3f} s late or, with a chance of {chance:.2g}, {other:.3f} s: the antenna shakes too "
        "quickly to tell; what that does is in sigma"
    ),
    "clock.may_run": (
        "the clocks of the IMU and the {name} may run apart by {size:.0f} ppm: the log neither shows nor rules this out "
        "(likelihood ratio {ratio:.3g}), and what it would do is in sigma by its chance: log more turns, or a longer log"
    ),
    "gnss.delay_taken_over": "GNSS: its stamps are late as the alignment found, and that is estimated on",
    "odometer.taken_over": "odometer: scale, mounting and wheel arm are the alignment's, and estimated on",
    "odometer.scale": "the {name} counts {scale:%|+.2f} % ({sigma:%|.2g} % one sigma)",
    # ---- a slave against its master
    "transfer.clocks_part": (
        "the master's stamps are {before:.2f} s behind the slave's clock until {until:.1f} s and {after:.2f} s from "
        "{since:.1f} s on, by their motion: one of the clocks steps or runs at another rate"
    ),
    "transfer.rejected": "{share:.0%} of the master's rows contradict the slave",
    "transfer.delay": "the delay comes out {miss:ms|.3g} ms from the assumed one, which was taken as known to {prior:ms|.3g} ms",
    "transfer.lever_arm": "the lever arm comes out {miss:.3g} m from the assumed one, which was taken as known to {prior:.3g} m",
    "transfer.mounting": (
        "the mounting comes out {miss:deg|.3g} deg from the assumed one, which was taken as known to {prior:deg|.3g} deg"
    ),
    "transfer.lopsided": (
        "the master's {rows} differ from the prediction to one side all the time: the slave's errors are larger than its "
        "specification ({imu:imu}) allows, or the master drifts"
    ),
    "transfer.filter": "a filter of some {constant:.2f} s smoothed the master's velocity: its arm may be off by more than sigma",
    "transfer.unsettled": "the passes over the log do not settle: the last one still moved the answer by {left:.1f} of its sigmas",
    "transfer.lasting": (
        "{name}: what it differs from the slave by ({size:.3g} {unit}) lasts from row to row ({colour:.0f} times the error of "
        "white noise): this is no motion of one rigid body"
    ),
    "transfer.jumps": "the master's solution jumps {count} times: it does not fit this slave",
    "transfer.absolute": (
        "sigma is absolute, the master's own errors are in it; against the master heading is known to {heading:angle}, level "
        "to {level:angle}"
    ),
    "transfer.shaken": (
        "vibration moves the slave against its master by {size:.2g} m/s, at a phase that the delay does not tell: level may be off "
        "by {level:angle} (one sigma), which its sigma has; give lever arm and delay with smaller sigmas"
    ),
    "transfer.bends": (
        "the slave turns by {size:angle} (RMS) at some {frequency:.2g} Hz, and the master's attitude does not: what is between "
        "them bends, and delay, lever arm and mounting of a rigid arm may be false"
    ),
    "transfer.relative": "sigma is against the master, whose own errors come on top: none of what is matched were given",
    "transfer.open": "left open by this motion: {states}",
    # ---- clocks, arms, scales and mountings left open
    "mounting.missed": (
        "{name}: the mounting comes out {miss:deg|.3g} deg from the assumed one, which was taken as known to {prior:deg|.3g} deg"
    ),
    "mounting.baseline": (
        "{name}: the baseline of the two antennas comes out {miss:deg|.3g} deg from the assumed one, which was taken as known to "
        "{prior:deg|.3g} deg"
    ),
    "second_look.late": "the clock of the {name} seems {size:.3f} ± {sigma:.3f} s late",
    "second_look.early": "the clock of the {name} seems {size:.3f} ± {sigma:.3f} s early",
    "second_look.arm": (
        "the lever arm of the {name} seems to be right {right:+.2f} ± {right_sigma:.2f} m, forward {forward:+.2f} ± "
        "{forward_sigma:.2f} m, up {up:+.2f} ± {up_sigma:.2f} m, not {given}"
    ),
    "second_look.scale": "the {name} seems to count {scale:%|+.2f} ± {sigma:%|.2f} %",
    "second_look.mounting": (
        "the IMU seems turned against the vehicle of the {name}, about x {x:deg|+.2f} ± {x_sigma:deg|.2f} deg, z "
        "{z:deg|+.2f} ± {z_sigma:deg|.2f} deg"
    ),
    "second_look.misfit": "the {name} fits no small scale error and mounting angle",
    "second_look.long_arm": "the lever arm of the {name} is {length:.0f} m long, and the data do not show whether it is",
    "heading.by_start": (
        "heading: no acceleration shows it. The filter says {sigma:angle}, but a start that is one sigma off moves it further: it "
        "is known as its start and its gyro leave it, {grown:angle}"
    ),
    # ---- a velocity log, for damping
    "log.contradicts": (
        "velocity log: differs from the free INS by {east:.2f} m/s east, {north:.2f} m/s north (median), {allowed:.2f} m/s is "
        "expected"
    ),
    "log.arm": "velocity log: it sits {ahead:.1f} m ahead and {right:.1f} m right of the IMU, as turns show (within {sigma:.1f} m)",
    "log.outliers": "velocity log: {count} epochs left out as outliers",
    "log.jump": (
        "velocity log: at {time:.0f} s its level jumps by {east:+.2f} m/s east, {north:+.2f} m/s north; held to the level before"
    ),
    "log.kind_unsaid": "velocity log: its kind is not said; a drift of {drift:.2g} m/s (a current) is taken for possible",
    "log.silent": "velocity log: silent for {length:.0f} s after {time:.0f} s; undamped in between",
    "log.rejected": "velocity log: {count} measurements rejected by the filter's gate",
    "log.constant": "velocity log: its drift is most likely a constant",
    "log.drifts": "velocity log: its drift of {drift:.2f} m/s most likely lasts {hours:.2g} h",
    "damping.switched": (
        "internal damping: switched off {count} times, {undamped:.0f} min in all, first at {time:.0f} s: a manoeuvre let "
        "{leak:.2f} m/s into the loop, {allowed:.2f} m/s is allowed"
    ),
    "heading.given": "heading {heading:.3f} deg ± {sigma:angle} is given",
    "feed.silent": "{name}: fewer than two rows came; it aids nothing",
    # ---- height
    "height.free": "height is carried on by velocity alone: no sensor of height is given",
    "height.fixed": "height is held fixed, as at sea",
    "height.apart": "the barometer's heights are {apart:+.0f} m off those of GNSS; one sigma of both together is {sigma:.3g} m",
    "height.either": (
        "the barometer's heights are {apart:+.0f} m off those of GNSS; one sigma of both together is {sigma:.3g} m; which of them "
        "is off is not known, and height may be off by as much"
    ),
    "height.first": (
        "the barometer's first heights are {apart:+.0f} m off the height of the start; one sigma of both together is {sigma:.3g} m"
    ),
    "height.barometer_unused": "the barometer is not used: height is {altitude!r}",
    **OF_SENSORS,
}
