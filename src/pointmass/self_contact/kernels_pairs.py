"""Which boxes overlap: a hash grid, filled by a counting sort.

A box lies in the cell of its middle. Cells are as large as the largest box, but for a few that are larger than all
others and are asked one by one; so the middles of all that overlap a box are less than half a cell outside of it.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np

from pointmass.kernels_base import inner
from pointmass.self_contact.kernels_base import kernel
from pointmass.self_contact.kernels_geometry import at, closest, dot, minus, pace, weighed

SPREAD = np.int64(0x9E3779B97F4A7C15 - 2**64)  # 2^64 over the golden ratio: Knuth's multiplicative hashing


@kernel
def boxes(items, x0, x1, shift, pad, result):
    """Boxes around the ways of points, edges or triangles, seen by somebody who moves by `shift`, and grown by `pad`.

    Parameters
    ----------
    items : rows of the corners, shape (k, c).
    result : written; lower and upper corners, shape (k, 6).
    """
    for k in range(len(items)):
        for axis in range(3):
            least, most = np.inf, -np.inf
            for j in range(items.shape[1]):
                a = x0[items[k, j], axis]
                b = x1[items[k, j], axis] - shift[axis]
                least, most = min(least, a, b), max(most, a, b)
            result[k, axis], result[k, 3 + axis] = least - pad, most + pad


@inner
def cell_of(place, origin, size):
    """Number of the cell of a place along an axis."""
    return np.int64(math.floor((place - origin) / size))


@inner
def key_of(i, j, k, numbers):
    """One number for the three of a cell."""
    return (i * numbers[1] + j) * numbers[2] + k


@inner
def bucket(key, mask):
    """That of a cell."""
    return ((key * SPREAD) >> 20) & mask


@kernel
def sort_in(boxes, origin, size, numbers, ends, entries, keys, packed, large):
    """Put boxes into the buckets of their cells, in the order of their numbers; returned is how many are too large.

    Parameters
    ----------
    ends : zeros, one for each bucket and one more; where each bucket ends is written.
    entries, keys, packed, large : written; the boxes in the buckets, keys of their cells, their corners, shape (k, 6),
        and the boxes that are too large.
    """
    mask = len(ends) - 2
    key_at = np.empty(len(boxes), np.int64)
    many = 0
    for k in range(len(boxes)):
        key = np.int64(-1)
        if max(boxes[k, 3] - boxes[k, 0], boxes[k, 4] - boxes[k, 1], boxes[k, 5] - boxes[k, 2]) <= size:
            key = key_of(
                cell_of(0.5 * (boxes[k, 0] + boxes[k, 3]), origin[0], size),
                cell_of(0.5 * (boxes[k, 1] + boxes[k, 4]), origin[1], size),
                cell_of(0.5 * (boxes[k, 2] + boxes[k, 5]), origin[2], size),
                numbers,
            )
            ends[bucket(key, mask) + 1] += 1
        else:
            large[many] = k
            many += 1
        key_at[k] = key
    for b in range(1, len(ends)):
        ends[b] += ends[b - 1]
    for k in range(len(boxes)):
        if key_at[k] >= 0:
            b = bucket(key_at[k], mask)
            e = ends[b]
            entries[e], keys[e] = k, key_at[k]
            for j in range(6):
                packed[e, j] = boxes[k, j]
            ends[b] += 1
    return many


@inner
def share(a, b):
    """Whether two items have a corner in common."""
    for i in range(len(a)):
        for j in range(len(b)):
            if a[i] == b[j]:
                return True
    return False


@inner
def overlap(lowest, highest, boxes, k):
    """Whether a box and one of a list do."""
    return (
        lowest[0] <= boxes[k, 3]
        and highest[0] >= boxes[k, 0]
        and lowest[1] <= boxes[k, 4]
        and highest[1] >= boxes[k, 1]
        and lowest[2] <= boxes[k, 5]
        and highest[2] >= boxes[k, 2]
    )


@inner
def reached(lowest, highest, origin, size, numbers, axis):
    """First and last cell along an axis where boxes that overlap one may have their middles, and how many these are."""
    first = max(cell_of(lowest[axis] - 0.5 * size, origin[axis], size), 0)
    last = min(cell_of(highest[axis] + 0.5 * size, origin[axis], size), numbers[axis] - 1)
    return first, last, max(last - first + 1.0, 0.0)


@inner
def noted(found, begin, end, n, o):
    """Put a number into a list, in order, if there is room; how long it would be."""
    if begin + n < end:
        s = begin + n  # by insertion: lists are short
        while s > begin and found[s - 1] > o:
            found[s] = found[s - 1]
            s -= 1
        found[s] = o
    return n + 1


@kernel
def query(
    items, boxes, others, others_boxes, same, origin, size, numbers, ends, entries, keys, packed, large,
    everybody, room, found, counts, first, last,
):  # fmt: skip
    """Which of the others overlap the boxes first to last, without those that share a corner, in ascending order.

    Parameters
    ----------
    boxes, others_boxes : lower and upper corners, shapes (k, 6).
    same : whether the others are the items themselves; each pair is then found with its smaller number.
    everybody : the numbers of all others.
    room : where the list of each item begins in `found`, shape (k + 1,).
    found : written, as far as there is room.
    counts : written; how many there are, shape (k,).
    """
    mask = len(ends) - 2
    for k in range(first, last):
        n = 0
        begin, end = room[k], room[k + 1]
        lowest, highest = at(boxes, k), (boxes[k, 3], boxes[k, 4], boxes[k, 5])
        i0, i1, along = reached(lowest, highest, origin, size, numbers, 0)
        j0, j1, across = reached(lowest, highest, origin, size, numbers, 1)
        m0, m1, up = reached(lowest, highest, origin, size, numbers, 2)
        if along * across * up > len(others):  # to ask each is less work
            i1, asked = i0 - 1, everybody
        else:
            asked = large
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                for m in range(m0, m1 + 1):
                    key = key_of(i, j, m, numbers)
                    b = bucket(key, mask)
                    for e in range(ends[b - 1] if b > 0 else 0, ends[b]):
                        o = entries[e]
                        if keys[e] != key or (same and o <= k):
                            continue
                        if overlap(lowest, highest, packed, e) and not share(items[k], others[o]):
                            n = noted(found, begin, end, n, o)
        for o in asked:
            if (not same or o > k) and overlap(lowest, highest, others_boxes, o) and not share(items[k], others[o]):
                n = noted(found, begin, end, n, o)
        counts[k] = n


@kernel
def pack(found, room, counts, items, others):
    """The pairs of all lists, one after the other."""
    e = 0
    for k in range(len(counts)):
        for j in range(counts[k]):
            items[e], others[e] = k, found[room[k] + j]
            e += 1


@kernel
def near(corners, edges, x0, x1, reach, keep, first, last):
    """Of the pairs first to last, keep those that may come as near as `reach` on their ways; see `Pairs`."""
    for k in range(first, last):
        c = corners[k]
        p = at(x0, c[0]), at(x0, c[1]), at(x0, c[2]), at(x0, c[3])
        q = at(x1, c[0]), at(x1, c[1]), at(x1, c[2]), at(x1, c[3])
        w, _ = closest(edges, p)
        r = weighed(w, p)
        keep[k] = math.sqrt(dot(r, r)) <= reach + pace(edges, p, q)


@kernel
def spread_of(rows, x, reference):
    """How far points have moved: the least and the most along each axis, and the square of the longest way."""
    least, most = np.full(3, np.inf), np.full(3, -np.inf)
    longest = 0.0
    for i in rows:
        d = minus(at(x, i), at(reference, i))
        longest = max(longest, dot(d, d))
        for axis in range(3):
            least[axis], most[axis] = min(least[axis], d[axis]), max(most[axis], d[axis])
    return least, most, longest
