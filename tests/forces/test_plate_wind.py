"""Wind on plates, against its limits (check F08), and winds that add up."""

import numpy as np
import pytest

import pointmass as pm

RHO, C_D, C_L, SPEED = 1.3, 1.1, 0.7, 4.0
CORNERS = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0]], float)  # area 1, normal z
AREA = 1.0


def force_on(corners, velocity, **keywords):
    plate = pm.PlateWind([(0, 1, 2)], velocity, RHO, C_D, C_L, **keywords)
    system = pm.ParticleSystem(pm.Particles(corners), [plate])
    forces = system.deriv_eval()[9:].reshape(3, 3)
    np.testing.assert_allclose(forces, [forces[0]] * 3, rtol=1e-12)
    return forces.sum(axis=0)


def turned(angle):
    """The wind meets the plate at an angle of attack: 90 degrees is broadside."""
    return SPEED * np.array([np.cos(np.radians(angle)), 0, np.sin(np.radians(angle))])


@pytest.mark.parametrize("side", [1, -1])
def test_broadside_edge_on_and_at_45_degrees(side):
    """The winding of the triangle, and so the sign of its normal, means nothing."""
    corners = CORNERS[::side]
    broadside = RHO * AREA * C_D * SPEED**2 / 2
    np.testing.assert_allclose(force_on(corners, turned(90)), [0, 0, broadside], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(force_on(corners, turned(0)), 0, atol=1e-12)
    force, wind = force_on(corners, turned(45)), turned(45) / SPEED
    along, across = force @ wind, np.linalg.norm(force - (force @ wind) * wind)
    assert along == pytest.approx(broadside * np.sqrt(0.5), rel=1e-12)
    assert across == pytest.approx(RHO * AREA * C_L * SPEED**2 / 4, rel=1e-12)


def test_lift_is_largest_at_45_degrees_and_at_right_angles_to_the_wind():
    angles = np.arange(1, 90)
    forces = np.array([force_on(CORNERS, turned(a)) for a in angles])
    winds = np.array([turned(a) for a in angles]) / SPEED
    drag = (forces * winds).sum(axis=1)
    lift = forces - drag[:, None] * winds
    sine = np.sin(np.radians(angles))
    np.testing.assert_allclose(drag, RHO / 2 * AREA * SPEED**2 * C_D * sine, rtol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(lift, axis=1), RHO / 2 * AREA * SPEED**2 * C_L * sine * np.sqrt(1 - sine**2), rtol=1e-12
    )
    assert angles[np.argmax(np.linalg.norm(lift, axis=1))] == 45
    assert (lift[:, 2] > 0).all()  # to the side to which the air flows


def test_a_plate_that_moves_with_the_air_feels_nothing():
    plate = pm.PlateWind([(0, 1, 2)], (1, 2, 3))
    system = pm.ParticleSystem(pm.Particles(CORNERS, (1, 2, 3)), [plate])
    assert (system.deriv_eval()[9:] == 0).all()
    flat = pm.ParticleSystem(pm.Particles([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), [pm.PlateWind([(0, 1, 2)])])
    assert (flat.deriv_eval()[9:] == 0).all()  # a triangle without area


def test_a_plate_falls_at_its_terminal_speed():
    """m g = rho A C_D v^2 / 2, broadside; edge-on it falls freely."""
    for corners, speed in ((CORNERS[:, [0, 2, 1]], np.sqrt(2 * 9.81 * 0.3 / (RHO * AREA * C_D))), (CORNERS, 9.81 * 2)):
        plate = pm.PlateWind([(0, 1, 2)], (0, 0, 0), RHO, C_D, C_L)
        system = pm.ParticleSystem(pm.Particles(corners, m=0.1), [pm.Gravity(), plate])
        pm.Simulation(system, "rk4", 0.01).step(200)
        np.testing.assert_allclose(system.particles.v, [[0, -speed, 0]] * 3, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("solver", ["leapfrog", "rk4"])
def test_a_patch_of_cloth_in_gusts_has_the_same_motion_on_both_paths(solver):
    ends = []
    for compiled in (False, True):
        air = [pm.Vortex(2.0, (0, 0.5, 0), eps=0.3), (0, "1 + t", 0.5)]
        p = pm.Particles([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.1]], m=0.1)
        sheet = pm.PlateWind([(0, 1, 2), (2, 1, 3)], air)
        springs = pm.Springs([(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)], 100.0, 0.1)
        sim = pm.Simulation(pm.ParticleSystem(p, [sheet, springs]), solver, 1e-3, compiled=compiled)
        sim.step(200)
        ends.append(p.x.copy())
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-12)
    assert np.abs(ends[0][:, 1]).max() > 1.01


def test_velocities_of_one_wind_add_up_and_drag_once():
    """A particle ends with the velocity of the sum of the fields; two winds have each pulled with half a strength."""
    air = [pm.Flow(("1", "0", "0")), pm.Flow(("0", "t", "0")), (0, 0, 3)]
    ends = []
    for forces in ([pm.Wind(air, k=2.0)], [pm.Wind(("1", "t", "3"), k=2.0)]):
        system = pm.ParticleSystem(pm.Particles((0, 0, 0), m=0.1), forces)
        pm.Simulation(system, "rk4", 0.01).step(100)
        ends.append(system.particles.v)
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-13)
    np.testing.assert_allclose(ends[0], [[1, 1 - 0.05, 3]], atol=1e-8)  # m/k = 0.05 s behind


def test_in_a_scene_file_and_back():
    air = [pm.Gust((4, 0, 0)), pm.Flutter((0.3, 0.1, 0.3)), (0, "sin(t)", 1)]
    scene = pm.Scene(
        bodies=[pm.points([[0, 0, 0], [1, 0, 0], [0, 1, 0]])],
        forces=[pm.Wind(air, k=0.1), pm.PlateWind([(0, 1, 2)], [pm.Gust(), (1, 0, 0)])],
    )
    again = pm.Scene.from_toml(scene.to_toml())
    assert again == scene
    assert len(again.forces[0].flows) == 2
    with pytest.raises(pm.InvalidInput, match=r"forces\.0\.velocity\.1"):
        pm.Scene.from_toml(scene.to_toml().replace('"flutter"', '"drag"'))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: pm.PlateWind([(0, 1)]), "needs 3 particle ids"),
        (lambda: pm.PlateWind([(0, 1, 1)]), "joins particle 1 with itself"),
        (lambda: pm.PlateWind([(0, 1, 2)], drag=-1), "drag = -1"),
        (lambda: pm.PlateWind([(0, 1, 2)], density=-1), "density = -1"),
        (lambda: pm.PlateWind([(0, 1, 2)], pm.Vortex(on=[1])), "give `on` to the particles"),
        (
            lambda: pm.PlateWind([(0, 1, 2)], [pm.Vortex(), pm.Gravity()]),
            "velocity must be three numbers or a velocity",
        ),
    ],
)
def test_what_cannot_be_is_said_in_one_sentence(make, says):
    with pytest.raises(pm.InvalidInput, match=says):
        make()
