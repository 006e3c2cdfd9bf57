"""Cloth: the families of the slide, masses, names of parts, energies of a strained sheet, and its surface."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies import join
from pointmass.bodies.materials import MATERIALS

SHAPE, WIDTH, HEIGHT = (7, 9), 1.6, 0.9


def energy_of(body: pm.Body, x: np.ndarray) -> float:
    body.particles.x = x
    return pm.ParticleSystem(body.particles, body.forces).energy().potential


@pytest.mark.parametrize(("shape", "counts"), [((10, 10), (180, 162, 160)), ((20, 30), (1150, 1102, 1100))])
def test_K01_springs_of_each_family(shape: tuple[int, int], counts: tuple[int, int, int]) -> None:
    built = pm.cloth(*shape)
    m, n = shape
    assert [(f.family, len(f.ids)) for f in built.forces] == list(
        zip(("stretch", "shear", "bend"), counts, strict=True)
    )
    assert sum(counts) == 6 * m * n - 5 * m - 5 * n + 2
    assert built.triangles.shape == (2 * (m - 1) * (n - 1), 3)
    steps = {"stretch": {(0, 1), (1, 0)}, "shear": {(1, 1)}, "bend": {(0, 2), (2, 0)}}
    for force in built.forces:
        row, column = np.divmod(force.ids, n)
        apart = np.stack([np.abs(np.diff(row)), np.abs(np.diff(column))], axis=-1)[:, 0]
        assert {tuple(step) for step in apart.tolist()} == steps[force.family]
        assert len(np.unique(np.sort(force.ids, axis=1), axis=0)) == len(force.ids)


def test_masses_are_those_of_the_area_around_each() -> None:
    p = pm.cloth(*SHAPE, (WIDTH, HEIGHT), density=0.3).particles
    cell = 0.3 * WIDTH / 8 * HEIGHT / 6
    m = p.m.reshape(SHAPE)
    np.testing.assert_allclose(m[1:-1, 1:-1], cell, rtol=1e-14)
    np.testing.assert_allclose(m[0, 1:-1], cell / 2, rtol=1e-14)
    np.testing.assert_allclose(m[[0, 0, -1, -1], [0, -1, 0, -1]], cell / 4, rtol=1e-14)
    assert m.sum() == pytest.approx(0.3 * WIDTH * HEIGHT, rel=1e-13)


@pytest.mark.parametrize("shape", [(7, 9), (11, 9), (6, 12)])  # cells of several forms
@pytest.mark.parametrize("strain", [(1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (0.4, -0.7, 1.1)])
def test_energy_of_a_strain_does_not_depend_on_the_cells(shape, strain) -> None:
    """stretch (exx^2 + eyy^2)/2 + shear exx eyy + shear gamma^2/2 on each unit of area."""
    exx, eyy, gamma = 1e-5 * np.array(strain)
    body = pm.cloth(*shape, (WIDTH, HEIGHT), stretch=500.0, shear=90.0, bend=0.0)
    x = body.particles.x.copy()
    moved = x + np.stack([exx * x[:, 0] + gamma * x[:, 1], eyy * x[:, 1], 0 * x[:, 0]], axis=1)
    wanted = WIDTH * HEIGHT * (250 * (exx**2 + eyy**2) + 90 * exx * eyy + 45 * gamma**2)
    assert energy_of(body, moved) == pytest.approx(wanted, rel=1e-4)  # strains are of second order in the shear


@pytest.mark.parametrize("cells", [20, 40, 80])
@pytest.mark.parametrize("across", [False, True])
def test_energy_of_a_bent_sheet_does_not_depend_on_the_cells(cells: int, across: bool) -> None:
    """B c^2 k^4 / 2 on each unit of area, which is B k^2 / 2 at k = 1/c; rows end one spring early."""
    density, bend = 0.2, 1e-5
    c = (bend / (density * 9.81)) ** (1 / 3)
    body = pm.cloth(cells + 1, cells + 1, 1.0, density=density, bend=bend, shear=0.0, stretch=1e5)
    cell, k = 1 / cells, 1 / c / 6
    turn = 2 * np.arcsin(k * cell / 2)  # of a chord of one cell: nothing is stretched
    angle = turn * (np.arange(cells + 1) - cells / 2)
    arc = np.stack([np.sin(angle) / k, (1 - np.cos(angle)) / k], axis=1)
    flat = np.linspace(-0.5, 0.5, cells + 1)
    if across:
        x = np.stack(np.broadcast_arrays(flat[None, :], -arc[:, :1], arc[:, 1:]), axis=-1)
    else:
        x = np.stack(np.broadcast_arrays(arc[None, :, 0], -flat[:, None], arc[None, :, 1]), axis=-1)
    part = (cells - 1) / cells
    wanted = bend * c**2 * k**4 / 2 * part
    assert energy_of(body, x.reshape(-1, 3)) == pytest.approx(wanted, rel=3 * turn**2 + 1e-5)


def test_edges_are_half_as_strong_and_half_as_heavy() -> None:
    """So a sheet without shear hangs from its top edge like so many equal threads."""
    body = pm.cloth(6, 5, 1.0, shear=0.0, bend=0.0, pinned="top edge")
    p, n = body.particles, 5
    k = np.zeros((5, n))
    for (a, b), k_s in zip(body.forces[0].ids, body.forces[0].arguments["k_s"], strict=True):
        if b - a == n:
            k[a // n, a % n] = k_s
    below = p.m.reshape(6, n)[::-1].cumsum(axis=0)[::-1][1:]
    np.testing.assert_allclose(below / k, np.repeat((below / k)[:, :1], n, axis=1), rtol=1e-14)


@pytest.mark.parametrize(
    ("pinned", "rows"),
    [
        ("none", []),
        ("top corners", [0, 4]),
        ("top edge", [0, 1, 2, 3, 4]),
        ("left edge", [0, 5, 10, 15]),
        ("side edges", [0, 4, 5, 9, 10, 14, 15, 19]),
        ("corners", [0, 4, 15, 19]),
        ("edges", [0, 1, 2, 3, 4, 5, 9, 10, 14, 15, 16, 17, 18, 19]),
        ("middle", [12]),
        (["right corners", "bottom corners"], [4, 15, 19]),
    ],
)
def test_pins_by_name(pinned: object, rows: list[int]) -> None:
    p = pm.cloth(4, 5, pinned=pinned).particles
    assert np.flatnonzero(p.pinned).tolist() == rows
    assert set(p.groups) == set(pm.cloth(3, 3).particles.groups)


def test_the_sheet_lies_where_it_is_put() -> None:
    p = pm.cloth(4, 5, (2.0, 3.0), center=(1, 2, 3), right=(0, 0, 2), down=(1, 0, 1), velocity=(0, 1, 0)).particles
    np.testing.assert_allclose(p.x[p.select("top corners")], [[-0.5, 2, 2], [-0.5, 2, 4]], atol=1e-14)
    np.testing.assert_allclose(p.x[-1], [2.5, 2, 4], atol=1e-14)
    assert (p.v == (0, 1, 0)).all()
    assert p.radius[0] == pytest.approx(0.25 * 0.5)


def test_materials_and_what_overrides_them() -> None:
    for name, made in MATERIALS.items():
        assert pm.cloth(3, 3, material=name).particles.m.sum() == pytest.approx(made.density)
    heavy = pm.cloth(3, 3, material="silk", density=1.0)
    assert heavy.particles.m.sum() == pytest.approx(1.0)
    assert [f.family for f in pm.cloth(3, 3, shear=0.0, bend=0.0).forces] == ["stretch"]


def test_two_cloths_have_groups_and_surfaces_of_their_own() -> None:
    one = join([pm.cloth(3, 3)], ["flag"], np.float64)[0]
    np.testing.assert_array_equal(one.select("top edge"), one.select("flag top edge"))
    both = join([pm.cloth(3, 3), pm.points([[5, 5, 5]]), pm.cloth(3, 4)], ["a", "dot", "b"], np.float64)[0]
    np.testing.assert_array_equal(both.select("b top edge"), [10, 11, 12, 13])
    with pytest.raises(pm.InvalidInput, match=r"did you mean '[ab] top edge'"):
        both.select("top edge")
    assert list(both.surfaces) == ["a", "b"]
    assert both.surfaces["b"].triangles.min() == 10
    assert both.surfaces["b"].triangles.max() == 21


def test_a_surface_loses_the_triangles_of_who_is_removed() -> None:
    body = pm.cloth(3, 3)
    system = pm.ParticleSystem(body.particles, [*body.forces, pm.PlateWind("cloth", (0, 0, 5.0))])
    system.remove([0])
    left = system.particles.surfaces["cloth"]
    assert len(left.triangles) == len(left.uv) == 6  # the upper left corner belongs to two
    assert 0 not in left.triangles
    assert (system.forces[-1].ids == left.triangles).all()
    assert np.isfinite(system.deriv_eval()).all()


def test_wind_on_a_cloth_by_its_name() -> None:
    """The whole sheet across the wind feels rho C_D A |w|^2 / 2."""
    scene = pm.Scene(
        bodies=[pm.cloth(4, 5, (2.0, 1.5)), pm.cloth(3, 3, center=(9, 0, 0))],
        names=["sail", "rag"],
        forces=[pm.PlateWind("sail", (0, 0, 3.0), density=1.2, drag=1.1)],
    )
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    system = again.simulation().system
    system.deriv_eval()
    np.testing.assert_allclose(system.particles.f.sum(axis=0), [0, 0, 0.5 * 1.2 * 1.1 * 3 * 9], atol=1e-12)
    assert not system.particles.f[system.particles.select("rag")].any()
    wrong = scene.changed(forces=[pm.PlateWind("sial")])
    with pytest.raises(pm.InvalidInput, match=r"forces.0 \(plate_wind\): unknown surface 'sial': did you mean 'sail'"):
        wrong.simulation()


def drawn(look: pm.Look) -> dict[str, object]:
    scene = pm.Scene(bodies=[pm.cloth(3, 4), pm.chain(2)], names=["rag", "rope"], look=look)
    (frame,) = scene.simulation().frames(1)
    return {d.name: d for d in frame.drawables}


def test_a_frame_has_the_surface_in_place_of_particles_and_springs() -> None:
    shown = drawn(pm.Look(color="red", pattern="checker"))
    assert set(shown) == {"rag", "chain 3", "particles"}
    assert shown["rag"].faces.shape == (12, 3)
    assert shown["rag"].uv.shape == (12, 3, 2)
    assert shown["rag"].smooth
    assert shown["rag"].color == (1, 0, 0, 1)
    assert shown["particles"].index.tolist() == [12, 13, 14]
    assert {"stretch 0", "shear 1", "bend 2", "rag"} < set(drawn(pm.Look(springs=True)))
    assert set(drawn(pm.Look(springs=False))) == {"rag", "particles"}
    bare = drawn(pm.Look(surfaces=False))
    assert set(bare) == {"stretch 0", "shear 1", "bend 2", "chain 3", "particles"}
    assert bare["particles"].index is None


def test_groups_of_a_look_show_particles_and_colour_surfaces() -> None:
    shown = drawn(pm.Look(groups={"rag": {"color": "blue"}, "rag top edge": {"size": 0.1}}))
    assert shown["rag"].color == (0, 0, 1, 1)
    assert "particles of rag" not in shown or len(shown["particles of rag"].index) == 0
    shown = drawn(pm.Look(groups={"rag top edge": {"size": 0.1}}))
    assert shown["particles of rag top edge"].index.tolist() == [0, 1, 2, 3]
    varied = drawn(pm.Look(color_by="id"))["rag"]
    assert varied.color.shape == (12, 4)


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: pm.cloth(1, 4), "rows = 1 is not allowed"),
        (lambda: pm.cloth(3, 2.5), "cols = 2.5"),
        (lambda: pm.cloth(size=(1, 0)), r"size = \(1, 0\) is not allowed: it must be one length greater than 0"),
        (lambda: pm.cloth(size=(1, 2, 3)), "size"),
        (lambda: pm.cloth(size="large"), "size"),
        (lambda: pm.cloth(down=(2, 0, 0)), "must not be parallel to right"),
        (lambda: pm.cloth(pinned="topcorners"), "unknown value of pinned 'topcorners': did you mean 'top corners'"),
        (lambda: pm.cloth(pinned=3), "unknown value of pinned 3"),
        (lambda: pm.cloth(material="wool"), "unknown material 'wool'"),
        (lambda: pm.cloth(density=0), "density = 0 is not allowed"),
        (lambda: pm.cloth(bend=-1), "bend = -1"),
        (lambda: pm.cloth(radius=-1), "radius = -1"),
        (
            lambda: pm.cloth(3, 9, shear=60.0),
            "shear = 60.0 is not allowed in cells of 0.125 m x 0.5 m: it must be below 50",
        ),
        (lambda: pm.Particles([[0, 0, 0]]).cover("s", [[0, 1, 2]]), "has the corner 1, which does not exist"),
        (lambda: pm.Particles([[0, 0, 0]]).cover("s", [[0, 1]]), r"ids of shape \(k, 3\)"),
        (lambda: pm.Look(pattern="dots"), "unknown pattern 'dots'"),
        (lambda: pm.Look(pattern_count=0), "look.pattern_count = 0"),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(build, sentence: str) -> None:
    with pytest.raises(pm.InvalidInput, match=sentence):
        build()
