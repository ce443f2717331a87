"""Our speed compared with the peers' in one run: ``python -m benchmarks``."""
