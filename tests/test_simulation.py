"""Grid, frames, births and divergence."""

import numpy as np
import pytest

import pointmass as pm
from pointmass.frame import Frame
from pointmass.solvers import SOLVERS


def fountain(solver=None, dt=1 / 60, rate=100.0, lifetime=0.4, colliders=(), seed=0, **keywords):
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity()], colliders)
    nozzle = pm.Nozzle(position=(0, 0.1, 0), rate=rate, lifetime=lifetime, cone=30, **keywords)
    return pm.Simulation(system, solver or pm.Leapfrog(), dt, emitters=[nozzle], seed=seed)


def bouncing(solver, dt=1 / 50):
    rng = np.random.default_rng(0)
    p = pm.Particles(rng.uniform(-0.9, 0.9, (6, 3)), rng.normal(size=(6, 3)))
    springs = pm.Springs([(0, 1), (1, 2)], k_s=50.0, k_d=0.5)
    room = pm.Box(size=(2, 2, 2), inside=True, restitution=0.7)
    return pm.Simulation(pm.ParticleSystem(p, [pm.Gravity(), springs], [room]), solver, dt)


def test_first_frame_is_the_start_and_times_are_exact():
    sim = bouncing(pm.Leapfrog())
    start = sim.system.particles.x.copy()
    frames = list(sim.frames(7, fps=24))
    assert all(isinstance(f, Frame) for f in frames)
    assert [f.number for f in frames] == list(range(7))
    np.testing.assert_array_equal(frames[0].positions, start)
    np.testing.assert_allclose([f.time for f in frames], np.arange(7) / 24, rtol=1e-15)


def test_a_second_call_goes_on():
    one, two = bouncing(pm.RK4()), bouncing(pm.RK4())
    together = list(one.frames(9, fps=30))
    apart = [*two.frames(4, fps=30), *two.frames(5, fps=30)]
    assert [f.time for f in together] == [f.time for f in apart]
    np.testing.assert_array_equal(together[-1].positions, apart[-1].positions)


def test_frames_after_steps_begin_now():
    sim = bouncing(pm.Leapfrog())
    sim.step(10)
    frames = list(sim.frames(3, fps=25))
    np.testing.assert_allclose([f.time for f in frames], 10 / 50 + np.arange(3) / 25, rtol=1e-12)
    sim.step(20)
    assert next(iter(sim.frames(1, fps=25))).time == sim.t


@pytest.mark.parametrize("solver", [pm.Leapfrog(), pm.DormandPrince(), pm.BDF2()], ids=lambda s: s.name)
@pytest.mark.parametrize("make", [bouncing, lambda s: fountain(s, colliders=[pm.Plane()])], ids=["impacts", "births"])
def test_frames_change_no_bits(make, solver):
    finals = []
    for fps in (None, 24, 60, 240):
        sim = make(solver)
        for _ in sim.frames(int(0.5 * fps), fps) if fps else ():
            pass
        sim.step(60 - sim.steps)
        finals.append((sim.system.get_state().tobytes(), sim.system.particles.id.tobytes()))
    assert len(set(finals)) == 1


@pytest.mark.parametrize("solver", [pm.Leapfrog(), pm.RK4(), pm.DormandPrince()], ids=lambda s: s.name)
def test_a_frame_between_steps_is_on_the_path(solver):
    # ballistic, with an impact inside of the step that is looked into
    p = pm.Particles([[0, 0.02, 0]], [[0.5, 0.0, 0]])
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Gravity()], [pm.Plane(friction=0, restitution=0.5)]), solver, 0.1)
    sim.step()
    hit = np.sqrt(2 * 0.02 / 9.81)
    for t in np.linspace(0.001, 0.0999, 40):
        x = sim.frame(t=t).positions[0]
        s = t - hit
        y = 0.02 - 0.5 * 9.81 * t * t if s < 0 else 0.5 * 9.81 * hit * s - 0.5 * 9.81 * s * s
        np.testing.assert_allclose(x, [0.5 * t, y, 0], atol=1e-9)
    assert sim.frame().time == sim.t


