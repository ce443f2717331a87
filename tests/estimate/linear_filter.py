"""A linear filter whose innovations are what one sensor measures less its mean: what asks for a course of a bias is tried on it."""

from dataclasses import replace

import numpy as np

from tests.alignment.test_suspect import track

TRACK = track(1.0, level=0.0)


def filter_of(rng, rows, sigma, measured, heading):
    """A pass of it over a record, with noise of its own, the same in each pass.

    `measured` gives what it sees (rows, 3) of a record, which has one `sigma` of noise; `heading` what its answer makes of that.
    """
    noise = rng.standard_normal((rows, 3))

    def run(record):
        seen = measured(record)
        z = noise + (seen - seen.mean(axis=0)) / sigma
        source = replace(TRACK.residuals[0], innovation=z, nis=np.sum(z**2, axis=1))
        C_nb = TRACK.C_nb.copy()
        C_nb[:, 0, 1] = heading(seen - seen.mean(axis=0))
        return replace(TRACK, residuals=(source,), C_nb=C_nb)

    return run
