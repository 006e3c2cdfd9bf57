"""What the scene of snow stands on, and how flakes lie there."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.meshes import triangle_mesh
from pointmass.scenes.models import fir, house

STILL = {"wind": 0.0, "flutter": 0.0, "rate": 20.0}


@pytest.mark.parametrize("model", [fir(1.8, 0.5), house(1.2, 0.4)])
def test_models_are_closed_face_outwards_and_reach_below_the_ground(model):
    vertices, faces = model
    mesh = triangle_mesh(vertices, faces)
    assert mesh.closed
    corners = vertices[faces]
    volume = (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert np.isclose(volume, mesh.volume, rtol=1e-9)
    assert volume > 0
    assert vertices[:, 1].min() < -0.3


def slope(friction):
    """Flakes on one slope of tan(angle) = 0.7, at rest at first, and a second later."""
    scene = pm.SCENES["snow"].with_settings({**STILL, "friction": friction})
    x = np.array([(-2.0, -2.0), (2.0, 2.0)])
    ground = pm.HeightField(0.7 * x, (4.0, 4.0), restitution=0.0, friction=scene.friction)
    flakes = pm.Particles([(0.0, 1e-5, 0.3), (0.5, 0.35001, -0.4)], m=1e-5)
    forces = [pm.Gravity(), pm.Drag(1e-5 * 9.81 / scene.fall)]
    sim = pm.Simulation(pm.ParticleSystem(flakes, forces, [ground]), pm.SymplecticEuler(), 1 / 60)
    frames = list(sim.frames(61, 60))
    return scene, [f.positions for f in (frames[1], frames[-1])], frames[-1].velocities


def test_below_the_angle_of_friction_a_flake_does_not_creep():
    _, (first, last), v = slope(0.75)
    assert (first == last).all()
    assert (v == 0).all()


def test_above_it_slides_at_the_speed_of_the_closed_form():
    """m v' = m g (sin a - mu cos a) - k v ends at v = fall (sin a - mu cos a)."""
    scene, (first, last), v = slope(0.3)
    angle = np.arctan(0.7)
    speed = scene.fall * (np.sin(angle) - 0.3 * np.cos(angle))
    assert np.allclose(np.linalg.norm(v, axis=1), speed, rtol=2e-3)
    assert (last[:, 0] < first[:, 0] - 0.2).all()


def test_a_mesh_from_a_file_stands_on_the_hills(tmp_path):
    file = tmp_path / "tent.obj"
    file.write_text("v 0 0 0\nv 300 0 0\nv 0 0 300\nv 0 600 0\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n")
    scene = pm.SCENES["snow"].with_settings({"model": str(file), "tall": 1.2, "hills": 0.3})
    mesh = scene.standing()
    low, high = (f(mesh.triangles.vertices + mesh.at(0.0), axis=0) for f in (np.min, np.max))
    assert np.allclose(high - low, (0.6, 1.2, 0.6))
    assert np.allclose(0.5 * (low + high)[[0, 2]], 0)
    assert abs(scene.ground().distance(np.array([(0.0, low[1], 0.0)]), 0.0)[0]) < 0.01


def test_a_flat_mesh_is_refused(tmp_path):
    file = tmp_path / "flat.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")
    with pytest.raises(pm.InvalidInput, match=r"model = .*flat.obj' is not allowed: the mesh is flat"):
        pm.SCENES["snow"].with_settings({"model": str(file)}).build()
