import numpy as np
import pytest

from pointmass.deaths import Deaths


@pytest.fixture
def people():
    rng = np.random.default_rng(3)
    death = rng.random(500).round(2)  # many at the same hour
    death[::50] = np.inf
    return np.arange(500) + 7, death


def test_each_is_due_once_at_its_hour_whatever_the_batches(people):
    ids, death = people
    deaths = Deaths()
    for part in np.array_split(np.arange(500), 7):
        deaths.add(ids[part], death[part])
    before = -1.0
    for t in (0.0, 0.1, 0.1, 0.43, 0.99, 2.0):
        assert set(deaths.due(t)) == set(ids[(death > before) & (death <= t)])
        before = t
    assert not deaths


def test_those_who_live_for_ever_are_nobody(people):
    ids, _ = people
    deaths = Deaths()
    deaths.add(ids, np.full(len(ids), np.inf))
    assert not deaths
    assert len(deaths.due(1e300)) == 0


def test_those_who_come_late_for_their_death_are_due_at_once():
    deaths = Deaths()
    deaths.add(np.array([1]), np.array([5.0]))
    assert len(deaths.due(4.0)) == 0
    deaths.add(np.array([2, 3]), np.array([6.0, 1.0]))
    assert deaths.due(4.0).tolist() == [3]
    assert deaths.due(5.0).tolist() == [1]
    assert deaths
