"""Error models: each is written once, and any filter runs on it."""
