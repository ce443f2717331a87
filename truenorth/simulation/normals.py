"""Normal random numbers by the hundred: those of NumPy's ``Generator(PCG64).standard_normal``, to the bit, in half the time.

The generator multiplies a state of 128 bits at each step, and each step waits for the one before. But k steps ahead the state is
``A_k s + C_k`` modulo 2^128 with known factors, so that the words of a block are worked out at once, in vectors. The ziggurat
makes a number of 98.8 % of them by one product; the others take the long way.

Sources: M. O'Neill, "PCG: a family of simple fast space-efficient statistically good algorithms for random number generation",
HMC-CS-2014-0905 (2014), XSL-RR 128/64; F. Brown, "Random number generation with arbitrary strides", Trans. Am. Nucl. Soc. 71
(1994); G. Marsaglia and W. Tsang, "The ziggurat method for generating random variables", J. Stat. Softw. 5(8) (2000), in the
layers and the order of draws of NumPy; M. O'Neill, "Developing a seed_seq alternative" (2015), for the first state.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from operator import index
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.numba_part import numba_part

Words = NDArray[np.uint64]

BLOCK = 256  # words at once
MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645
MODULUS = 1 << 128
SIGNED = 512  # layers of the ziggurat, with the sign as the ninth bit
TO_ONE = 2.0**-53
# Of NumPy's SeedSequence: first hash and factor of what goes in and of what comes out, and the factors by which words are mixed.
INTO, INTO_BY, OUT, OUT_BY, LEFT, RIGHT = 0x43B0D7E5, 0x931E8875, 0x8B51F9DD, 0x58F38DED, 0xCA01F9DD, 0x4973F715
POOL = 4  # words


class Normals(NamedTuple):
    """A stream of normal random numbers inside kernels; see :func:`normals_of`.

    Attributes
    ----------
    state : (2,) array
        High and low half, at the first word of the next block.
    factors : (4, BLOCK + 1) array
        ``A_k`` and ``C_k``, high and low halves.
    words : (BLOCK,) array
        Of this block.
    at : (2,) array
        Place of the next word, and blocks so far.
    scale, most : (512,) arrays
        Of each layer and sign: what a word's 52 bits are multiplied by, and below which of them the quick way goes.
    height : (256,) array
        Of each layer, the density.
    tail : (2,) array
        Where the last layer ends, and one over it.
    """

    state: Words
    factors: Words
    words: Words
    at: NDArray[np.int64]
    scale: NDArray[np.float64]
    most: NDArray[np.int64]
    height: NDArray[np.float64]
    tail: NDArray[np.float64]


def normals_of(rng: np.random.Generator) -> Normals:
    """The numbers that a generator (of PCG64) would give next; it does not go on itself."""
    found = rng.bit_generator.state["state"]
    now, step = found["state"], found["inc"]
    # A word is made of the state behind a step.
    state, increment = _halves((now * MULTIPLIER + step) % MODULUS), _halves(step)
    ahead, scale, most, height, tail = _tables()
    factors = np.concatenate([ahead, np.zeros_like(ahead)])
    _begin(increment, factors)
    return Normals(state, factors, np.empty(BLOCK, dtype=np.uint64), np.array([BLOCK, 0]), scale, most, height, tail)


def normals_at(seed: int, *key: int) -> Normals:
    """The numbers of :func:`truenorth.simulation.streams.stream`, which takes five times as long to begin."""
    ahead, scale, most, height, tail = _tables()
    state, factors = np.empty(2, dtype=np.uint64), np.empty((4, BLOCK + 1), dtype=np.uint64)
    _start(np.array(_key_of(seed, *key), dtype=np.uint64), ahead, state, factors)
    return Normals(state, factors, np.empty(BLOCK, dtype=np.uint64), np.array([BLOCK, 0]), scale, most, height, tail)


def first_normals(count: int, streams: Sequence[int], seed: int, *key: int) -> NDArray[np.float64]:
    """So many first numbers (S, count) of each of several streams, whose keys end in these numbers of one word."""
    words = np.array([_key_of(seed, *key, number) for number in streams], dtype=np.uint64)
    found = np.empty((len(streams), count))
    _draw_first(words, *_tables(), found)
    return found


def _key_of(seed: int, *key: int) -> list[int]:
    """Words of 32 bits of all numbers, those of the seed four at least."""
    words = [*_words_of(seed)]
    words += [0] * (POOL - len(words))
    for number in key:
        words += _words_of(number)
    return words


@lru_cache(maxsize=256, typed=True)
def _words_of(number: int) -> tuple[int, ...]:
    """Of 32 bits each, the lowest first."""
    left = index(number)
    if left < 0:
        raise ValueError(f"seed or number of a stream {number}; expected none that is negative")
    words = [left & 0xFFFFFFFF]
    while left := left >> 32:
        words.append(left & 0xFFFFFFFF)
    return tuple(words)


def _halves(x: int) -> Words:
    return np.array(divmod(x, 1 << 64), dtype=np.uint64)


def words_of(normals: Normals) -> int:
    """How many words a stream has used."""
    return int((normals.at[1] - 1) * BLOCK + normals.at[0])


@cache
def _tables() -> tuple[Words, NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """``A_k``, and the tables of the ziggurat, as Numba has them of NumPy."""
    tables = numba_part("np.random._constants")
    factor, ahead = 1, np.empty((2, BLOCK + 1), dtype=np.uint64)
    for k in range(BLOCK + 1):
        ahead[:, k] = _halves(factor)
        factor = factor * MULTIPLIER % MODULUS
    scale = np.concatenate([tables.wi_double, -tables.wi_double])
    most = np.concatenate([tables.ki_double, tables.ki_double]).astype(np.int64)
    tail = np.array([tables.ziggurat_nor_r, tables.ziggurat_nor_inv_r])
    return ahead, scale, most, np.array(tables.fi_double), tail


@compiled
def _start(words: Any, ahead: Any, state: Any, factors: Any) -> None:
    """State at the first word and factors, from words of 32 bits: NumPy's ``PCG64(SeedSequence(..))`` behind its first step."""
    half, quarter, by = np.uint64(16), np.uint64(0xFFFFFFFF), np.uint64(INTO)
    pool = np.zeros(POOL, dtype=np.uint64)
    for i in range(POOL):
        pool[i], by = _hashed(words[i], by, np.uint64(INTO_BY))
    for i in range(len(words)):
        for j in range(POOL):
            if i != j:
                word, by = _hashed(pool[i] if i < POOL else words[i], by, np.uint64(INTO_BY))
                mixed = (np.uint64(LEFT) * pool[j] - np.uint64(RIGHT) * word) & quarter
                pool[j] = mixed ^ (mixed >> half)
    by, given = np.uint64(OUT), np.zeros(POOL, dtype=np.uint64)
    for i in range(2 * POOL):
        word, by = _hashed(pool[i % POOL], by, np.uint64(OUT_BY))
        given[i // 2] |= word << np.uint64(32 * (i % 2))
    increment = np.empty(2, dtype=np.uint64)
    increment[0] = (given[2] << np.uint64(1)) | (given[3] >> np.uint64(63))
    increment[1] = (given[3] << np.uint64(1)) | np.uint64(1)
    for k in range(BLOCK + 1):
        factors[0, k], factors[1, k] = ahead[0, k], ahead[1, k]
    _begin(increment, factors)
    low = given[1] + increment[1]
    high = given[0] + increment[0] + np.uint64(low < increment[1])
    for _ in range(2):
        high, low = _go_on(high, low, factors[0, 1], factors[1, 1], increment[0], increment[1])
    state[0], state[1] = high, low


@borrowing(forceinline=True)
def _hashed(word: Any, by: Any, factor: Any) -> Any:
    """A word that is hashed, and the hash of the next one."""
    quarter = np.uint64(0xFFFFFFFF)
    following = (by * factor) & quarter
    found = ((word ^ by) * following) & quarter
    return found ^ (found >> np.uint64(16)), following


@compiled
def _begin(increment: Any, factors: Any) -> None:
    """``C_(k+1) = A_1 C_k + c``, from zero."""
    high, low = np.uint64(0), np.uint64(0)
    for k in range(BLOCK + 1):
        factors[2, k], factors[3, k] = high, low
        high, low = _go_on(high, low, factors[0, 1], factors[1, 1], increment[0], increment[1])


@borrowing(forceinline=True)
def _go_on(h: Any, l: Any, a_high: Any, a_low: Any, c_high: Any, c_low: Any) -> Any:  # noqa: E741
    """``a s + c`` modulo 2^128, all in halves; the product of low halves in quarters, as a vector has it."""
    half, quarter = np.uint64(32), np.uint64(0xFFFFFFFF)
    l0, l1, a0, a1 = l & quarter, l >> half, a_low & quarter, a_low >> half
    first = l1 * a0 + ((l0 * a0) >> half)
    second = l0 * a1 + (first & quarter)
    high = l1 * a1 + (first >> half) + (second >> half) + h * a_low + l * a_high
    low = l * a_low + c_low
    return high + c_high + np.uint64(low < c_low), low


@borrowing
def _next_block(normals: Normals) -> None:
    """The words of the next block."""
    h, l = normals.state[0], normals.state[1]  # noqa: E741
    factors, words = normals.factors, normals.words
    for k in range(BLOCK):
        high, low = _go_on(h, l, factors[0, k], factors[1, k], factors[2, k], factors[3, k])
        mixed, turn = high ^ low, high >> np.uint64(58)
        words[k] = (mixed >> turn) | (mixed << ((np.uint64(64) - turn) & np.uint64(63)))
    k = BLOCK
    normals.state[0], normals.state[1] = _go_on(h, l, factors[0, k], factors[1, k], factors[2, k], factors[3, k])
    normals.at[0] = 0
    normals.at[1] += 1


@borrowing(forceinline=True)
def _size(word: Any) -> Any:
    """The 52 bits behind layer and sign."""
    return np.int64((word >> np.uint64(9)) & np.uint64((1 << 52) - 1))


@borrowing(forceinline=True)
def _next_word(normals: Normals) -> Any:
    if normals.at[0] == BLOCK:
        _next_block(normals)
    place = normals.at[0]
    normals.at[0] = place + 1
    return normals.words[place]


@borrowing(forceinline=True)
def _next_of_one(normals: Normals) -> float:
    """A number evenly from 0 to 1."""
    return np.float64(np.int64(_next_word(normals) >> np.uint64(11))) * TO_ONE


@borrowing(forceinline=True)
def _the_long_way(normals: Normals) -> Any:
    """Whether the next word, which the quick way refuses, gives a number nevertheless, and which."""
    word = _next_word(normals)
    layer = np.int64(word & np.uint64(255))
    value = np.float64(_size(word)) * normals.scale[word & np.uint64(SIGNED - 1)]
    if layer > 0:  # between two layers
        above, below = normals.height[layer - 1], normals.height[layer]
        return (above - below) * _next_of_one(normals) + below < np.exp(-0.5 * value * value), value
    while True:  # beyond the last layer
        beyond = -normals.tail[1] * np.log1p(-_next_of_one(normals))
        drop = -np.log1p(-_next_of_one(normals))
        if drop + drop > beyond * beyond:
            value = normals.tail[0] + beyond
            return True, -value if (_size(word) >> 8) & 1 else value


@borrowing
def draw(normals: Normals, out: Any) -> None:
    """The next numbers, as many as `out` (N,) holds."""
    words, scale, most, done, total = normals.words, normals.scale, normals.most, 0, len(out)
    while done < total:
        if normals.at[0] == BLOCK:
            _next_block(normals)
        place = normals.at[0]
        ahead, into = words[place:], out[done:]
        room = min(len(ahead), len(into))
        count = 0
        for k in range(room):
            layer, size = ahead[k] & np.uint64(SIGNED - 1), _size(ahead[k])
            into[k] = np.float64(size) * scale[layer]
            if size >= most[layer]:
                break
            count += 1
        done += count
        normals.at[0] = place + count
        if count < room:
            taken, value = _the_long_way(normals)
            if taken:
                out[done] = value
                done += 1


@compiled
def _draw_first(words: Any, ahead: Any, scale: Any, most: Any, height: Any, tail: Any, found: Any) -> None:
    """:func:`first_normals` of the words (S, W) of their keys; one stream stands where the one before it stood."""
    state, factors = np.empty(2, dtype=np.uint64), np.empty((4, BLOCK + 1), dtype=np.uint64)
    block, at = np.empty(BLOCK, dtype=np.uint64), np.empty(2, dtype=np.int64)
    for i in range(len(words)):
        _start(words[i], ahead, state, factors)
        at[0], at[1] = BLOCK, 0
        draw(Normals(state, factors, block, at, scale, most, height, tail), found[i])
