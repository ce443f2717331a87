"""The lines of a text's head, divided without dividing all of it."""

from __future__ import annotations

import numpy as np
import pytest

from truenorth.formats import text


@pytest.mark.parametrize("longest", [3, 7, 1 << 22])
def test_lines_are_divided_as_python_divides_them(longest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "LONGEST_HEAD", longest)
    rng = np.random.default_rng(longest)
    for _ in range(2000):
        whole = bytes(rng.choice(list(b"a1,\r\n\n \x0b\x0c\x85"), size=rng.integers(14)).tolist())
        wanted, found = whole[:longest].splitlines(), [line[1] for line in text._lines(whole)]
        assert found in (wanted, [*wanted, b""])
        kept = whole[:longest].splitlines(keepends=True)
        assert [line[0] for line in text._lines(whole)][: len(kept)] == kept
