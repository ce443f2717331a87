"""The CUDA path: against the processor in Numba's simulator, and on a device where there is one."""

import os
import subprocess
import sys

import numpy as np
import pytest

from tests.filters import cuda_cases
from tests.filters.dense import random_system
from truenorth.core.errors import UsageError
from truenorth.filters import device, kalman


def has_device():
    try:
        from numba import cuda
    except ImportError:
        return False
    return cuda.is_available()


def test_in_the_simulator():
    environment = os.environ | {"NUMBA_ENABLE_CUDASIM": "1"}
    command = [sys.executable, "-m", "tests.filters.cuda_cases"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout == "as on the processor\n", done.stderr


def test_on_a_device(monkeypatch):
    if not has_device():
        pytest.skip("no CUDA device here")
    cuda_cases.check(monkeypatch)


def test_where_there_is_none_it_says_so(monkeypatch):
    system = random_system(3, 2, 4, (2,))
    with pytest.raises(UsageError, match="device is 'tpu', expected"):
        kalman(system, device="tpu")
    monkeypatch.setattr(device, "_fault", lambda n, m: "there is no CUDA device here")
    with pytest.raises(UsageError, match='device is "cuda", but there is no CUDA device here'):
        kalman(system, device="cuda")
    monkeypatch.setattr(device, "SAVED", 0)
    monkeypatch.setattr(device, "FEWEST", 1)
    assert np.array_equal(kalman(system, device="auto").x, kalman(system).x)


@pytest.mark.parametrize("missing", ["numba.cuda", "a device"])
def test_what_is_missing_is_named(missing, monkeypatch):
    if missing == "numba.cuda":
        monkeypatch.setitem(sys.modules, "numba.cuda", None)
        monkeypatch.delattr("numba.cuda", raising=False)
        said = r"numba-cuda is not installed: pip install 'truenorth\[cuda\]'"
    elif has_device():
        pytest.skip("there is a CUDA device here")
    else:
        said = "there is no CUDA device here"
    with pytest.raises(UsageError, match=said):
        kalman(random_system(3, 2, 4, (2,)), device="cuda")


def test_auto_takes_a_device_for_large_work_of_many_runs(monkeypatch):
    monkeypatch.setattr(device, "_fault", lambda n, m: "")
    few, many = (random_system(15, 3, 2, (runs,)) for runs in (2, 200))
    assert not device.on_cuda("auto", many)
    monkeypatch.setattr(device, "SAVED", 1e4)
    assert device.on_cuda("auto", many)
    assert not device.on_cuda("auto", many, workers=100)
    assert not device.on_cuda("auto", few)
    assert not device.on_cuda("cpu", many)


def test_what_stays_on_the_processor_does_not_load_it():
    program = """
import sys
from tests.filters.dense import random_system
from truenorth.filters import kalman
kalman(random_system(3, 2, 4, (2,)), device="auto")
print([name for name in sys.modules if name.startswith(("numba.cuda", "numba_cuda", "truenorth.filters.cuda"))])
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout == "[]\n", done.stderr
