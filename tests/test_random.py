"""Chance: the published answers of Philox, and that draws are independent, even and in range."""

import numpy as np
import pytest

from pointmass import random

ONES = 0xFFFFFFFF


@pytest.mark.parametrize(
    ("counter", "key", "answer"),
    [
        ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((ONES,) * 4, (ONES,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ],
)
def test_published_answers(counter, key, answer):
    """Of Random123, the code of Salmon et al. 2011."""
    assert tuple(int(word) for word in random.philox(counter, key)) == answer
    columns = random.philox(tuple(np.full(3, c) for c in counter), key)
    assert all((column == word).all() for column, word in zip(columns, answer, strict=True))


IDS = np.arange(100_000)


def test_uniform_numbers():
    u = random.uniform(1, "fountain", IDS, "speed")
    assert u.shape == (100_000, 2)
    assert u.min() >= 0
    assert u.max() < 1
    np.testing.assert_allclose(u.mean(axis=0), 0.5, atol=0.004)
    np.testing.assert_allclose(u.var(axis=0), 1 / 12, rtol=0.02)
    assert abs(np.corrcoef(u.T)[0, 1]) < 0.015
    counts = np.histogram(u[:, 0], 64, (0, 1))[0]
    assert np.sum((counts - len(IDS) / 64) ** 2 / (len(IDS) / 64)) < 120  # chi-squared of 63 degrees, far tail


def test_a_draw_depends_on_nothing_but_its_name():
    all_at_once = random.uniform(7, "a", IDS[:1000], "p")
    backwards = random.uniform(7, "a", IDS[:1000][::-1], "p")[::-1]
    one_by_one = np.stack([random.uniform(7, "a", i, "p") for i in range(1000)])
    np.testing.assert_array_equal(all_at_once, backwards)
    np.testing.assert_array_equal(all_at_once, one_by_one)


@pytest.mark.parametrize("other", [(8, "a", "p"), (7, "b", "p"), (7, "a", "q"), (7 + 2**40, "a", "p"), (-1, "a", "p")])
def test_other_names_give_independent_numbers(other):
    seed, stream, purpose = other
    first, second = random.uniform(7, "a", IDS, "p"), random.uniform(seed, stream, IDS, purpose)
    assert not (first == second).any()
    assert abs(np.corrcoef(first[:, 0], second[:, 0])[0, 1]) < 0.015


def test_ids_of_64_bits():
    ids = np.array([5, 5 + 2**32, 2**62 + 5, -5], dtype=np.int64)
    u = random.uniform(1, "a", ids, "p")
    assert len(np.unique(u)) == 8


def test_spread():
    values = random.spread(3, "a", IDS, "life", 10.0, 2.0)
    assert values.min() >= 8
    assert values.max() < 12
    assert values.mean() == pytest.approx(10, abs=0.02)


def test_normal_numbers():
    z = random.normal(3, "a", IDS, "gust")
    assert np.isfinite(z).all()
    np.testing.assert_allclose(z.mean(axis=0), 0, atol=0.015)
    np.testing.assert_allclose(z.std(axis=0), 1, rtol=0.01)
    assert np.mean(np.abs(z) < 1.959964) == pytest.approx(0.95, abs=0.003)


def test_directions():
    d = random.direction(3, "a", IDS, "burst")
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(d.mean(axis=0), 0, atol=0.01)
    np.testing.assert_allclose(d.var(axis=0), 1 / 3, rtol=0.02)
