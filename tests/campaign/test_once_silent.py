"""What once passed in silence, of the sizes that it had: refused, flagged, or within four of its sigmas."""

import pytest

from benchmarks.once_silent import ROWS, outcome


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.bench}: {row.name}")
def test_it_no_longer_does(row):
    assert outcome(row, 0)[0] != "SILENT"
