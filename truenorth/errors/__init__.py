"""Error states: those of the INS itself and groups that come on top, each written once."""
