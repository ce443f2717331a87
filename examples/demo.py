"""The demo: simulate a SINS on a swaying ship, align its log with the ordinary command, compare with the truth."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

import truenorth
from truenorth.cli.ahead import compile_ahead
from truenorth.core.attitude import euler_from_dcm
from truenorth.simulation import Sway, Tone, simulate

FOLDER = Path("demo")
LAT, LON = 40.0, 118.0


def main() -> int:
    """Run the demo; the exit code is that of the alignment."""
    deg = np.radians
    ship = Sway(
        truenorth.Position.from_degrees(LAT, LON),
        heading=deg(330.0),
        heading_tones=(Tone(deg(5.0), 7.0, 1.05),),
        pitch_tones=(Tone(deg(7.0), 5.0, 0.79),),
        roll_tones=(Tone(deg(10.0), 6.0, 0.45),),
        east_tones=(Tone(0.02, 7.0, 0.3),),
        north_tones=(Tone(0.03, 6.0, 1.0),),
        up_tones=(Tone(0.3, 8.0, 2.0),),
        lever_arm=(1.0, 3.0, 1.0),
    )
    compile_ahead()  # the first time on a computer; the command would do it by itself, a little later
    print(
        "filters that this computer does not have yet are compiled first, some 20 s; after that the demo takes seconds"
    )
    print("simulating 600 s at 100 Hz of a navigation-grade SINS on a swaying ship ...")
    simulation = simulate(ship, rate=100.0, duration=600.0, imu=truenorth.imu_spec("navigation"), seed=1)
    log = FOLDER / "ship.csv"
    truenorth.write_imu(simulation.record, log)

    command = ["truenorth", "align", str(log), "--lat", str(LAT), "--lon", str(LON), "--imu", "navigation"]
    command += ["-o", str(FOLDER / "result")]
    print(f"$ {' '.join(command)}\n", flush=True)
    run = subprocess.run([str(Path(sys.executable).with_name("truenorth")), *command[1:]], check=False)
    if run.returncode:
        return run.returncode

    found = json.loads((FOLDER / "result" / "summary.json").read_text())
    truth = simulation.motion.states(found["time_s"])  # which the command never saw
    angles = np.degrees(np.ravel(euler_from_dcm(truth.C_nb)))
    print(f"\n{'':9}{'found':>12}{'truth':>12}{'error':>12}{'one sigma':>12}{'error/sigma':>13}   (deg)")
    for name, true in zip(("heading", "pitch", "roll"), angles, strict=True):
        value, sigma = found[f"{name}_deg"], found[f"{name}_sigma_deg"]
        error = (value - true + 180.0) % 360.0 - 180.0  # 359.9 is 0.1 off north, not 359.9
        print(f"{name:9}{value:12.4f}{true:12.4f}{error:12.4f}{sigma:12.4f}{error / sigma:13.2f}")
    print(f"\nreport: {FOLDER / 'result' / 'report.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