def test_frames_of_a_net_show_nobody_inside():
    p = pm.Particles([[0, 0.05, 0], [0.1, 0.05, 0]], [[0, -30, 0], [0, -20, 0]])
    plane = pm.Plane(restitution=1.0)
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Springs([(0, 1)], k_s=10.0)], [plane]), pm.SymplecticEuler(), 1 / 30)
    sim.step()
    for t in np.linspace(0.0, 1 / 30, 30):
        assert (sim.frame(t=t).positions[:, 1] >= -1e-9).all()


def test_only_the_last_step_can_be_looked_at():
    sim = bouncing(pm.Leapfrog())
    sim.step(3)
    with pytest.raises(pm.InvalidInput, match="last step"):
        sim.frame(t=0.0)
    with pytest.raises(pm.InvalidInput, match="last step"):
        sim.frame(t=sim.t + 1)


def test_frames_look_back_over_deaths():
    sim = fountain(dt=1 / 30, lifetime=0.05)
    counts = [len(f.ids) for f in sim.frames(200, fps=97)]
    assert min(counts[20:]) >= 3
    assert max(counts) <= 0.05 * 100 + 1 + 100 / 30


def test_times_are_not_accumulated():
    sim = pm.Simulation(pm.ParticleSystem(pm.Particles([[0, 0, 0]])), dt=0.1)
    sim.step(1000)
    assert sim.t == 1000 * 0.1
    assert sim.steps == 1000
    assert sim.system.t == sim.t


def test_step_takes_a_count():
    one, many = bouncing(pm.RK4()), bouncing(pm.RK4())
    one.step(5)
    for _ in range(5):
        many.step()
    np.testing.assert_array_equal(one.system.get_state(), many.system.get_state())
    with pytest.raises(pm.InvalidInput, match="count"):
        one.step(-1)
    with pytest.raises(pm.InvalidInput, match="fps"):
        one.frames(3, fps=0)
    with pytest.raises(pm.InvalidInput, match="frames"):
        one.frames(0)


def test_seeds():
    a, b, c = (fountain(seed=s) for s in (1, 1, 2))
    for sim in (a, b, c):
        sim.step(20)
    assert a.system.get_state().tobytes() == b.system.get_state().tobytes()
    assert a.system.get_state().tobytes() != c.system.get_state().tobytes()


def test_arguments_are_checked():
    system = pm.ParticleSystem(pm.Particles([[0, 0, 0]]))
    for wrong in ({"dt": 0}, {"dt": np.nan}, {"solver": "rk5"}, {"seed": -1}, {"emitters": [pm.Gravity()]}):
        with pytest.raises(pm.InvalidInput):
            pm.Simulation(system, **wrong)


def test_a_flow_is_solved_by_rk4():
    assert isinstance(pm.Simulation(pm.ParticleSystem(pm.Particles([[1, 0, 0]]), [pm.Vortex()])).solver, pm.RK4)
    assert isinstance(pm.Simulation(pm.ParticleSystem(pm.Particles([[1, 0, 0]]))).solver, pm.SymplecticEuler)


@pytest.mark.parametrize("pinned", [[], [0]])
def test_U02_nail(pinned):
    p = pm.Particles([[0, 0, 0], [1, 0, 0]])
    p.pin(pinned)
    floor = pm.Plane(point=(0, "-0.05 + 0.1*t", 0))
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Gravity(), pm.Springs([(0, 1)])], [floor]), dt=1 / 100)
    before = p.x[0].tobytes(), p.v[0].tobytes()
    sim.step(100)
    assert ((p.x[0].tobytes(), p.v[0].tobytes()) == before) == bool(pinned)


# ---------------------------------------------------------------------------------------------------- divergence


def test_divergence_names_everything_and_keeps_the_state_before():
    p = pm.Particles([[0, 0, 0], [1.1, 0, 0]])
    p.pin([0])
    system = pm.ParticleSystem(p, [pm.Gravity(), pm.Springs([(0, 1)], k_s=1e4, rest=1.0)])
    sim = pm.Simulation(system, pm.SymplecticEuler(), 0.05)
    with pytest.raises(pm.Diverged) as caught:
        sim.step(1000)
    error = caught.value
    assert (error.particle, error.force, error.step) == (1, "springs", sim.steps)
    assert error.time == sim.t == system.t
    assert error.largest_safe_dt == pytest.approx(2 / 100, rel=1e-6)
    assert "0.02 s" in str(error)
    assert "0.05 s" in str(error)
    state = system.get_state()
    assert np.isfinite(state).all()
    with pytest.raises(pm.Diverged):
        sim.step()
    np.testing.assert_array_equal(system.get_state(), state)


