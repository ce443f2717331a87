"""The faults campaign asked of an earlier version of the program, on the same spoilt logs.

```
python benchmarks/faults_before.py write before/inputs --runs 2 --seed 3          # this version: draws and spoils
PYTHONPATH=../old python benchmarks/faults_before.py answer before/inputs         # the earlier one: aligns and navigates
python benchmarks/faults_before.py judge before/inputs before/trials.csv          # this version: judges by the truth
truenorth faults --runs 2 --seed 3 -o now --before before/trials.csv
```

Inputs and answers are plain arrays on disk. The middle step imports nothing of the campaign, and asks the procedures by the names
that they had (commit 2416601). What that version cannot be asked stays without a row.
"""

from __future__ import annotations

import argparse
import dataclasses
import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

LEFT_OUT = ("late", "taken_for", "notes", "source")


def plain(value: Any) -> Any:
    """A record as a mapping of its fields."""
    if dataclasses.is_dataclass(value):
        fields = [f.name for f in dataclasses.fields(value) if f.name not in LEFT_OUT]
        return {name: plain(getattr(value, name)) for name in fields}
    return value


def write(folder: Path, runs: int, seed: int, procedures: list[str]) -> None:
    """Spoilt inputs of each trial."""
    from zlib import crc32

    from truenorth.campaign.fault_benches import BENCHES
    from truenorth.campaign.faults import faults_of
    from truenorth.core.errors import TruenorthError

    folder.mkdir(parents=True, exist_ok=True)
    for name in procedures or BENCHES:
        for run in range(runs):
            inputs, _ = BENCHES[name].draw(seed, run)
            cases = [("none", "", inputs)]
            for fault in faults_of(inputs):
                rng = np.random.default_rng([seed, run, crc32(f"{name} {fault.name}".encode())])
                try:
                    spoilt, size = fault.apply(inputs, rng)
                except TruenorthError:
                    continue
                cases.append((fault.name, size, spoilt))
            for number, (fault_name, size, spoilt) in enumerate(cases):
                spec = spoilt.get("imu")
                kept = {key: plain(value) for key, value in spoilt.items() if key not in ("attitude", "imu")}
                kept |= {"imu": None if spec is None else spec.to_mapping()}
                case = {"procedure": name, "fault": fault_name, "seed": seed, "run": run, "size": size, "inputs": kept}
                (folder / f"{name}-{run}-{number:02d}.in").write_bytes(pickle.dumps(case))


def answer(folder: Path) -> None:
    """What the version on the path says to each."""
    for path in sorted(folder.glob("*.in")):
        out = path.with_suffix(".out")
        if not out.exists():
            case = pickle.loads(path.read_bytes())
            out.write_bytes(pickle.dumps(_asked(case["procedure"], case["inputs"])))


def _asked(procedure: str, given: dict[str, Any]) -> dict[str, Any]:
    from truenorth.errors import TruenorthError

    try:
        found = _result(procedure, given)
    except TruenorthError as error:
        return {"outcome": "refused", "reason": str(error)}
    except Exception as error:
        return {"outcome": "crash", "reason": f"{type(error).__name__}: {error}"}
    said = {"status": found.status, "reasons": list(found.reasons)}
    if procedure == "navigate":
        t = found.track
        last = {"time": float(t.time[-1]), "C_nb": t.C_nb[-1], "v_n": t.v_n[-1], "position": t.position[-1]}
        return said | last | {"sigma": t.sigma[-1, :9], "altitude": found.altitude}
    return said | {
        "time": found.time,
        "C_nb": found.C_nb,
        "phi_covariance": found.phi_covariance,
        "heading_known": found.heading_known,
    }


