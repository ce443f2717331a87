"""Programs in a process of their own each, without starting Python each time.

A child that has loaded what they need of other libraries forks for each: what crashes there ends the fork alone, and its exit
status is passed on. Truenorth itself is loaded in the fork, as far as the program asks for it.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
READER = ("scipy.io", "truenorth.formats.mat_child")
PLOTTER = ("pandas", "matplotlib.pyplot", "numba", "pyarrow.parquet", "pyarrow.csv", "pyarrow.compute", "scipy.interpolate",
           "scipy.linalg", "scipy.optimize", "scipy.spatial.transform", "scipy.special", "jinja2", "pydantic",
           "rich.console", "rich.progress", "rich.table", "typer", "yaml")  # fmt: skip


def read(path: str, largest: str) -> int:
    """What reads a MATLAB file."""
    from truenorth.formats import mat_child

    sys.argv = ["mat_child", path, largest]
    return mat_child.main()


def python(option: str, text: str, *arguments: str) -> int:
    """``python -c text``, or ``python -m truenorth ...``."""
    if option == "-c":
        exec(compile(text, "<string>", "exec"), {"__name__": "__main__"})
    else:
        from truenorth.__main__ import main

        sys.argv = [text, *arguments]
        main()
    return 0


def serve(modules: Sequence[str], work: Callable[..., int]) -> None:
    """Read requests from standard input, one a line: arguments, the folder, and the files for what is said."""
    for module in modules:
        import_module(module)
    for line in sys.stdin:
        arguments, folder, out, err = json.loads(line)
        child = os.fork()
        if child == 0:
            signal.alarm(60)
            os.chdir(folder)
            for number, name in ((1, out), (2, err)):
                os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
            os._exit(_ended(work, arguments))
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _ended(work: Callable[..., int], arguments: Sequence[str]) -> int:
    """The exit status, as Python itself would have it."""
    try:
        status: object = work(*arguments)
    except SystemExit as end:
        status = end.code
    except BaseException:
        traceback.print_exc()
        status = 1
    if isinstance(status, str):
        print(status, file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    return status if isinstance(status, int) else int(bool(status))


class Forks:
    """A function of this module, each call in a fork of a child that has loaded some modules. It starts with the first call."""

    def __init__(self, modules: Sequence[str], work: Callable[..., int]) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.modules, self.work = tuple(modules), work.__name__
        self.server: subprocess.Popen[str] | None = None

    def call(self, *arguments: str, folder: Path = ROOT) -> subprocess.CompletedProcess[bytes]:
        """Run it in a folder."""
        if self.server is None:
            program = f"from tests import forked; forked.serve({self.modules}, forked.{self.work})"
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            self.server = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, **pipes)
        assert self.server.stdin is not None
        assert self.server.stdout is not None
        out, err = (Path(self.folder.name) / name for name in ("out", "err"))
        self.server.stdin.write(json.dumps([arguments, str(folder), str(out), str(err)]) + "\n")
        self.server.stdin.flush()
        status = int(self.server.stdout.readline())
        return subprocess.CompletedProcess(arguments, status, out.read_bytes(), err.read_bytes())

    def close(self) -> None:
        """End the child."""
        if self.server is not None:
            self.server.communicate()
        self.folder.cleanup()


class Reader(Forks):
    """Stands for :mod:`subprocess` where MATLAB files are read."""

    TimeoutExpired = subprocess.TimeoutExpired

    def __init__(self) -> None:
        super().__init__(READER, read)

    def run(self, command: list[str], **options: object) -> subprocess.CompletedProcess[bytes]:
        """Run the reader with the arguments of this command."""
        return self.call(*command[-2:])
