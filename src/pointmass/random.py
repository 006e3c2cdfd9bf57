"""Chance without streams: every number is a hash of (seed, stream, id, purpose).

Salmon et al., Parallel random numbers: as easy as 1, 2, 3 (SC 2011), Philox 4x32 with 10 rounds. No draw depends on
any other, so results do not change with threads, batches, order, frame rate or restarts.
"""

from __future__ import annotations

from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.tracing import functions as fn  # the same bits on every machine, unlike np.cos

Array = NDArray[np.float64]
MULTIPLY = (np.uint64(0xD2511F53), np.uint64(0xCD9E8D57))
WEYL = (np.uint64(0x9E3779B9), np.uint64(0xBB67AE85))
MASK = np.uint64(0xFFFFFFFF)
SHIFT = np.uint64(32)


def philox(counter: tuple[Any, Any, Any, Any], key: tuple[Any, Any]) -> tuple[Any, Any, Any, Any]:
    """Philox 4x32-10: four 32-bit words of counter and two of key (as uint64) to four random words."""
    a, b, c, d = (np.asarray(word, np.uint64) for word in counter)
    k0, k1 = (np.asarray(word, np.uint64) for word in key)
    for _ in range(10):
        p, q = MULTIPLY[0] * a, MULTIPLY[1] * c
        a, b, c, d = (q >> SHIFT) ^ b ^ k0, q & MASK, (p >> SHIFT) ^ d ^ k1, p & MASK
        k0, k1 = (k0 + WEYL[0]) & MASK, (k1 + WEYL[1]) & MASK
    return a, b, c, d


def words(seed: int, stream: str, ids: ArrayLike, third: Any) -> tuple[Any, Any, Any, Any]:
    """Four random words of 32 bits for each id; `third` says what for, 32 bits."""
    ids = np.asarray(ids).astype(np.uint64)
    bits = seed % 2**64
    counter = (ids & MASK, ids >> SHIFT, third, crc32(stream.encode()))
    return philox(counter, (bits & 0xFFFFFFFF, bits >> 32))


def hashed(seed: int, stream: str, ids: ArrayLike, child: ArrayLike) -> NDArray[np.int64]:
    """Ids of children, at least 2^62, from those of their parents and their numbers among a parent's children.

    Parameters
    ----------
    stream : who makes them.
    child : of each, at least 0 and less than 2^32.
    """
    high, low, _, _ = words(seed, f"{stream} child", ids, child)
    result: NDArray[np.int64] = ((((high << SHIFT) | low) >> np.uint64(2)) | np.uint64(2**62)).astype(np.int64)
    return result


def uniform(seed: int, stream: str, ids: ArrayLike, purpose: str) -> Array:
    """Two numbers in [0, 1) for each id, shape (*ids.shape, 2).

    Parameters
    ----------
    seed : of the scene, 64 bits.
    stream : who draws, such as an emitter's name.
    ids : for whom, whole numbers of 64 bits.
    purpose : what for, such as "speed": other purposes give independent numbers.
    """
    a, b, c, d = words(seed, stream, ids, crc32(purpose.encode()))
    pairs = ((a << SHIFT) | b, (c << SHIFT) | d)
    return np.stack([(p >> np.uint64(11)).astype(np.float64) * 2.0**-53 for p in pairs], axis=-1)


def spread(seed: int, stream: str, ids: ArrayLike, purpose: str, mean: float, half_range: float) -> Array:
    """mean +- half_range, uniform (Reeves 1983), one for each id."""
    return mean + half_range * (2.0 * uniform(seed, stream, ids, purpose)[..., 0] - 1.0)


def normal(seed: int, stream: str, ids: ArrayLike, purpose: str) -> Array:
    """Two independent standard normal numbers for each id, shape (*ids.shape, 2) (Box & Muller 1958)."""
    u = uniform(seed, stream, ids, purpose)
    r, angle = np.sqrt(-2.0 * fn.log(1.0 - u[..., 0])), 2.0 * np.pi * u[..., 1]
    return np.stack([r * fn.cos(angle), r * fn.sin(angle)], axis=-1)


def direction(seed: int, stream: str, ids: ArrayLike, purpose: str) -> Array:
    """A direction for each id, even over the sphere, shape (*ids.shape, 3)."""
    return on_sphere(uniform(seed, stream, ids, purpose))


def on_sphere(u: NDArray[np.floating[Any]]) -> Array:
    """Unit vectors, shape (*s, 3), that are even over the sphere if u is even over [0, 1)^2, shape (*s, 2)."""
    height, angle = 2.0 * u[..., 0] - 1.0, 2.0 * np.pi * u[..., 1]
    radius = np.sqrt(1.0 - height * height)
    return np.stack([radius * fn.cos(angle), height, radius * fn.sin(angle)], axis=-1)
