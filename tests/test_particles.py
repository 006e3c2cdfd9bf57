"""Particles: columns, groups, births, deaths, and what is refused."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.forces import Gravity
from pointmass.particles import Particles
from pointmass.system import ParticleSystem

X = np.arange(12.0).reshape(4, 3)


def test_columns():
    p = Particles(X, [1, 2, 3], [1, 2, 4, 8], 0.1, charge=5.0, heat=[1, 2, 3, 4])
    assert len(p) == 4
    np.testing.assert_array_equal(p.v, np.tile([1, 2, 3], (4, 1)))
    np.testing.assert_array_equal(p.w, [1, 0.5, 0.25, 0.125])
    np.testing.assert_array_equal(p.column("heat"), [1, 2, 3, 4])
    np.testing.assert_array_equal(p.column("radius"), [0.1] * 4)
    assert p.columns == ["m", "radius", "age", "lifetime", "chance", "charge", "heat"]
    assert p.id.tolist() == [0, 1, 2, 3]
    assert (p.f == 0).all()
    assert "4, 0 pinned, float64" in repr(p)


@pytest.mark.parametrize(
    ("x", "expected"),
    [([1, 2, 3], [[1, 2, 3]]), ([[1, 2]], [[1, 2, 0]]), ([1, 2], [[1, 2, 0]]), (np.zeros((0, 3)), np.zeros((0, 3)))],
)
def test_shapes_of_places(x, expected):
    np.testing.assert_array_equal(Particles(x).x, expected)


@pytest.mark.parametrize("dtype", [np.float64, np.float32, "float32"])
def test_precision(dtype):
    p = Particles(X, m=2, charge=1, dtype=dtype)
    p.add([[1, 2, 3]])
    for column in (p.x, p.v, p.f, p.m, p.w, p.radius, p.age, p.lifetime, p.column("charge")):
        assert column.dtype == np.dtype(dtype)
    assert p.id.dtype == np.int64


def test_input_is_copied():
    mine = X.copy()
    p = Particles(mine)
    mine[:] = -1
    np.testing.assert_array_equal(p.x, X)


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ({"x": [[1, 2, np.nan]]}, "x must be finite, but entry 0 is nan"),
        ({"x": [[1, 2, 3], [1, 2, np.inf]]}, "entry 1 is inf"),
        ({"x": [[1, 2, 3, 4]]}, "x must have shape (n, 3)"),
        ({"x": [[1, 2, 3], [1, 2]]}, "x must be numbers of shape (n, 3)"),
        ({"x": "text"}, "x must be numbers"),
        ({"x": X, "v": np.zeros((3, 3))}, "v must have shape"),
        ({"x": X, "v": [np.nan, 0, 0]}, "v must be finite"),
        ({"x": X, "m": 0}, "m = 0.0 of particle 0 is not allowed: a mass is positive; to hold a particle, pin it"),
        ({"x": X, "m": [1, 1, -1, 1]}, "of particle 2"),
        ({"x": X, "m": [1, 1, 1e-320, 1]}, "m = 1e-320 is not allowed: 1/m is too large for float64"),
        ({"x": X, "m": 1e-39, "dtype": np.float32}, "m = 1e-39 is not allowed: 1/m is too large for float32"),
        ({"x": X, "m": [1, 2]}, "m must have shape"),
        ({"x": X, "m": np.inf}, "m must be finite"),
        ({"x": X, "radius": -1}, "radius = -1.0 is not allowed"),
        ({"x": X, "lifetime": 0}, "lifetime = 0.0 is not allowed: it must be greater than 0 [s], or inf"),
        ({"x": X, "lifetime": [1, np.inf, -2, 1]}, "lifetime = -2.0 is not allowed"),
        ({"x": X, "lifetime": np.nan}, "lifetime must be finite, but entry 0 is nan"),
        ({"x": X, "lifetime": "long"}, "lifetime must be numbers"),
        ({"x": X, "lifetime": 1e39, "dtype": np.float32}, "lifetime has a number that is too large for float32"),
        ({"x": X, "charge": [1, 2]}, "charge must have shape"),
        ({"x": X, "t": 1.0}, "particle attribute 't' is not allowed"),
        ({"x": X, "age": 1.0}, "particle attribute 'age' is not allowed"),
        ({"x": X, "dtype": np.int32}, "float64 or float32"),
        ({"x": X, "dtype": np.float16}, "float64 or float32"),
        ({"x": X, "dtype": "double?"}, "float64 or float32"),
        ({"x": [["1", "2", "3"]]}, "x must be numbers"),
        ({"x": X + 1j}, "x must be numbers"),
        ({"x": [[10**400, 0, 0]]}, "x must be numbers"),
        ({"x": X, "m": [[1], [1, 2]]}, "m must be numbers of shape (4,)"),
        ({"x": X, "m": "heavy"}, "m must be numbers of shape (4,), not 'heavy'"),
        ({"x": X, "charge": np.array([1j, 2, 3, 4])}, "charge must be numbers"),
        ({"x": X, "charge": "2"}, "charge must be numbers"),
    ],
)
def test_refused(arguments, hint):
    with pytest.raises(InvalidInput) as error:
        Particles(**arguments)
    assert hint in str(error.value)


def test_births_get_new_ids():
    p = Particles(X, charge=1.0)
    p.tag("old", None)
    assert p.add(X[:2], m=3.0).tolist() == [4, 5]
    assert p.column("charge").tolist() == [1, 1, 1, 1, 0, 0]
    assert p.groups["old"].tolist() == [True] * 4 + [False] * 2
    p.remove([5])
    assert p.add([[0, 0, 0]], charge=2.0).tolist() == [6]  # 5 is never used again
    assert p.add([[0, 0, 0]], id=[100]).tolist() == [100]
    assert p.add([[0, 0, 0]]).tolist() == [101]
    with pytest.raises(InvalidInput, match="no other particle has"):
        p.add([[0, 0, 0]], id=[2])
    with pytest.raises(InvalidInput, match="no other particle has"):
        p.add([[0, 0, 0], [1, 1, 1]], id=[200, 200])
    for wrong in (["a"], [200.5], [2**64], 200):
        with pytest.raises(InvalidInput, match="no other particle has"):
            p.add([[0, 0, 0]], id=wrong)
    with pytest.raises(InvalidInput, match="unknown particle attribute 'chrage': did you mean 'charge'"):
        p.add([[0, 0, 0]], chrage=1.0)
    assert len(p) == 8
    with pytest.raises(InvalidInput, match="unknown particle attribute 'charge': known are none"):
        Particles(X).add(X, charge=1.0)


def test_a_refused_birth_changes_nothing():
    p = Particles(X)
    version = p.version
    for arguments in ({"x": [[np.nan, 0, 0]]}, {"x": X, "m": -1}, {"x": X, "id": [0, 1, 2, 3]}):
        with pytest.raises(InvalidInput):
            p.add(**arguments)
    assert (len(p), p.version) == (4, version)


def test_removal_keeps_order_ids_and_bits():
    p = Particles(X, X / 7, [1, 2, 3, 4], charge=[5, 6, 7, 8])
    p.tag("pair", [1, 3])
    p.remove([0, 2])
    assert p.id.tolist() == [1, 3]
    np.testing.assert_array_equal(p.v, X[[1, 3]] / 7)
    assert p.column("charge").tolist() == [6, 8]
    assert p.groups["pair"].tolist() == [True, True]
    assert p.rows([3, 0, 1]).tolist() == [1, -1, 0]
    p.remove(None)
    assert len(p) == 0
    assert p.rows([1]).tolist() == [-1]


@pytest.mark.parametrize(
    ("which", "rows"),
    [
        (None, [0, 1, 2, 3]),
        ("pair", [1, 3]),
        ([3, 1], [1, 3]),
        ([1, 1], [1]),
        (2, [2]),
        (slice(1, 3), [1, 2]),
        (slice(-2, None), [2, 3]),
        (slice(None, None, -2), [1, 3]),
        ([], []),
        ([True, False, True, False], [0, 2]),
        (np.array([False] * 4), []),
        (slice(0, 0), []),
    ],
)
def test_selections(which, rows):
    p = Particles(X)
    p.tag("pair", [1, 3])
    assert p.select(which).tolist() == rows


@pytest.mark.parametrize(
    ("which", "hint"),
    [
        ("pear", "unknown group of particles 'pear': did you mean 'pair'"),
        ([4], "whole numbers below 4"),
        ([-1], "whole numbers below 4, counted from 0, not [-1]"),  # also what `rows` gives for one that is gone
        ([0.5], "whole numbers below 4"),
        ([[0, 1]], "whole numbers below 4"),
        ([[0], [0, 1]], "whole numbers below 4"),
        (slice("a", "b"), "whole numbers below 4"),
        ([True, False], "must have shape (4,)"),
    ],
)
def test_selections_that_do_not_exist(which, hint):
    p = Particles(X)
    p.tag("pair", [1, 3])
    with pytest.raises(InvalidInput) as error:
        p.select(which)
    assert hint in str(error.value)


def test_pins():
    p = Particles(X, X, [1, 2, 3, 4])
    p.pin([1])
    assert p.pinned.tolist() == [False, True, False, False]
    assert (p.v[1] == 0).all()
    assert p.m[1] == 2
    np.testing.assert_array_equal(p.v[[0, 2, 3]], X[[0, 2, 3]])


def test_every_change_of_structure_is_counted():
    p = Particles(X)
    seen = {p.version}
    for change in (lambda: p.add(X), lambda: p.remove([0]), lambda: p.pin([0]), lambda: p.tag("a", [0])):
        change()
        assert p.version not in seen
        seen.add(p.version)


def test_no_particles_at_all() -> None:
    assert len(Particles([])) == 0


def test_a_number_too_large_for_float32_is_refused() -> None:
    with pytest.raises(InvalidInput, match="x has a number that is too large for float32"):
        Particles([[1e300, 0, 0]], dtype=np.float32)


def test_ids_of_emitters_leave_no_mark_on_the_count() -> None:
    particles = Particles([[0, 0, 0]])
    particles.add([[1, 0, 0]], id=[2**62])
    assert particles.add([[2, 0, 0]]).tolist() == [1]


@pytest.mark.parametrize("name", ["e", "pi", "vx", "t", "f", "two words", "lambda"])
def test_names_that_formulas_need_are_no_attributes(name: str) -> None:
    with pytest.raises(InvalidInput, match="particle attribute"):
        Particles([[0, 0, 0]], **{name: 1.0})


def test_a_force_acts_on_a_slice() -> None:
    system = ParticleSystem(Particles(X), [Gravity((0, -1, 0), on=slice(1, 3))])
    assert system.deriv_eval().reshape(2, 4, 3)[1, :, 1].tolist() == [0, -1, -1, 0]


def test_columns_may_be_assigned_as_a_whole():
    p = pm.Particles([[0, 0, 0], [1, 0, 0]], m=[1, 2], dtype=np.float32)
    p.pin([1])
    x = p.x
    p.x, p.v, p.m, p.radius = [[1, 2, 3], [4, 5, 6]], (0, 1), 4, [0.1, 0.2]
    assert p.x is x
    assert p.x.dtype == p.m.dtype == np.float32
    np.testing.assert_array_equal(p.x, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(p.v, [[0, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(p.w, [0.25, 0])
    p.m[:] = 8
    np.testing.assert_array_equal(p.w, [0.125, 0])
    p.unpin([1])
    np.testing.assert_array_equal(p.w, [0.125, 0.125])


@pytest.mark.parametrize(
    ("name", "value"), [("x", [[np.nan, 0, 0]] * 2), ("x", [[0, 0, 0]] * 3), ("v", "fast"), ("m", 0), ("radius", -1)]
)
def test_an_assignment_is_checked_and_leaves_what_was_there(name, value):
    p = pm.Particles([[0, 0, 0], [1, 0, 0]])
    before = getattr(p, name).copy()
    with pytest.raises(pm.InvalidInput, match=name):
        setattr(p, name, value)
    np.testing.assert_array_equal(getattr(p, name), before)


def test_inverse_masses_and_pins_are_only_read():
    p = pm.Particles([[0, 0, 0]])
    with pytest.raises(ValueError, match="read-only"):
        p.w[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        p.pinned[0] = True


def test_births_and_deaths_by_turns_leave_every_column_right():
    rng = np.random.default_rng(0)
    p, x, heat, ids = Particles(X, heat=[1, 2, 3, 4]), X, np.array([1.0, 2, 3, 4]), np.arange(4)
    p.pin([2])
    held = np.arange(4) == 2
    for k in range(60):
        more = rng.random((rng.integers(0, 4), 3))
        new = p.add(more, heat=float(k))
        x, heat = np.concatenate([x, more]), np.concatenate([heat, np.full(len(more), float(k))])
        ids, held = np.concatenate([ids, new]), np.concatenate([held, np.zeros(len(more), bool)])
        mask = rng.random(len(x)) < 0.9 if k % 3 == 0 else np.arange(len(x)) >= k % 2
        p.keep(mask)
        x, heat, ids, held = x[mask], heat[mask], ids[mask], held[mask]
        np.testing.assert_array_equal(p.x, x)
        np.testing.assert_array_equal(p.column("heat"), heat)
        np.testing.assert_array_equal(p.id, ids)
        np.testing.assert_array_equal(p.pinned, held)
    p.keep(np.zeros(len(p), bool))
    p.keep(np.zeros(0, bool))
    assert p.x.shape == (0, 3)


def test_parts_are_copies():
    p = Particles(np.zeros((40, 3)))
    p.add(np.zeros((2, 3)))  # with room behind
    part = p.part(np.ones(42, bool))
    p.add([[1, 1, 1]])
    part.add([[2, 2, 2]])
    assert (p.x[42, 0], part.x[42, 0]) == (1, 2)
    part.x[0] = 7
    assert p.x[0, 0] == 0
    p.keep(np.arange(43) > 0)
    again = p.part(np.ones(42, bool))
    again.x[:] = 5
    assert p.x.max() == 1


def test_rows_of_ids_in_any_order():
    p = Particles(np.zeros((6, 3)), dtype=np.float32)
    p.add(np.zeros((3, 3)), id=[2**41 + 5, 2**41 + 1, 2**42])
    p.remove([1, 4])
    assert p.rows([[2**42, 5], [1, 2**41 + 1], [-3, 0], [9, 2**60]]).tolist() == [[6, 3], [-1, 5], [-1, 0], [-1, -1]]
    assert p.rows([]).tolist() == []