def test_a_divergence_of_many_particles_names_a_step_that_is_surely_stable(monkeypatch):
    monkeypatch.setattr("pointmass.simulation.MANY_MOTIONS", 10)
    body = pm.cloth(8, 8, 1.0, pinned="top edge")
    system = pm.ParticleSystem(body.particles, [pm.Gravity(), *body.forces])
    longest = system.stability(pm.SymplecticEuler()).largest_safe_dt
    sim = pm.Simulation(system, pm.SymplecticEuler(), 3 * longest)
    with pytest.warns(pm.UnstableStep), pytest.raises(pm.Diverged, match=r"bears .* up to a dt of at least") as caught:
        sim.step(1000)
    assert 0.4 * longest < caught.value.largest_safe_dt < longest


def test_a_solver_that_always_amplifies_says_so():
    p = pm.Particles([[0, 0, 0], [1.1, 0, 0]])
    p.pin([0])
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Springs([(0, 1)], k_s=1e4, rest=1.0)]), pm.Euler(), 0.05)
    with pytest.raises(pm.Diverged, match="at any dt") as caught:
        sim.step(2000)
    assert caught.value.largest_safe_dt == 0


def test_coincident_particles_are_named():
    system = pm.ParticleSystem(pm.Particles([[5, 0, 0], [1, 2, 3], [1, 2, 3]]), [pm.Gravitation()])
    sim = pm.Simulation(system, pm.Leapfrog(), 0.01)
    with pytest.raises(pm.Diverged, match="particle 1 and particle 2") as caught:
        sim.step()
    assert caught.value.force == "gravitation"
    assert caught.value.particle == 1


@pytest.mark.parametrize(
    ("force", "solver", "dt", "advice"),
    [
        (pm.Attractor(), "rk4", 0.01, "it has no finite value there, so soften it or keep particles away"),
        (pm.Harmonic(100.0), "rk4", 1.0, "the largest stable dt of rk4 is 0.283 s and dt is 1 s"),
        (
            pm.Harmonic(100.0),
            "euler",
            1.0,
            "euler amplifies this motion at any dt: use symplectic_euler, rk4 or implicit_euler",
        ),
        (
            pm.Field(("exp(1e3*(t + 1))", "0", "0")),
            "rk4",
            0.01,
            "it has no finite value there, so soften it or keep particles away",
        ),
        (pm.Field(("exp(1e4*t)", "0", "0")), "rk4", 0.5, "use a smaller dt or an implicit solver"),
        (pm.Field(("exp(1e4*t)", "0", "0")), "implicit_euler", 0.5, "use a smaller dt or a larger tolerance"),
    ],
)
def test_the_advice_fits_the_cause(force, solver, dt, advice):
    """One piece of advice, and then what was found, without another one."""
    p = pm.Particles([[0, 0, 0] if isinstance(force, pm.Attractor) else [1, 0, 0]])
    with pytest.raises(pm.Diverged) as caught:
        pm.Simulation(pm.ParticleSystem(p, [force]), solver, dt).step(1000)
    head, _, reason = str(caught.value).partition(f"force {force.name}: {advice}")
    assert head.startswith("diverged in step ")
    assert reason.startswith(" (")
    assert reason.endswith(")")
    assert "use " not in reason


def test_a_failed_step_leaves_no_newborns():
    p = pm.Particles([[0, 0, 0], [1.1, 0, 0]])
    p.pin([0])
    springs = pm.Springs([(0, 1)], k_s=1e8, rest=1.0)
    sim = pm.Simulation(pm.ParticleSystem(p, [springs]), dt=0.05, emitters=[pm.Nozzle(rate=100)])
    for _ in range(3):  # trying again gives the same error, not one about ids
        with pytest.raises(pm.Diverged):
            sim.step(1000)
        assert len(p) == 2 + 5 * sim.steps


def test_fast_particles_have_not_diverged():
    p = pm.Particles([[0, 0, 0]], [[1e5, 0, 0]])
    pm.Simulation(pm.ParticleSystem(p, [pm.Gravity()]), dt=0.1).step(100)
    assert p.x[0, 0] == pytest.approx(1e6)