def _result(procedure: str, given: dict[str, Any]) -> Any:
    """By the earlier version's own names."""
    import truenorth as tn
    from truenorth.navigation import Mounting
    from truenorth.navigation.start import Start
    from truenorth.records import EncoderRecord

    def made(cls: Any, key: str) -> Any:
        names = {f.name for f in dataclasses.fields(cls)}
        return cls(**{name: value for name, value in given[key].items() if name in names})

    record, imu = made(tn.ImuRecord, "record"), given["imu"]
    place = made(tn.Position, "place") if "place" in given else None
    mounting = made(Mounting, "mounting") if "mounting" in given else None
    if procedure in ("still", "unspecified", "swaying"):
        return tn.align(record, place, imu)
    if procedure == "rotary":
        arm = given["mounting"]["lever_arm"]
        return tn.align_rotary(record, made(EncoderRecord, "encoder"), place, imu, lever_arm=arm if arm.any() else None)
    if procedure == "odometer":
        return tn.align_in_motion(
            record, imu, odometer=made(tn.OdometerRecord, "odometer"), position=place, wheel=mounting
        )
    if procedure == "gnss":
        return tn.align_in_motion(record, imu, gnss=made(tn.GnssRecord, "gnss"), position=place, antenna=mounting)
    if procedure == "navigate":
        start, spec = made(Start, "start"), tn.imu_spec(imu)
        return tn.navigate(record, start, imu=spec, gnss=made(tn.GnssRecord, "gnss"), antenna=mounting)
    matching = "velocity" if procedure == "transfer" else "both"
    from scipy.spatial.transform import Rotation

    heading = -Rotation.from_matrix(given["mounting"]["C_mb"]).as_rotvec()[2]
    return tn.align_transfer(
        record,
        made(tn.MasterRecord, "master"),
        imu,
        matching=matching,
        lever_arm=tuple(-given["mounting"]["lever_arm"]),
        mounting=(heading, 0.0, 0.0),
    )


def judge(folder: Path, into: Path) -> None:
    """Trials, as the campaign counts them."""
    from truenorth.campaign.fault_benches import BENCHES, misses
    from truenorth.campaign.fault_pages import keeper
    from truenorth.campaign.faults import GOOD, HARMLESS, OF_THE_FAULT, Trial, unseen

    into.parent.mkdir(parents=True, exist_ok=True)
    keep = keeper(into, [])
    truths: dict[tuple[str, int], Any] = {}
    sound: dict[tuple[str, int], Any] = {}
    for path in sorted(folder.glob("*.in")):
        if not path.with_suffix(".out").exists():
            continue
        case, said = pickle.loads(path.read_bytes()), pickle.loads(path.with_suffix(".out").read_bytes())
        name, run = case["procedure"], case["run"]
        about = (name, case["fault"], case["seed"], run, case["size"])
        if "outcome" in said:
            keep(Trial(*about, said["outcome"], float("nan"), said["reason"]))
            continue
        if (name, run) not in truths:
            truths[name, run] = BENCHES[name].draw(case["seed"], run)[1]
        off = misses(_shaped(said), truths[name, run])
        if case["fault"] == "none":
            sound[name, run] = off
        worst = max(float(np.abs(x).max()) for x in off.values())
        before = sound.get((name, run), {})
        blamed = any(
            np.any((np.abs(x) > HARMLESS) & (np.abs(x - before.get(key, 0.0)) > OF_THE_FAULT)) for key, x in off.items()
        )
        if said["status"] not in GOOD or any(reason.startswith("warning") for reason in said["reasons"]):
            outcome = "flagged"
        elif not blamed:
            outcome = "harmless"
        else:
            outcome = "silent" if unseen(name, case["fault"], case["size"]) is None else "unseen"
        keep(Trial(*about, outcome, worst, said["reasons"][0] if said["reasons"] else ""))  # type: ignore[arg-type]


def _shaped(said: dict[str, Any]) -> Any:
    """An answer with the names that the campaign looks at."""
    if "sigma" not in said:
        return SimpleNamespace(**said)
    from truenorth.navigation.result import Navigation

    found = object.__new__(Navigation)
    track = {key: np.asarray(said[key])[None] for key in ("time", "C_nb", "v_n", "position", "sigma")}
    object.__setattr__(found, "track", SimpleNamespace(**track))
    object.__setattr__(found, "altitude", said["altitude"])
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=("write", "answer", "judge"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("into", type=Path, nargs="?")
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--procedure", action="append", default=[])
    arguments = parser.parse_args()
    if arguments.step == "write":
        write(arguments.folder, arguments.runs, arguments.seed, arguments.procedure)
    elif arguments.step == "answer":
        answer(arguments.folder)
    else:
        judge(arguments.folder, arguments.into)
