"""Logs in dialects drawn at random: names, units, what is said of them, separators, clocks, orders, remarks, precision."""

from __future__ import annotations

import numpy as np

from tests.formats.corpus.dialects import DEG, EPOCH, FRD, G, Log, iso, table
from tests.formats.corpus.truth import truth

GYRO = {"rad/s": 1.0, "deg/s": DEG, "mdps": 1e-3 * DEG, "deg/h": DEG / 3600.0, "mrad/s": 1e-3}
ACCEL = {"m/s^2": 1.0, "g": G, "mg": 1e-3 * G}
CLOCK = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
# Names of the clock, and of x, y and z of gyros and accelerometers.
NAMES = (
    ("time", "gyro_{}", "accel_{}"),
    ("t", "w{}", "a{}"),
    ("Time", "Gyro{}", "Acc{}"),
    ("timestamp", "Gyr_{}", "Acc_{}"),
    ("t", "omega_{}", "f_{}"),
    ("TIME", "GYRO_{}", "ACCEL_{}"),
    ("time", "angular_velocity.{}", "linear_acceleration.{}"),
    ("time", "g{}", "a{}"),
    ("Timestamp", "AngularVelocity{}", "LinearAcceleration{}"),
    ("sec", "{}_rate", "{}_accel"),
)
INCREMENTS = (
    ("time", "dtheta_{}", "dvel_{}"),
    ("t", "delta_angle_{}", "delta_velocity_{}"),
    ("t", "g{}", "a{}"),
    ("t", "dang{}", "dv{}"),
)
SAID = ("{} [{}]", "{} ({})", "{}({})", "{}_{}")
SUFFIXES = {"rad/s": "rads", "deg/s": "dps", "m/s^2": "mps2", "mrad/s": "", "deg/h": "dph"}
REMARKS = (
    "",
    "# recorded by hand",
    "// device: unit 7\n// rate as configured",
    "% a remark\n% another",
    "Logger 3000\nSerial: 42\n",
)


def drawn(seed: int) -> Log:
    """A log; its truth is in SI, right-forward-up."""
    rng = np.random.default_rng(seed)
    pick = lambda *choices: choices[rng.integers(len(choices))]  # noqa: E731
    rate = float(pick(20.0, 50.0, 100.0, 125.0, 200.0))
    base, grade = pick("still", "swaying", "driven"), pick("navigation", "tactical", "consumer")
    made = truth(base, grade, rate, 20.0)
    increments = bool(rng.random() < 0.25)
    values = made.increments if increments else made
    gyro, accel, clock = pick(*GYRO), pick(*ACCEL), pick(*CLOCK)
    if increments:
        gyro, accel = pick("rad/s", "deg/s"), "m/s^2"
    axes = FRD if rng.random() < 0.2 else None
    sep, decimal = pick(*[(",", ".")] * 4, (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."))
    header, order, extra = "", "", None
    has_time, stamped = rng.random() < 0.9, rng.random() < 0.1
    epoch = EPOCH if rng.random() < 0.3 else 0.0
    if rng.random() < 0.85:
        time, *sensors = INCREMENTS[rng.integers(len(INCREMENTS))] if increments else NAMES[rng.integers(len(NAMES))]
        upper = rng.random() < 0.3
        cells = {"t": [time], "g": [], "a": []}
        units = rng.random() < 0.5 and not increments
        form = pick(*(SAID[3:] if sep == " " else SAID))
        for key, name, unit in zip("ga", sensors, (gyro, accel)):
            said = SUFFIXES.get(unit, unit) if form == "{}_{}" else unit
            for axis in "XYZ" if upper else "xyz":
                named = name.format(axis)
                cells[key].append(form.format(named, said) if units and said else named)
        if units and not stamped:
            cells["t"] = [form.format(time, clock)]
    else:
        cells = {"t": [], "g": [], "a": []}
    order = pick("tga", "tag", "tga", "gat") if has_time else pick("ga", "ag")
    start = epoch
    if stamped and has_time:
        order, extra, start = order.replace("t", "e"), iso(made, pick("", "Z")), 1709632800.0
    named = bool(cells["g"])
    if named:
        header = sep.join(name for key in order for name in cells["t" if key == "e" else key])
        if rng.random() < 0.15:
            order, header = "n" + order, sep.join(["counter", header])
    content = table(
        values, header, gyro=GYRO[gyro], accel=ACCEL[accel], time=CLOCK[clock], start=0.0 if start > 1.7e9 and stamped else epoch,
        sep=sep, decimal=decimal, order=order, axes=axes, above=pick(*REMARKS) if named else "", extra=extra,
        fmt=pick("%.9g", "%.9g", "%.7g", "%.6e"), end=pick("\n", "\r\n"),
    )  # fmt: skip
    words = f"{seed}_{base}_{grade}_{rate:g}_{'inc' if increments else 'rates'}_{gyro}_{accel}_{clock}_{'FRD' if axes else 'RFU'}"
    answer = {
        "units": {"gyro": gyro.removesuffix("/s") if increments else gyro, "accel": "m/s" if increments else accel},
        "kind": "increments" if increments else "rates",
        "axes": "FRD" if axes else "RFU",
    }
    if not named:
        sensors = {"g": "dtheta", "a": "dvel"} if increments else {"g": "gyro", "a": "accel"}
        ours = [
            name for key in order for name in ([f"{sensors[key]}_{x}" for x in "xyz"] if key in sensors else ["time"])
        ]
        answer["columns"] = {name: str(i) for i, name in enumerate(ours, 1)}
    if has_time and not stamped:
        answer["units"]["time"] = clock
    if not has_time:
        answer["rate"] = rate
    shift = (start if stamped else epoch) if has_time else 0.0
    name = words.replace("/", "p").replace("^", "") + ".csv"
    return Log(name, lambda path: path.write_bytes(content.encode()), values, answer, shift=shift)
