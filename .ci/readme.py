"""README from top to bottom as a newcomer follows it: a fresh clone, ``make``, its two commands, its ten lines, its samples.

Nothing of this checkout but what is committed, and nothing of this environment but Python, make, git and the package registry,
is used. Run by ``.ci/full``. The lines of "Your log", which are about the reader's own logs, run on simulated ones in
``tests/documents``: six with ``make test``, those that take longer with ``make test-all``.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def run(*command: str, cwd: Path) -> None:
    """Run a command; its output is shown where it fails."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    print(f"{done.returncode} $ {shlex.join(command)[:150]}", flush=True)
    if done.returncode:
        raise SystemExit(f"{done.stdout}{done.stderr}")


def main() -> None:
    """Clone, install, and follow the page in an empty folder."""
    with tempfile.TemporaryDirectory() as name:
        clone, empty = Path(name) / "truenorth", Path(name) / "empty"
        empty.mkdir()
        run("git", "clone", "-q", str(ROOT), str(clone), cwd=Path(name))
        run("make", "-s", "demo", cwd=clone)
        blocks = BLOCK.findall((clone / "README.md").read_text(encoding="utf-8"))
        for line in "".join(code for language, code in blocks if language == "sh").splitlines():
            program, *words = shlex.split(line, comments=True)
            run(str(clone / ".venv/bin" / program), *words, cwd=empty)
        code = "\n".join(code for language, code in blocks if language == "python")
        run(str(clone / ".venv/bin/python"), "-c", code, cwd=empty)
        lines = next(code for language, code in blocks if language == "text").splitlines()
        asked = [line for line in lines if line.startswith("truenorth advise")]
        for line in asked:
            run(str(clone / ".venv/bin/truenorth"), *shlex.split(line, comments=True)[1:], cwd=empty)


if __name__ == "__main__":
    main()
