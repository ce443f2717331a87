"""The reader of MATLAB files in a process of its own for each file, as the program has it, without starting Python each time.

A child that has imported SciPy forks for each file: what crashes there ends the fork alone, and its exit status is passed on.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from truenorth.formats import mat_child

ROOT = Path(__file__).resolve().parents[2]


def serve() -> None:
    """Read requests from standard input, one a line: the arguments of the reader, and the files for what it says."""
    from scipy.io import loadmat, whosmat  # noqa: F401  # imported once

    for line in sys.stdin:
        arguments, out, err = json.loads(line)
        child = os.fork()
        if child == 0:
            signal.alarm(60)
            for number, name in ((1, out), (2, err)):
                os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
            sys.argv = ["mat_child", *arguments]
            code = mat_child.main()
            sys.stdout.flush()
            os._exit(code)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


class Reader:
    """Stands for :mod:`subprocess` where the reader is run."""

    TimeoutExpired = subprocess.TimeoutExpired

    def __init__(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.server: subprocess.Popen[str] | None = None  # until the first file

    def run(self, command: list[str], **options: object) -> subprocess.CompletedProcess[bytes]:
        """Run the reader with the arguments of this command."""
        out, err = (Path(self.folder.name) / name for name in ("out", "err"))
        if self.server is None:
            serving = [sys.executable, "-c", "from tests.fuzz.forked import serve; serve()"]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            self.server = subprocess.Popen(serving, cwd=ROOT, **pipes)
        assert self.server.stdin is not None
        assert self.server.stdout is not None
        self.server.stdin.write(json.dumps([command[-2:], str(out), str(err)]) + "\n")
        self.server.stdin.flush()
        code = int(self.server.stdout.readline())
        return subprocess.CompletedProcess(command, code, out.read_bytes(), err.read_bytes())

    def close(self) -> None:
        """End the child."""
        if self.server is not None:
            self.server.communicate()
        self.folder.cleanup()
