"""Tests. No matrix in them is large enough to share, and each of their workers has a processor, so BLAS starts no threads."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is loaded, as the program does