@pytest.mark.parametrize("solver", ["leapfrog", "implicit_euler", "dopri5"])
def test_what_grows_by_itself_has_not_diverged(solver):
    p = pm.Particles([[0, 0, 0]])
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Field(("1e5*t", "0", "0"))]), solver, dt=0.1)
    sim.step(1000)
    assert p.v[0, 0] == pytest.approx(1e5 * 100**2 / 2, rel=2e-3)


def test_a_flow_that_carries_away_has_not_diverged():
    p = pm.Particles([[1e-6, 0, 0]])
    pm.Simulation(pm.ParticleSystem(p, [pm.Flow(("x", "0", "0"))]), dt=0.01).step(6000)
    assert p.x[0, 0] == pytest.approx(1e-6 * np.exp(60), rel=1e-6)


# ---------------------------------------------------------------------------------------------------- memory


def test_births_do_not_hold_up_those_that_they_act_on():
    p = pm.Particles([[0, 0, 0], [5, 0, 0]], v=(1, 0, 0))
    nozzle = pm.Nozzle((0, 50, 0), rate=7, speed=20, cone=0)
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.SoftSphere()]), "leapfrog", 0.1, emitters=[nozzle], compiled=False)
    sim.step(10)
    age = 1 - np.arange(7) / 7
    np.testing.assert_allclose(p.x[:2, 0], [1, 6], rtol=1e-12)
    np.testing.assert_allclose(p.age[2:], age, rtol=1e-12)
    np.testing.assert_allclose(p.x[2:, 1], 50 + 20 * age, rtol=1e-12)


