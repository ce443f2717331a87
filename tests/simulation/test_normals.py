"""Normal random numbers in bulk: NumPy's own, to the bit."""

import numpy as np
import pytest

from truenorth.simulation.normals import BLOCK, Normals, draw, first_normals, normals_at, normals_of, words_of
from truenorth.simulation.streams import stream


def numbers(normals: Normals, count: int) -> np.ndarray:
    out = np.empty(count)
    draw(normals, out)
    return out


@pytest.mark.parametrize("seed", [0, 7])
def test_they_are_those_of_the_generator(seed):
    """A million: 12,000 go the long way, 270 of them beyond the last layer."""
    found = numbers(normals_of(np.random.default_rng(seed)), 10**6)
    np.testing.assert_array_equal(found, np.random.default_rng(seed).standard_normal(10**6))
    assert np.sum(np.abs(found) > 3.6541528853610088) > 200


def test_the_pieces_in_which_they_are_drawn_do_not_matter():
    rng = np.random.default_rng(3)
    sizes = [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3, *rng.integers(0, 3 * BLOCK, 200)]
    normals = normals_of(np.random.default_rng(4))
    found = np.concatenate([numbers(normals, size) for size in sizes])
    np.testing.assert_array_equal(found, np.random.default_rng(4).standard_normal(len(found)))


@pytest.mark.parametrize("count", [0, 1, BLOCK, 5000])
def test_the_generator_can_go_on_behind_them(count):
    rng, other = np.random.default_rng(5), np.random.default_rng(5)
    normals = normals_of(rng)
    numbers(normals, count)
    rng.bit_generator.advance(words_of(normals))
    other.standard_normal(count)
    assert rng.bit_generator.state == other.bit_generator.state


@pytest.mark.parametrize(
    "numbers_of_stream", [(0, 0, 0, 0), (7, 3, 999, 14), (2**32 - 1, 2**32, 1, 2), (2**150 + 9, 2**40 + 7, 2**32, 3)]
)
def test_a_stream_begins_as_numpy_begins_it(numbers_of_stream):
    found, expected = normals_at(*numbers_of_stream), normals_of(stream(*numbers_of_stream))
    assert np.array_equal(found.state, expected.state)
    assert np.array_equal(found.factors, expected.factors)
    *key, last = numbers_of_stream
    first = [stream(*key, number).standard_normal(300) for number in (last, last + 1)]
    assert np.array_equal(first_normals(300, [last, last + 1], *key), first)


def test_a_stream_has_no_negative_numbers():
    with pytest.raises(ValueError, match="negative"):
        normals_at(0, 0, -1, 2)
