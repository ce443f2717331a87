"""Messages of the library name parameters of Python, between backticks; here they become the command line's options."""

from __future__ import annotations

import re

# What a message of the library names, and what a person at the command line types for it.
OPTIONS = {
    "Barometer(record)": "--baro FILE",
    "Gnss(record)": "--gnss FILE",
    "Positions()": "--positions auto",
    "alt": "--alt",
    "altitude": "--altitude",
    "at": "--at",
    "axes": "--axes",
    "horizontal_sigma": "--position-sigma",
    "lat": "--lat",
    "lon": "--lon",
    "mounting.latency": "--delay",
    "place": "--lat, --lon, --alt",
    "rate": "--rate",
    "replace=True": "--force",
    "record.between": "--from, --to",
    "record.shifted": "--offset",
    "resume=False": "--no-resume",
    "scheduler": "--scheduler",
    "units": "--units",
    "vertical_sigma": "--position-sigma",
    "workers": "--workers",
}


def in_options(text: str) -> str:
    """A message with options where the library names parameters; a parameter without an option stays as it is."""
    return re.sub(r"`([\w.=()]+)`", lambda found: OPTIONS.get(found[1], found[0]), text)
