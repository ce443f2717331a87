"""Where a command ends too early: an interrupt, or an error that nobody foresaw."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests import test_cli
from tests.helpers import run_command

ROOT = Path(__file__).parents[1]
WHERE, log, start = test_cli.WHERE, test_cli.log, test_cli.start


def test_an_interrupt_is_exit_code_130_and_no_half_result(log, tmp_path):
    """Interrupted as the report is made: one line, no traceback, none of the three files."""
    code = (
        "import os, signal, sys, truenorth.report.page as page\n"
        "page.alignment_page = lambda result: os.kill(os.getpid(), signal.SIGINT)\n"
        "from truenorth.cli import main; main()"
    )
    command = [sys.executable, "-c", code, "align", str(log), *WHERE, "-o", str(tmp_path / "result")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr.strip() == "truenorth: interrupted; nothing half-written is left"
    assert list((tmp_path / "result").iterdir()) == []


@pytest.mark.slow
def test_an_unexpected_error_is_one_line_and_its_traceback_is_in_a_file(log, tmp_path):
    code = (
        "import truenorth.alignment as a\n"
        "def broken(*args, **kwargs): raise ZeroDivisionError('a bug of ours')\n"
        "a.align = broken\n"
        "from truenorth.__main__ import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "align", str(log), *WHERE],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    )
    assert done.returncode == 70
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("truenorth: internal error: ZeroDivisionError: a bug of ours")
    (details,) = tmp_path.iterdir()
    assert str(details) in done.stderr
    assert "Traceback" in details.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("moment", [0.0, 0.03, 0.1, 0.3, 0.6])
def test_an_interrupt_at_the_start_is_one_line_too(log, moment):
    code = "from truenorth.__main__ import main; print('Python has started', flush=True); main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "align", str(log), *WHERE],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline()
    time.sleep(0.01 + moment)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert "Traceback" not in err
    assert process.returncode in (130, -signal.SIGINT, 0)


def test_interrupted_writing_leaves_nothing(tmp_path, monkeypatch):
    """A full disk half way through, and a kill at any moment: the target is whole or not there."""
    from truenorth.core.atomic import atomic_path
    from truenorth.core.errors import UsageError

    target = tmp_path / "result.csv"

    def half_a_file() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(UsageError, match=r"result\.csv"):
        half_a_file()
    assert list(tmp_path.iterdir()) == []
    code = (
        "import os, signal\nfrom truenorth.core.atomic import atomic_path\n"
        f"with atomic_path({str(target)!r}) as path:\n    path.write_text('half')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, env=dict(os.environ))
    assert done.returncode == -9
    assert not target.exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Unable to allocate 7.45 GiB for an array with shape (1000000000,)", "asked for 7.45 GiB of memory"),
        ("Unable to allocate 824. MiB for an array with shape (108000000,)", "asked for 824 MiB of memory"),
        ("malloc of size 8589934592 failed", "asked for 8 GiB of memory"),
        ("", "needs more memory than is free"),
    ],
)
def test_short_memory_is_one_message_and_no_defect_of_ours(capsys, monkeypatch, tmp_path, text, said):
    def greedy(*_args, **_options):
        raise MemoryError(text)

    monkeypatch.setattr("truenorth.simulation.folder.save_run", greedy)
    code, out = run_command(capsys, monkeypatch, "simulate", "static_kalman", "-o", str(tmp_path))
    assert code == 3
    assert out.err.startswith(f"truenorth: `simulate` {said}")
    assert out.err.endswith("free memory\n")
    code, out = run_command(capsys, monkeypatch, "--lang", "zh", "simulate", "static_kalman", "-o", str(tmp_path))
    assert code == 3
    assert "内存" in out.err


def test_an_interrupt_that_python_loses_comes_again():
    """In a finaliser nothing can be raised: the hook sends the interrupt once more, outside of itself."""
    code = (
        "import sys, time, types, truenorth.__main__ as program\n"
        "class Late:\n    def __del__(self):\n        raise KeyboardInterrupt\n"
        "def run():\n    late = Late()\n    del late\n    for _ in range(200):\n        time.sleep(0.05)\n"
        "sys.modules['truenorth.cli'] = types.SimpleNamespace(main=run)\n"
        "program.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=15, check=False)
    assert done.returncode == 130
    assert done.stderr == "truenorth: interrupted; nothing half-written is left\n"


def test_little_is_loaded_before_an_interrupt_is_answered():
    """Until `main` runs an interrupt ends in Python's own traceback: before it nothing slow is loaded."""
    code = "import sys; before = set(sys.modules); import truenorth.__main__; print(*sorted(set(sys.modules) - before))"
    bare = [sys.executable, "-S", "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r}); {code}"]
    done = subprocess.run(bare, capture_output=True, text=True, check=True)
    ours = {"truenorth", "truenorth.__main__", "truenorth.core", "truenorth.core.lazy", "truenorth.core.version"}
    light = {
        "__future__",
        "importlib",
        "importlib._bootstrap",
        "importlib._bootstrap_external",
        "_warnings",
        "warnings",
    }
    loaded = set(done.stdout.split())
    assert ours <= loaded
    assert loaded - ours <= light
