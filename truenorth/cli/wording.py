"""Messages of the library name Python; here what they name becomes the command line's options."""

from __future__ import annotations

import re

# What the library writes, and what a person at the command line types for it.
OPTIONS = (
    (r"expected an aid Barometer\(record\)", "expected --baro FILE"),
    (r"expected an aid Gnss\(record\) with heights", "expected --gnss FILE with a column of heights"),
    (r"for its heights altitude 'baro'", "for its heights --altitude baro"),
    (r"shift the aiding log onto the IMU's", "bring the aiding log onto the IMU's with --offset SECONDS"),
    (r"(latitude .* north positive)$", r"\1: check --lat"),
    (r"(longitude .* east positive)$", r"\1: check --lon"),
    (r"(height .* metres between -12000 and 50000)$", r"\1: check --alt"),
)


def in_options(text: str) -> str:
    """The message with options where the library names parameters and classes."""
    for python, option in OPTIONS:
        text = re.sub(python, option, text)
    return text
