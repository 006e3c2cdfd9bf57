from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.viewer.columns import Columns, names
from pointmass.viewer.expression import Expression


@pytest.fixture
def sim():
    rng = np.random.default_rng(1)
    particles = pm.Particles(
        rng.normal(size=(7, 3)), rng.normal(size=(7, 3)), m=rng.uniform(1, 2, 7), charge=np.arange(7)
    )
    return pm.Simulation(pm.ParticleSystem(particles, forces=[pm.Gravity(), pm.Drag(0.3)]))


def value(sim, text):
    columns = Columns(sim.frame(), [sim])
    return Expression(text, columns.names()).of(columns)


def test_it_is_what_numpy_says(sim):
    p = sim.system.particles
    speed = np.sqrt((p.v**2).sum(axis=1))
    f = p.m[:, None] * np.array([0, -9.81, 0]) - 0.3 * p.v
    for text, wanted in {
        "mean(y)": p.x[:, 1].mean(),
        "max(speed) - min(speed)": speed.max() - speed.min(),
        "sum(0.5*m*speed**2)": sim.quantities()["kinetic"],
        "std(vx)": p.v[:, 0].std(),
        "sum(charge)/sum(m)": 21 / p.m.sum(),
        "sum(fy)": f[:, 1].sum(),
        "max(force)": np.sqrt((f**2).sum(axis=1)).max(),
        "sum(x if id == 3 else 0)": p.x[3, 0],
        "max(max(x, y))": p.x[:, :2].max(),
        "mean(where(y > 0, 1, 0))": (p.x[:, 1] > 0).mean(),
        "2*pi + t": 2 * np.pi,
    }.items():
        assert value(sim, text) == pytest.approx(wanted, rel=1e-12), text


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("y", "gather"),
        ("mean(y) + x", "gather"),
        ("mean(Y)", "unknown name"),
        ("mean", "write it with brackets: mean\\(x\\)"),
        ("average(y)", "unknown function"),
        ("mean(x, y)", "unknown function"),
        ("mean(y).__class__", "may use"),
        ("__import__('os').system('true')", "may use"),
        ("[y for y in x]", "may use"),
        ("mean(y", "is not a formula"),
        ("", "1 to 2000"),
        ("1/0", "zero"),
        ("mean(" * 150 + "x" + ")" * 150, "nest|not a formula"),
    ],
)
def test_what_is_none_is_refused_in_a_sentence(sim, text, sentence):
    with pytest.raises(InvalidInput, match=sentence):
        value(sim, text)


def test_nobody_has_no_mean(sim):
    sim.system.remove(np.arange(7))
    assert np.isnan(value(sim, "mean(y)"))
    assert np.isnan(value(sim, "max(force)"))
    assert value(sim, "sum(m)") == 0


def test_a_cache_has_places_and_velocities(sim):
    columns = Columns(sim.frame())
    assert Expression("mean(z)", names([])).of(columns) == pytest.approx(sim.system.particles.x[:, 2].mean())
    with pytest.raises(InvalidInput, match="unknown name"):
        Expression("mean(m)", names([]))
