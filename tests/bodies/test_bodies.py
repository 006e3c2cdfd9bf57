"""Builders: counts, masses, lengths, groups, and putting bodies together."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pointmass as pm
from pointmass.bodies import BODIES, join
from pointmass.description import parameters_of
from pointmass.errors import InvalidInput
from pointmass.forces import Springs
from tests.shapes import CLOUD, TETRAHEDRON

EXAMPLES = {
    "points": {"x": [[0, 0, 0], [1, 2, 3]], "attributes": {"charge": [1.0, -1.0]}},
    "scatter": {"count": 12, "radius": 0.1, "radius_range": 0.05, "speed": 2.0},
    "chain": {"links": 7, "length": 2.0, "mass": 3.0},
    "lattice": {"counts": (3, 4, 5), "mass": 2.0},
    "jelly": {"counts": (3, 4, 5), "size": (0.2, 0.3, 0.4), "tilt": 20.0, "pinned": "bottom"},
    "net": {"rows": 3, "cols": 4, "size": (1.0, 2.0), "links": 2, "pinned": "top edge"},
    "cloth_from_mesh": {"mesh": TETRAHEDRON, "pinned": "top"},
    "cloud": {"file": CLOUD, "scale": 2.0},
    "cloth": {"rows": 4, "cols": 5, "size": (1.0, 2.0), "pinned": "top corners"},
    "hair": {"strands": 5, "points": 24, "style": "curly", "jitter": 0.05},
    "snake": {"segments": 5, "amplitude": 0.0},
    "worm": {"segments": 5, "amplitude": 0.0},
    "fish": {"count": 2, "places": [[0, 0, 0], [0, 1, 0]], "upright": 0.0},
}


def test_every_body_has_an_example() -> None:
    assert EXAMPLES.keys() == BODIES.keys()


@pytest.mark.parametrize("kind", BODIES)
def test_body_remembers_how_it_was_built(kind: str) -> None:
    built = BODIES[kind](**EXAMPLES[kind])
    again = BODIES[built.kind](**built.arguments)
    assert built.kind == kind
    np.testing.assert_array_equal(again.particles.x, built.particles.x)
    np.testing.assert_array_equal(again.particles.v, built.particles.v)
    np.testing.assert_array_equal(again.particles.m, built.particles.m)
    assert len(again.forces) == len(built.forces)


@pytest.mark.parametrize("kind", BODIES)
def test_body_starts_without_tension(kind: str) -> None:
    built = BODIES[kind](**EXAMPLES[kind])
    system = pm.ParticleSystem(built.particles, built.forces)
    assert system.stretch() < 1e-12
    assert np.abs(system.deriv_eval(0.0)[system.dim // 2 :]).max() < 1e-9


@pytest.mark.parametrize("kind", BODIES)
def test_body_refuses_what_it_does_not_know(kind: str) -> None:
    with pytest.raises(InvalidInput, match="no parameter 'colour'"):
        BODIES[kind](**EXAMPLES[kind], colour="red")
    assert "colour" not in parameters_of(BODIES[kind])


@given(links=st.integers(1, 40), mass=st.floats(1e-3, 1e3), held=st.sampled_from(["start", "end", "both", "none"]))
def test_chain(links: int, mass: float, held: str) -> None:
    built = pm.chain(links, 2.0, mass=mass, pinned=held, direction=(0, 3, 4), start=(1, 1, 1))
    p = built.particles
    assert len(p) == links + 1
    free = ~p.pinned
    if free.any():
        assert p.m[free].sum() == pytest.approx(mass)
    assert np.linalg.norm(p.x[-1] - p.x[0]) == pytest.approx(2.0)
    np.testing.assert_allclose(p.x[-1], (1, 1 + 2 * 0.6, 1 + 2 * 0.8), rtol=1e-12)
    assert int(p.pinned.sum()) == {"start": 1, "end": 1, "both": 2, "none": 0}[held]


@pytest.mark.parametrize("shape", [(2, 2, 2), (3, 4, 5), (2, 6, 3)])
def test_lattice_counts(shape: tuple[int, int, int]) -> None:
    """Springs of each family against a plain double loop over all pairs."""
    built = pm.lattice(shape, (1.0, 2.0, 3.0), mass=4.0, tilt=30.0)
    grid = [(i, j, k) for i in range(shape[0]) for j in range(shape[1]) for k in range(shape[2])]
    wanted = {1: set(), 2: set(), 3: set()}
    for a, p in enumerate(grid):
        for b in range(a):
            d = [abs(x - y) for x, y in zip(p, grid[b], strict=True)]
            if max(d) == 1:
                wanted[sum(d)].add((b, a))
    assert built.particles.m.sum() == pytest.approx(4.0)
    for force, steps in zip(built.forces, (1, 2, 3), strict=True):
        assert isinstance(force, Springs)
        assert {tuple(sorted(pair)) for pair in force.ids.tolist()} == wanted[steps]
        assert len(force.ids) == len(wanted[steps])


def test_lattice_of_unequal_edges_keeps_each_spring_at_rest() -> None:
    system_of = pm.lattice((3, 3, 3), (1.0, 2.0, 0.5), tilt=70.0)
    assert pm.ParticleSystem(system_of.particles, system_of.forces).stretch() < 1e-12


def test_scatter_is_inside_its_box_and_keyed_by_seed() -> None:
    one, two = (pm.scatter(500, (1, 2, 3), (2, 0, 4), seed=s).particles for s in (1, 2))
    assert (np.abs(one.x - (1, 2, 3)) <= (1, 0, 2)).all()
    assert not np.array_equal(one.x, two.x)
    more = pm.scatter(600, (1, 2, 3), (2, 0, 4), seed=1).particles
    np.testing.assert_array_equal(more.x[:500], one.x)


def test_forces_of_one_law_are_one_force_and_the_bits_stay() -> None:
    bodies = [pm.fish(length=0.3), pm.jelly((3, 3, 3)), pm.fish(2, [(0, 1, 0), (0, 2, 0)], length=0.2, drag=300.0)]
    apart, forces = pm.Particles(np.zeros((0, 3))), []
    for body in bodies:
        offset = len(apart)
        apart.add(body.particles.x, m=body.particles.m)
        forces += [copy.deepcopy(force).shifted(offset) for force in body.forces]
    together, own = join(bodies, ["one", "block", "two"], np.float64)
    assert len(own) == len(bodies[0].forces) + len(bodies[1].forces)
    water = next(f for f in own if isinstance(f, pm.Water))
    assert water.parameters["drag"].components[0].value.shape == (len(water.ids),)  # each has its own
    assert next(f for f in own if isinstance(f, pm.Muscles)).family == "muscles"
    states = []
    for p, acting in ((apart, forces), (together, own)):
        p.v[:] = np.sin(np.arange(3 * len(p))).reshape(-1, 3)
        sim = pm.Simulation(pm.ParticleSystem(p, acting), dt=1 / 960)
        sim.step(20)
        states.append(sim.system.particles.x.copy())
    np.testing.assert_array_equal(*states)
    other = pm.chain(2)
    other.forces[0].enabled = False
    assert len(join([pm.chain(2), other], ["a", "b"], np.float64)[1]) == 2
    blown = [pm.Body(pm.cloth(3, 3).particles, [pm.PlateWind([(0, 1, 3)], velocity=(k, 0, 0))]) for k in (1.0, 2.0)]
    assert len(join(blown, ["a", "b"], np.float64)[1]) == 2


def test_join_shifts_springs_and_names_groups() -> None:
    a, b = pm.chain(2, mass=1.0), pm.points([[5, 5, 5]], pinned=[0], attributes={"charge": 2.0})
    c = pm.chain(1, pinned="end", mass=1.0)
    particles, forces = join([a, b, c], ["rope", "star", "stick"], np.float32)
    assert particles.dtype == np.float32
    np.testing.assert_array_equal(particles.select("rope"), [0, 1, 2])
    np.testing.assert_array_equal(particles.select("stick"), [4, 5])
    np.testing.assert_array_equal(particles.pinned, [True, False, False, True, False, True])
    np.testing.assert_array_equal(particles.column("charge"), [0, 0, 0, 2, 0, 0])
    assert [f.ids.tolist() for f in forces] == [[[0, 1], [1, 2], [4, 5]]]
    with pytest.raises(InvalidInput, match="different names"):
        join([pm.chain(1), pm.chain(1)], ["a", "a"], np.float64)


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: pm.chain(0), "links = 0"),
        (lambda: pm.chain(2.0), "links = 2.0 is not allowed: it must be a whole number, at least 1$"),
        (lambda: pm.chain(10**39), "at least 1 and less than 2\\^63"),
        (lambda: pm.chain(np.zeros((2, 2))), r"links = array\(\[\[0., 0.\], \[0., 0.\]\]\) is"),
        (lambda: pm.Springs([(0, 1)], family=["shear"]), "family must be a name"),
        (lambda: pm.chain(3, -1.0), "length = -1.0"),
        (lambda: pm.chain(3, pinned="middle"), "unknown value of pinned"),
        (lambda: pm.chain(3, direction=(0, 0, 0)), "direction"),
        (lambda: pm.lattice((1, 3, 3)), "whole number of particles, at least 2"),
        (lambda: pm.lattice((2.5, 2, 2)), "whole number of particles, at least 2"),
        (lambda: pm.lattice((2, 2, True)), "whole number of particles, at least 2"),
        (lambda: pm.lattice(("2", 2, 2)), "counts must be numbers"),
        (lambda: pm.lattice(size=(1, 0, 1)), "size"),
        (lambda: pm.scatter(5, radius=0.1, radius_range=0.2), "radius_range = 0.2"),
        (lambda: pm.points([[0, 0, np.nan]]), "x must be finite"),
        (lambda: pm.points([[0, 0, 0]], m=0.0), "m = 0.0 of particle 0"),
        (lambda: pm.points([[0, 0, 0]], pinned=[3]), "rows of particles"),
        (lambda: pm.points([[0, 0, 0]], pinned=[0.0]), "rows of particles"),
        (lambda: pm.points([[0, 0, 0]], pinned=[[0], [0, 1]]), "rows of particles"),
        (lambda: pm.points([[0, 0, 0]], pinned="top"), "group of particles 'top'"),
        (lambda: pm.points([[0, 0, 0]], attributes=[1.0]), "attributes must be columns by name"),
        (lambda: pm.points([[0, 0, 0]], attributes={"charge": [[1], [1, 2]]}), "charge must be numbers"),
        (lambda: pm.chain(3, pinned=[0]), "unknown value of pinned"),  # type: ignore[arg-type]
        (lambda: pm.scatter(3, seed=-1), "seed = -1"),
        (lambda: pm.scatter(3, size=(-1, 1, 1)), "size"),
        (pm.points, "needs the parameter 'x'"),
    ],
)
def test_bad_bodies_are_refused_in_one_sentence(build: object, sentence: str) -> None:
    with pytest.raises(InvalidInput, match=sentence):
        build()  # type: ignore[operator]


@pytest.mark.parametrize("name", ["x", "v", "m", "f", "w", "radius", "age", "id", "dtype", "self", "t", "", 1])
def test_no_attribute_has_the_name_of_a_column(name: object) -> None:
    with pytest.raises(InvalidInput, match=f"particle attribute {name!r} is not allowed: use a word"):
        pm.points([[0, 0, 0]], attributes={name: 1.0})  # type: ignore[dict-item]


def test_pinned_takes_what_selects_particles() -> None:
    for pinned in (1, [1], (1,), range(1, 2), [False, True], np.array([1])):
        assert pm.points(np.eye(3)[:2], pinned=pinned).particles.pinned.tolist() == [False, True]
    for pinned in (None, (), []):
        assert not pm.points(np.eye(3)[:2], pinned=pinned).particles.pinned.any()