@pytest.mark.parametrize("name", ["bdf2", "dopri5"])
def test_memory_follows_particles_over_births_and_deaths(name):
    # A particle that nothing links to others moves as if it were alone.
    def run(emitters):
        p = pm.Particles([[0.2, 1, 0]], [[0, 0, 1]])
        system = pm.ParticleSystem(p, [pm.Gravity(), pm.Harmonic(k_s=30.0)], [pm.Plane()])
        sim = pm.Simulation(system, SOLVERS[name](), 1 / 60, emitters=emitters)
        sim.step(90)
        return p.x[0], p.v[0]

    alone = run([])
    crowd = run([pm.Nozzle(rate=70, lifetime=0.2, position=(0, 3, 0))])
    np.testing.assert_allclose(crowd[0], alone[0], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(crowd[1], alone[1], rtol=1e-9, atol=1e-9)


def test_memory_follows_links_that_are_switched():
    p = pm.Particles([[0, 0, 0], [1.2, 0, 0], [3, 0, 0]])
    springs = pm.Springs([(0, 1)], k_s=10.0, rest=1.0)
    sim = pm.Simulation(pm.ParticleSystem(p, [springs, pm.Gravity()]), pm.DormandPrince(), 1 / 60)
    sim.step(3)
    springs.enabled = False
    sim.step(3)
    springs.enabled = True
    sim.step(3)
    assert sim.t == 9 / 60


@pytest.mark.parametrize("name", sorted(SOLVERS))
@pytest.mark.parametrize("change", ["v", "x", "pin"])
def test_a_hand_between_two_steps_is_a_new_start(name, change):
    """As bits, what was touched moves like a run that begins there; what was not touched does not notice."""

    def system(x, v):
        p = pm.Particles(x, v)
        return pm.ParticleSystem(p, [pm.Springs([(0, 1)], k_s=10.0, k_d=0.1, rest=0.5), pm.Drag(0.2), pm.Gravity()])

    def touch(p):
        if change == "pin":
            p.pin([1])
        else:
            getattr(p, change)[1] += [0.3, 0.1, -0.2]

    touched, untouched = (system([[0, 0, 0], [1, 0, 0], [5, 0, 0]], [[0, 0, 0], [0, 1, 0], [1, 2, 3]]) for _ in "ab")
    run, still = (pm.Simulation(each, SOLVERS[name](), 1 / 64) for each in (touched, untouched))
    for sim in (run, still):
        sim.step(4)
    touch(touched.particles)
    pinned_at = touched.particles.x[1].copy()
    new = system(touched.particles.x.copy(), touched.particles.v.copy())
    new.set_state(new.get_state(), run.t)
    if change == "pin":
        new.particles.pin([1])
    begun = pm.Simulation(new, SOLVERS[name](), 1 / 64)
    for sim in (run, still, begun):
        sim.step(4)
    np.testing.assert_array_equal(touched.particles.x[:2], new.particles.x[:2])
    np.testing.assert_array_equal(touched.particles.x[2], untouched.particles.x[2])
    if change == "pin":
        np.testing.assert_array_equal(touched.particles.x[1], pinned_at)


def test_run_comes_so_many_seconds_further() -> None:
    sim = pm.Simulation(pm.ParticleSystem(pm.Particles([[0, 0, 0]]), pm.Gravity()), "leapfrog", dt=1 / 240)
    sim.run(1.0)
    assert sim.steps == 240
    assert sim.system.particles.x[0, 1] == pytest.approx(-9.81 / 2, rel=1e-12)
    sim.run(0.001)
    assert sim.steps == 241
    sim.run(0)
    assert sim.steps == 241


def test_a_solver_may_be_named() -> None:
    system = pm.ParticleSystem(pm.Particles([[0, 0, 0]]))
    assert pm.Simulation(system, "backward-euler").solver.name == "implicit_euler"
    with pytest.raises(pm.InvalidInput, match=r"RK4\(\), with brackets"):
        pm.Simulation(system, pm.RK4)  # type: ignore[arg-type]


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("name", ["bdf2", "dopri5"])
def test_a_run_that_diverged_can_go_on_when_its_cause_is_gone(name, compiled):
    """Also if particles were born in the step that failed."""
    p = pm.Particles([[0, 0, 0]])
    blast = pm.Field(("exp(900*t)*1e300", "0", "0"), enabled=False)
    nozzle = pm.Nozzle(rate=70, lifetime=0.2, position=(0, 3, 0))
    system = pm.ParticleSystem(p, [pm.Gravity(), blast])
    sim = pm.Simulation(system, name, 1 / 60, emitters=[nozzle], compiled=compiled)
    sim.step(60)
    blast.enabled = True
    with pytest.raises(pm.Diverged):
        sim.step()
    blast.enabled = False
    sim.step(60)
    assert sim.t == 2.0
    assert p.x[0, 1] == pytest.approx(-9.81 * 4 / 2, rel=1e-2)


@pytest.mark.parametrize("solver", ["symplectic_euler", "rk4", "dopri5", "implicit_euler"])
def test_a_parameter_that_is_no_longer_allowed_ends_the_run(solver):
    p = pm.Particles([[0, 0, 0]], [[1, 0, 0]])
    drag = pm.Drag("0.5 - t")
    sim = pm.Simulation(pm.ParticleSystem(p, [drag]), solver, 1 / 60, emitters=[pm.Nozzle(rate=100)])
    for _ in range(2):  # nothing is left of the step that was refused
        with pytest.raises(
            pm.InvalidInput, match=r"force drag: at t = 0\.5\d* s, k = -0\.0\d* is not allowed: it must"
        ):
            sim.step(100)
        assert 0.48 < sim.t < 0.52
        assert (sim.system.t, len(p)) == (sim.t, 1 + np.ceil(100 * sim.t - 1e-9))
    drag.set(k=0.1)
    sim.step(30)


@pytest.mark.parametrize("k", ["log(t)", "-1 - t", lambda t: pm.sqrt(t - 1), "1/age"])
def test_a_parameter_is_checked_at_the_start(k):
    for particles in (pm.Particles([[0, 0, 0]]), pm.Particles([])):
        system = pm.ParticleSystem(particles, [pm.Drag(k)])
        if k == "1/age" and not len(particles):
            continue
        with pytest.raises(pm.InvalidInput, match=r"force drag: at t = 0 s, k = .* is not allowed"):
            pm.Simulation(system)


def test_a_numpy_force_is_not_asked_about_nobody():
    @pm.array_force(coupled=True)
    def gather(x, v, m, t):
        assert len(x)
        return x.mean(axis=0) - x

    for others in ([], [pm.Gravitation(eps=0.1)]):
        system = pm.ParticleSystem(pm.Particles([]), [gather, *others])
        pm.Simulation(system, emitters=[pm.Nozzle(rate=30, start=0.05)], dt=0.01).step(20)


@pytest.mark.parametrize("wrong", [None, pm.Particles([[0, 0, 0]]), 3])
def test_only_a_system_can_be_simulated(wrong):
    with pytest.raises(pm.InvalidInput, match=r"pm\.ParticleSystem"):
        pm.Simulation(wrong)
