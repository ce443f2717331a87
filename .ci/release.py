"""Build the sdist and the wheel, install the wheel into clean environments, and use it there.

Each Python from 3.11 to 3.13 that this machine has gets an environment of its own; one that is missing is named and
skipped. The wheel is installed as a user installs it, with what its own requirements name and nothing else, and is
used from a folder that is not the repository. Run by ``make release``.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MINORS = (11, 12, 13)
REQUIRED = (
    "truenorth/py.typed",
    "truenorth/report/templates/alignment.html",
    "truenorth/simulation/scenarios/quay.yaml",
)
FORBIDDEN = ("tests/", "docs/", "examples/", "benchmarks/")  # as roots: they would land among other packages

STILL = """\
name: still
duration: 120 s
rate: 50 Hz
position: {lat: 45 deg, lon: 0 deg}
motion: {kind: rest}
imu: navigation
"""


def build(folder: Path) -> tuple[Path, Path]:
    """Wheel and sdist, and a second wheel out of the sdist: all three hold the same package."""
    run(sys.executable, "-m", "hatchling", "build", "-d", str(folder), cwd=ROOT)
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as unpacked:
        with tarfile.open(sdist) as archive:
            archive.extractall(unpacked, filter="data")
        (source,) = Path(unpacked).iterdir()
        run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder / "again"), cwd=source)
    (again,) = (folder / "again").glob("*.whl")
    names, names_again = (set(zipfile.ZipFile(path).namelist()) for path in (wheel, again))
    if names != names_again:
        raise SystemExit(f"the wheel of the sdist differs: {sorted(names ^ names_again)}")
    if missing := set(REQUIRED) - names:
        raise SystemExit(f"the wheel lacks {sorted(missing)}")
    if stray := sorted(name for name in names if name.startswith(FORBIDDEN)):
        raise SystemExit(f"the wheel holds what is no package: {stray[:5]}")
    return wheel, sdist


def interpreter(minor: int) -> str | None:
    """A Python 3.`minor` that runs, from the search path or from pyenv's versions."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = [shutil.which(f"python3.{minor}"), *map(str, sorted(versions.glob(f"3.{minor}.*/bin/python")))]
    for path in filter(None, found):
        said = subprocess.run(
            [path, "-c", "import sys, venv; print(sys.version_info[1])"], capture_output=True, text=True, check=False
        )
        if said.stdout.strip() == str(minor):
            return path
    return None


def try_out(wheel: Path, python: str, folder: Path) -> str:
    """Install into a clean environment and go from a scenario to a heading there; the size of the environment."""
    uv = str(Path(sys.executable).with_name("uv"))
    home = folder / "env"
    run(uv, "venv", "-q", "--python", python, str(home))
    run(uv, "pip", "install", "-q", "--python", str(home / "bin/python"), str(wheel))
    run(uv, "pip", "check", "-q", "--python", str(home / "bin/python"))
    program = str(home / "bin" / "truenorth")
    (folder / "still.yaml").write_text(STILL, encoding="utf-8")
    run(program, "--version", cwd=folder)
    run(program, "simulate", "still.yaml", "--csv", "--no-plot", "-o", "still", cwd=folder)
    run(program, "align", "still/imu.csv", "--lat", "45", "--imu", "navigation", "-o", "result", cwd=folder)
    answer = json.loads((folder / "result" / "summary.json").read_text(encoding="utf-8"))
    if answer["status"] != "aligned" or not (folder / "result" / "report.html").exists():
        raise SystemExit(f"the installed program says {answer['status']}: {answer['reasons']}")
    size = sum(path.stat().st_size for path in home.rglob("*") if path.is_file() and not path.is_symlink())
    return f"{size / 1e6:.0f} MB installed"


def run(*command: str, cwd: Path | None = None) -> None:
    """Run a command; its output is shown where it fails."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"$ {' '.join(command)}\n{done.stdout}{done.stderr}\nexit code {done.returncode}")


def main() -> None:
    """Build once; try the wheel on each Python that there is."""
    dist = ROOT / "dist"
    shutil.rmtree(dist, ignore_errors=True)
    wheel, sdist = build(dist)
    print(f"built {wheel.name} ({wheel.stat().st_size / 1e3:.0f} kB) and {sdist.name}")
    shutil.rmtree(dist / "again")
    tried = 0
    for minor in MINORS:
        python = interpreter(minor)
        if python is None:
            print(f"Python 3.{minor}: SKIPPED, this machine has none")
            continue
        with tempfile.TemporaryDirectory() as folder:
            print(f"Python 3.{minor}: aligned from the wheel, {try_out(wheel, python, Path(folder))}", flush=True)
        tried += 1
    if not tried:
        raise SystemExit("no Python to try the wheel on")


if __name__ == "__main__":
    main()
