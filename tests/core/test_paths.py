"""Paths that callers give."""

import pytest

from truenorth.core.errors import UsageError
from truenorth.formats import read_imu


def test_a_file_that_is_not_there_names_the_one_that_may_be_meant(tmp_path):
    (tmp_path / "log.csv").write_text("time\n")
    with pytest.raises(UsageError, match=r"lgo.csv: cannot be read .*; log.csv is there: was it meant\?"):
        read_imu(tmp_path / "lgo.csv")
    with pytest.raises(UsageError, match=r"cannot be read \([^;]*\)$"):
        read_imu(tmp_path / "quite_another.bin")
