"""A run: a system, a solver, a step, and looks at it from time to time."""

from __future__ import annotations

import logging
import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.constraints.constraint import Constraint, Step, between
from pointmass.constraints.torn import put_torn_state, torn_state
from pointmass.controllers.controller import Controller
from pointmass.deaths import Deaths
from pointmass.emitters.emitter import Birth, Emitter
from pointmass.engine.engine import Engine, compiled_by_default
from pointmass.engine.island import CHECKPOINT, Span
from pointmass.engine.kernels import grow_old
from pointmass.errors import Diverged, DividedStep, InvalidInput, UnstableStep, number, shown, unknown, whole_number
from pointmass.frame import Frame
from pointmass.lineage import Kin, Lineage
from pointmass.look import Look, Stage
from pointmass.motions import Motions, RigidMotion
from pointmass.particles import Array
from pointmass.solver_choice import AUTO, chosen
from pointmass.solvers import as_solver
from pointmass.solvers.advance import Stats, advance
from pointmass.solvers.base import Memory, Solver
from pointmass.solvers.control import control_of
from pointmass.stability import safe_bound
from pointmass.step_warning import too_long
from pointmass.system import ParticleSystem
from pointmass.zones import WHEN_FULL, WhenFull, Zone, killed, oldest, with_room

Born = list[list[Birth]]  # for each step, of each emitter

DEFAULT_DT = 1 / 240  # 60 frames a second with 4 substeps
RUNAWAY = 1e6  # times the speeds seen so far that are explained: somebody this fast is looked at
AGREE = 0.1  # of a speed: a step and two half steps that differ by more follow no motion
MANY_AGED = 1e6  # particle-steps, beyond which ages are worth a kernel
MANY_MOTIONS = 2000  # particles, beyond which the largest stable dt is not sought, but one that is surely stable
TRAILS = ("times", "counts", "ids", "places")  # what is known of them
ON_GRID = 1e-9  # of a step: a frame this near to the grid is on it


class Simulation:
    """Steps a particle system through time.

    Parameters
    ----------
    system : belongs to the simulation from now on.
    solver : a solver or the name of one; SymplecticEuler() by default, RK4() for a flow. "auto" chooses one by the
        system's fastest motion and dt: `solver_reason` says which and why, as does the logger "pointmass".
    dt : the solver's step [s], on the grid t0 + k dt with whole k; 1/240 by default. An adaptive solver makes steps
        of its own in between. How often frames are looked at changes nothing.
    emitters : where particles come from.
    zones : where particles die.
    motions : of pinned particles.
    constraints : what must hold at the end of each step, in the order in which it is made to.
    controllers : what sets parameters of the forces between steps, in this order.
    max_particles : how many there may be at the end of a step; None = any number.
    when_full : what happens beyond them: "no birth", first come, first served; or "oldest dies", of those that emitters
        have made.
    look : how frames look.
    seed : all chance comes from it.
    compiled : whether laws and solver are compiled to run at the speed of the machine (by default they are, unless the
        environment variable POINTMASS_ENGINE is "reference"). False keeps to the reference path, in NumPy; so does a
        system that has something which cannot be compiled, such as an `array_force`.

    Attributes
    ----------
    t : time now [s].
    steps : how many steps of dt were made.
    engine : what makes them.
    on_grid : called before the steps whose number is a multiple of `CHECKPOINT`, when `state` can be asked for.
    solver, solver_reason : what solves, and why it was chosen, if it was.

    Raises
    ------
    InvalidInput
        dt that is not positive, something that is not a solver or an emitter, a parameter of a force that is a function
        of t and not allowed at the start.

    Examples
    --------
    >>> sim = pm.Simulation(system, solver=pm.RK4(), dt=1 / 240)
    >>> for frame in sim.frames(240, fps=60):
    ...     print(frame.time, frame.positions[0])
    """

    def __init__(
        self,
        system: ParticleSystem,
        solver: Solver | str | None = None,
        dt: float = DEFAULT_DT,
        *,
        emitters: Sequence[Emitter] = (),
        zones: Sequence[Zone] = (),
        motions: Sequence[RigidMotion] = (),
        constraints: Sequence[Constraint] = (),
        controllers: Sequence[Controller] = (),
        max_particles: int | None = None,
        when_full: WhenFull = "no birth",
        look: Look | None = None,
        seed: int = 0,
        compiled: bool | None = None,
    ) -> None:
        if not isinstance(system, ParticleSystem):
            raise InvalidInput(f"system must be a pm.ParticleSystem, not {shown(system)}")
        self.system = system
        self.dt = number("dt", dt, above=0, unit="s")
        self.solver_reason = ""
        if solver == AUTO:
            solver, self.solver_reason = chosen(system, self.dt)
            logging.getLogger("pointmass").info("solver %s", self.solver_reason)
        self.solver = as_solver(solver or ("symplectic_euler" if system.order == 2 else "rk4"))
        self.seed = whole_number("seed", seed, at_least=0)
        self.emitters = list(emitters)
        for emitter in self.emitters:
            if not isinstance(emitter, Emitter):
                raise InvalidInput(f"emitters must be emitters, such as pm.Nozzle(), not {emitter!r}")
            system.particles.declare(*emitter.attributes_made)
        self.zones = list(zones)
        for zone in self.zones:
            if not isinstance(zone, Zone):
                raise InvalidInput(f"zones must be zones, such as pm.SphereZone(), not {shown(zone)}")
        self.motions = list(motions)
        if self.motions and system.order == 1:
            raise InvalidInput("motions lead pinned masses, and a flow has none: give the motion to its field")
        self._led = Motions.of(self.motions, self.solver, system.particles, system.t)
        self.constraints = list(constraints)
        self._bind_constraints()
        self._made: Step | None = None  # the last step, if there are constraints
        self.controllers = list(controllers)
        self._bind_controllers()
        self.max_particles = None
        if max_particles is not None:
            self.max_particles = whole_number("max_particles", max_particles, at_least=1)
        if when_full not in WHEN_FULL:
            raise unknown("value of when_full:", when_full, WHEN_FULL)
        self.when_full = when_full
        self.look = look or Look()
        self.t0 = system.t
        self.steps = 0
        self.frames_seen = 0
        wanted = compiled_by_default() if compiled is None else compiled
        watched, lasting = any(e.at_impacts for e in self.emitters), not any(c.breaks_up for c in self.constraints)
        self.engine = Engine(system, self.solver, wanted, watched=watched, lasting=lasting, motions=self._led)
        for reason in self.engine.missing() if self.engine.wanted else ():
            warnings.warn(f"this run is not compiled, because {reason}", stacklevel=2)
        self._lineage = Lineage(self.emitters, self.zones)
        self._start = system.get_state()
        self._stage = Stage(self.look, system)
        self._looks = self.t0, 0, 1.0  # time of a frame, how many were looked at from it on, and how many in a second
        p = system.particles
        self._deaths = Deaths()
        self._deaths.add(p.id, self.t0 + (p.lifetime - p.age))
        self._speed_limit = RUNAWAY * self._natural_speed()
        self._looked_at_step = self._told_of_parts = False
        self.on_grid: Callable[[], None] | None = None

    @property
    def t(self) -> float:
        """Time now [s]."""
        return self._grid(self.steps)

    def step(self, count: int = 1) -> None:
        """Make steps of dt.

        Raises
        ------
        Diverged
            The run cannot go on; the system keeps its last good state. The error names particle, force, step and the
            largest stable dt.
        InvalidInput
            A parameter that is a function of t has a value that is not allowed; the system keeps its last good state.

        Warns
        -----
        UnstableStep
            Once, before the first step: dt is too long for the springs at the start.
        DividedStep
            Once: the equations of an implicit step were not solved, and it was divided (`engine.stats.rejected`).
        """
        end = self.steps + whole_number("count", count, at_least=0)
        while self.steps < end:
            self._advance(end - self.steps)

    def prepare(self) -> None:
        """Compile what the run needs, and change nothing; the first step would do it otherwise.

        A thread may prepare a copy of a simulation, with other forces, while this one runs.
        """
        self.engine.prepare()

    def change(self, solver: Solver | str | None = None, dt: float | None = None) -> None:
        """Go on from now with another solver or step; None = as before.

        The clock's grid begins anew: `t0` is now, and `steps` counts from there.

        Raises
        ------
        InvalidInput
            dt that is not positive, something that is not a solver, a solver of masses for a flow. Nothing has changed.
        """
        dt = self.dt if dt is None else number("dt", dt, above=0, unit="s")
        reason = ""
        if solver == AUTO:
            solver, reason = chosen(self.system, dt)
        made = self.solver if solver is None else as_solver(solver)
        if self.system.order == 1 and made.moves_masses:
            raise InvalidInput(f"solver = {made.name} is not allowed: it moves masses, and a flow has none; use rk4")
        self.t0, self.steps, self.dt = self.t, 0, dt
        self.solver, self.solver_reason = made, reason
        self.engine = self.engine.of(self.system, made)
        self._led = self.engine.motions
        self._looks = self.t0, 0, 1.0
        self._made = None
        self._controlled = -1
        self._looked_at_step = False

    def run(self, seconds: float) -> None:
        """Make the steps that it takes to come `seconds` [s] further; the last one may end a little later.

        Raises
        ------
        Diverged
            As for `step`.
        """
        self.step(math.ceil(number("seconds", seconds, at_least=0, unit="s") / self.dt - ON_GRID))

    def frames(self, count: int, fps: float = 60.0) -> Iterator[Frame]:
        """Run and look: `count` frames, the first one at once, then one every 1/fps s.

        A second call goes on where the first one ended. A frame that falls between two steps is interpolated (dense
        output); it changes no state, so the run is the same for any fps.

        Raises
        ------
        InvalidInput
            A count below 1, an fps that is not positive.
        Diverged
            As for `step`.
        """
        count = whole_number("frames", count, at_least=1)
        fps = number("fps", fps, above=0, unit="1/s")
        return self._frames(count, fps)

    def frame(self, number: int = 0, t: float | None = None) -> Frame:
        """A look at the system now, or at a time within the last step; its quantities are always those of now.

        Raises
        ------
        InvalidInput
            A time that is not within the last step.
        """
        system, now = self.system, self.t if t is None else t
        if not self._grid(max(self.steps - 1, 0)) <= now <= self.t:
            raise InvalidInput(
                f"t = {t} is not allowed: only the last step, which ended at {self.t} s, can be looked at"
            )
        p = system.particles
        x, v = self._state_at(now) if now < self.t else (p.x, p.v)
        if now < self.t:
            self._led.put(p, x, v, now)
        self._stage.trails.remember(now, p.id, x)
        v = self._velocities(now, x, v)
        drawables = self.look.drawables(system, now, x, v, number, self._stage)
        return Frame(
            number=number,
            time=now,
            ids=p.id.copy(),
            positions=x.copy(),
            velocities=v,
            drawables=drawables,
            quantities=self.quantities(),
        )

    def births(self, step: int) -> list[Birth]:
        """Who is born in a step without parents, of each emitter; nothing is changed."""
        return self._births(Span(self.t0, self.dt, step, 1))[0]

    def quantities(self) -> dict[str, float]:
        """Diagnostics now: energies [J], momentum [kg m/s], largest relative stretch of a spring, particle count.

        `potential_NAME` is the part of the forces of a name, such as `potential_gravity`.
        """
        system = self.system
        result = {"particles": float(len(system.particles))}
        if system.order == 2:
            energy, momentum = system.energy(self.engine.pair_energies()), system.momentum()
            result |= {"energy": energy.total, "kinetic": energy.kinetic, "potential": energy.potential}
            result |= {f"potential_{name}": part for name, part in energy.by_force.items()}
            result |= {f"momentum_{a}": float(q) for a, q in zip("xyz", momentum, strict=True)}
            result["stretch"] = system.stretch()
        return result

    @property
    def restless(self) -> str:
        """Why `state` does not hold all of the run, as a sentence; empty if it does."""
        for controller in self.controllers:
            for name, values in controller.memory.items():
                if np.asarray(values).dtype.kind not in "biuf":
                    return f"what {type(controller).__name__} remembers as {name!r} is no array of numbers"
        return ""

    def state(self) -> dict[str, NDArray[Any]]:
        """All that the rest of the run depends on, as arrays by name; for `on_grid`.

        Another simulation of the same make goes on from there with the same bits (`put_state`), unless this one is
        `restless`. All chance is keyed, so it has no state.
        """
        now = {
            "steps": np.array([self.steps, self.frames_seen, self._looks[1]]),
            "times": np.array([self.t0, self.dt, self._looks[0], self._looks[2], self._speed_limit]),
        }
        groups: dict[str, Mapping[str, Any]] = {
            "particles": self.system.particles.state(),
            "solver": self.engine.reference.memory,
            "deaths": dict(zip(("ids", "times"), self._deaths.known(), strict=True)),
            "trails": dict(zip(TRAILS, self._stage.trails.known(), strict=True)),
        }
        groups |= {f"constraint{k}": constraint.state() for k, constraint in enumerate(self.constraints)}
        if any(constraint.breaks_up for constraint in self.constraints):
            groups |= torn_state(self.system)
        for k, kin in self._lineage.kin.items():
            groups[f"kin{k}"] = {"ids": kin.ids, "birth": kin.birth, "death": kin.death}
        for k, controller in enumerate(self.controllers):
            groups[f"controller{k}"] = controller.memory
        for k, force in enumerate(self.system.forces if self.controllers else ()):
            groups[f"force{k}"] = {name: p.numbers() for name, p in force.parameters.items() if p.may_be_put}
        return now | {f"{group}.{name}": np.array(a) for group, found in groups.items() for name, a in found.items()}

    def fits(self, state: Mapping[str, NDArray[Any]]) -> bool:
        """Whether a state can be one of this run, which is still at its start."""
        groups, mine = _grouped(state), _grouped(self.state())
        kept = [{name for name in g if name.startswith(("kin", "force"))} for g in (groups, mine)]
        begun = [float(t) for t in state["times"][:2]] == [self.t0, self.dt]
        return begun and kept[0] == kept[1] and self.system.fits(groups["particles"])

    def put_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from a `state` of a simulation of the same make; this one has made no steps yet.

        Raises
        ------
        InvalidInput
            It is the state of another simulation. Nothing has changed.
        """
        groups = _grouped(state)
        if not self.fits(state):
            raise InvalidInput(
                f"the state is that of another run, with {len(state['particles.id'])} particles and dt ="
                f" {state['times'][1]:g} s"
            )
        times = [float(t) for t in state["times"]]
        self.steps, self.frames_seen, looks = (int(k) for k in state["steps"])
        self._looks, self._speed_limit = (times[2], looks, times[3]), times[4]
        self._looked_at_step = True  # when the run began
        self.system.put_state(groups["particles"])
        put_torn_state(self.system, groups)
        for k, constraint in enumerate(self.constraints):
            if f"constraint{k}" in groups:
                constraint.put_state(groups[f"constraint{k}"])
        self.system.t = self.t
        self.engine.reference.remember(groups.get("solver", {}), Stats())
        self._deaths = Deaths()
        self._deaths.add(groups["deaths"]["ids"], groups["deaths"]["times"])
        self._stage.trails.know(*(groups["trails"][name] for name in TRAILS))
        for k in self._lineage.kin:
            self._lineage.kin[k] = Kin(**groups[f"kin{k}"])
        for k, controller in enumerate(self.controllers):
            controller.memory = groups.get(f"controller{k}", {})
        for k, force in enumerate(self.system.forces if self.controllers else ()):
            for name, values in groups.get(f"force{k}", {}).items():
                force.parameters[name].put(values if values.ndim else float(values))

    # ------------------------------------------------------------------------------------------------ inside

    def _grid(self, k: int) -> float:
        return self.t0 + k * self.dt  # never accumulated

    def _advance(self, most: int, look_inside: bool = False) -> None:
        """Make one or more steps, up to `most`, in one go if they are compiled.

        Parameters
        ----------
        look_inside : whether the state within the last step will be asked for.
        """
        if not self._looked_at_step:
            self._looked_at_step = True
            problem = too_long(self.system, self.solver, self.dt)
            if problem is not None:
                warnings.warn(problem, UnstableStep, stacklevel=3)
        if self.steps % CHECKPOINT == 0:
            for constraint in self.constraints:
                constraint.forget()
            if self.on_grid is not None:
                self.on_grid()
        most = min(most, self._control(), CHECKPOINT - self.steps % CHECKPOINT if self.on_grid else most)
        if not self.engine.compiled:
            self._step()
            return
        changes = self.emitters or self._deaths or self.engine.deadly
        parents_killed = self.engine.deadly and self._lineage.followed
        single = (changes and self.engine.coupled) or parents_killed or self.max_particles is not None
        single = single or bool(self.zones or self.constraints)
        span = Span(self.t0, self.dt, self.steps, 1 if single else min(most, self.engine.longest()))
        try:
            born = self._born(span, compiled=True)
        except Diverged:
            self._stepwise(span)
            return
        old = len(self.system.particles)
        clock = self._bear(born, span.start)
        made = self._beginning(span)
        if (
            self.engine.run(span, self._started(clock, span.start), look_inside)
            and self._slow_enough()
            and self._enforced(made)
        ):
            self._age(span, clock, old)
            self.steps += span.count
            self._bury(born, span.end)
            self._tell_of_parts()
            return
        self.engine.restore()
        self.system.remove(np.arange(old, len(self.system.particles)))
        self._stepwise(span)

    def _control(self) -> int:
        """Let the controllers look whose time has come; returns after how many steps the next one does."""
        periods = [controller.every(self.dt) for controller in self.controllers]
        if self._controlled != self.steps:
            self._controlled = self.steps
            for controller, period in zip(self.controllers, periods, strict=True):
                if self.steps % period == 0:
                    controller.control(self.system, self.t)
        return min((period - self.steps % period for period in periods), default=self.engine.longest())

    def _stepwise(self, span: Span) -> None:
        """Make a span step by step, to see what goes wrong and where."""
        for _ in range(span.count):
            self._step()

    def _step(self) -> None:
        """One step on the reference path."""
        span = Span(self.t0, self.dt, self.steps, 1)
        old = len(self.system.particles)
        try:
            born = self._born(span, compiled=False)
        except Diverged as error:
            raise self._explained(error) from error
        clock = self._bear(born, span.start)
        made = self._beginning(span)
        start = self._started(clock, span.start)
        before = self.system.get_state()
        try:
            self.engine.step(span, start)
            self._check_speed(before)
            self._enforce(made)
        except Diverged as error:
            self.system.set_state(before, span.start)
            explained = self._explained(error)
            self.system.remove(np.arange(old, len(self.system.particles)))
            raise explained from error
        except InvalidInput:  # a parameter that is no longer allowed
            self.system.set_state(before, span.start)
            self.system.remove(np.arange(old, len(self.system.particles)))
            raise
        self._age(span, clock, old)
        self.steps += 1
        self._bury(born, span.end)
        self._tell_of_parts()

    def _tell_of_parts(self) -> None:
        """Say once that implicit steps are not solved as they are."""
        count = self.engine.stats.rejected
        if self.solver.implicit and count and not self._told_of_parts:
            self._told_of_parts = True
            warnings.warn(
                f"before t = {self.t:.6g} s the equations of {self.solver.name} were not solved in a step of"
                f" {self.dt:.3g} s, so it was made in parts ({count} divisions so far): a smaller dt or a larger"
                " tolerance is faster",
                DividedStep,
                stacklevel=4,
            )

    def _bind_constraints(self) -> None:
        for constraint in self.constraints:
            if not isinstance(constraint, Constraint):
                raise InvalidInput(f"constraints must be constraints, not {shown(constraint)}")
            if self.system.order == 1:
                raise InvalidInput("constraints move masses, and a flow has none: leave them out")
            constraint.bind(self.system)

    def _bind_controllers(self) -> None:
        for controller in self.controllers:
            if not isinstance(controller, Controller):
                raise InvalidInput(f"controllers must be controllers, not {shown(controller)}")
            controller.bind(self.system, self.seed)
        self._controlled = -1  # the last step before which they have looked

    def _beginning(self, span: Span) -> Step | None:
        """What constraints have to know of a step before it is made."""
        if not self.constraints:
            return None
        p = self.system.particles
        return Step(span.start, span.end, p.id, p.x.copy(), p.v.copy())

    def _enforce(self, made: Step | None) -> None:
        """Make the constraints hold after a step."""
        if made is not None:
            try:
                for constraint in self.constraints:
                    constraint.enforce(self.system, made)
            except Diverged:
                self.system.remove(np.arange(len(made.ids), len(self.system.particles)))  # who came off in this step
                raise
            self._made = made

    def _enforced(self, made: Step | None) -> bool:
        """The same for kernels: False if it cannot be."""
        try:
            self._enforce(made)
        except Diverged:
            return False
        return True

    def _state_at(self, t: float) -> tuple[Array, Array]:
        """Positions and velocities within the last step."""
        if self._made is not None:
            return between(self._made, self.system.particles, t)
        return self.system.split(self.engine.state_at(t))

    @property
    def _streams(self) -> list[str]:
        """Names of the emitters, by which each has a chance of its own."""
        return [f"{type(e).__name__} {k}" for k, e in enumerate(self.emitters)]

    def _births(self, span: Span) -> Born:
        """Who is born without parents: drawn for all steps of a span at once."""
        times = np.array([span.time(k) for k in range(span.count + 1)])
        whole = [
            e.births(span.start, span.end, self.seed, s) for e, s in zip(self.emitters, self._streams, strict=True)
        ]
        parts = [births.parted(times) for births in whole]
        return [[steps[k] for steps in parts] for k in range(span.count)]

    def _born(self, span: Span, compiled: bool) -> Born:
        """Who is born in each step of a span, of each emitter."""
        born = self._births(span)
        born = self._lineage.foresee(self.engine, span, born, compiled, self.seed, self._streams)
        if self.max_particles is not None and self.when_full == "no birth":
            room = self.max_particles - len(self.system.particles)
            born = [with_room(births, self._lineage.order, room) for births in born]
        return born

    def _bear(self, born: Born, t0: float) -> Array | None:
        """Add the particles that are born from t0 on; returns the clock of all particles, None if all begin at t0."""
        new = [(k, birth) for births in born for k, birth in enumerate(births) if len(birth.number)]
        if not new:
            return None
        old = len(self.system.particles)
        names = dict.fromkeys(name for _, birth in new for name in birth.columns)
        columns = {name: np.concatenate([birth.column(name) for _, birth in new]) for name in names}
        x, v, lifetime = (np.concatenate([getattr(b, name) for _, b in new]) for name in ("x", "v", "lifetime"))
        self.system.add(x, v, lifetime=lifetime, id=np.concatenate([birth.ids(k) for k, birth in new]), **columns)
        clock = np.full(len(self.system.particles), t0)
        clock[old:] = np.maximum(np.concatenate([birth.time for _, birth in new]), t0)
        return clock

    def _started(self, clock: Array | None, t0: float) -> Array | None:
        """The clock at which each particle begins to move; None if all do at t0.

        Those whom others act on all move from t0 on: who is born later among them starts so far back on a straight
        line that it comes to its place at its time.
        """
        if clock is None or not self.engine.coupled:
            return clock
        p, islands = self.system.particles, self.system.island_of_particle
        early = (np.bincount(islands)[islands] > 1) & (clock > t0)
        p.x[early] -= (p.v[early] * (clock[early] - t0)[:, None]).astype(p.dtype)
        return np.where(early, t0, clock)

    def _age(self, span: Span, clock: Array | None, old: int) -> None:
        """Let all grow older by a span.

        Those beyond the first `old` were born in it, each at its clock; those beyond all clocks came off others at its
        end, and are as old as they were at its start.
        """
        p = self.system.particles
        age, many = p.age, old if clock is None else len(clock)
        steps = [(span.time(k), span.time(k + 1)) for k in range(span.count)]
        if old * span.count > MANY_AGED:
            grow_old(age[:old], np.array([t1 - t0 for t0, t1 in steps]).astype(age.dtype))
        else:
            for t0, t1 in steps:
                age[:old] += np.asarray(t1 - t0, age.dtype)
        if clock is not None:
            for t0, t1 in steps:
                age[old:many] += np.asarray(t1 - np.clip(clock[old:], t0, t1), age.dtype)
        if many < len(p):
            age[many:] += np.asarray(span.end - span.start, age.dtype)
            self._deaths.add(p.id[many:], span.end + (p.lifetime - age)[many:])

    def _bury(self, born: Born, t1: float) -> None:
        """Take away those whose time has come by t1, whom a surface killed, who are in a zone, and who are too many."""
        new = [(k, birth) for births in born for k, birth in enumerate(births) if len(birth.number)]
        if new:
            self._deaths.add(*(np.concatenate(a) for a in zip(*((b.ids(k), b.death) for k, b in new), strict=True)))
        self._lineage.settle(born, t1)
        p = self.system.particles
        rows = p.rows(np.append(self._deaths.due(t1), self._lineage.taken))
        if self.zones or len(self.engine.died) or len(rows):
            gone = killed(self.zones, p.x, t1, p.age > 0) if self.zones else np.zeros(len(p), bool)
            gone[self.engine.died] = True
            spared = p.rows(self._lineage.spared)
            gone[spared[spared >= 0]] = False
            gone[rows[rows >= 0]] = True
            if gone.any():
                self.system.remove(gone)
        if self.max_particles is not None and len(p) > self.max_particles:
            self.system.remove(oldest(p, len(p) - self.max_particles))

    def _frames(self, count: int, fps: float) -> Iterator[Frame]:
        for _ in range(count):
            looks, time = self._next_look(fps)
            k = (time - self.t0) / self.dt
            on_grid = abs(k - round(k)) < ON_GRID * max(1.0, k)
            steps = round(k) if on_grid else math.ceil(k)
            self.step(max(0, steps - self.steps - (not on_grid)))
            if self.steps < steps:
                self._advance(1, look_inside=True)
            self._looks = looks
            number, self.frames_seen = self.frames_seen, self.frames_seen + 1
            yield self.frame(number, self._grid(steps) if on_grid else time)

    def _next_look(self, fps: float) -> tuple[tuple[float, int, float], float]:
        """When the next frame is due [s], now if it is the first one, or if the run has gone past it; and `_looks`
        then."""
        since, looks, rate = self._looks
        if fps != rate and looks:
            since, looks = since + (looks - 1) / rate, 1
        time = since + looks / fps
        if time < (self.t if looks == 0 else self._grid(self.steps - 1)):
            since, looks, time = self.t, 0, self.t
        return (since, looks + 1, fps), time

    def _velocities(self, t: float, x: Array, v: Array) -> Array:
        """Velocities of a frame; in a flow they are the field's."""
        if self.system.order == 2:
            return v.copy()
        return self.system.deriv_eval(t, x.ravel()).reshape(-1, 3)

    # ------------------------------------------------------------------------------------------------ divergence

    def _natural_speed(self) -> float:
        """The largest speed that the start explains: that of the particles, of their fall for a second, across the
        scene."""
        p, rate = self.system.particles, self.engine.start()
        if not len(p):
            return 10.0
        extent = float(np.ptp(p.x, axis=0).max())
        size = float(np.abs(rate[np.isfinite(rate)]).max(initial=0.0))
        return max(1.0, extent, size, float(np.abs(p.v).max(initial=0.0)))

    def _check_speed(self, before: Array) -> None:
        """Speeds may grow, as in a field that does; but not because steps are too long for the motion."""
        p = self.system.particles
        if self._slow_enough():
            return
        one, two = (self._end_of(before, pieces)[-3 * len(p) :] for pieces in (1, 2))
        if not np.abs(one - two).max() <= AGREE * np.abs(two).max():
            raise Diverged("speeds grow without bound")
        self._speed_limit = RUNAWAY * max(self.engine.fastest, self.engine.farthest)

    def _slow_enough(self) -> bool:
        """Whether nobody is much faster, or farther away, than all that the run has shown so far explains."""
        limit = self._speed_limit
        return control_of(self.solver) is not None or (
            self.engine.fastest <= limit and self.engine.farthest <= 1e3 * limit
        )

    def _end_of(self, y: Array, pieces: int) -> Array:
        """State at the end of the step that began at `y`, if there were no colliders, made in pieces."""
        h = self.dt / pieces
        memory: Memory = {}
        for k in range(pieces):
            start = self.t + k * h
            y, memory, _ = advance(self.system, self.solver, start, start + h, y, memory)
        return y

    def _explained(self, error: Diverged) -> Diverged:
        """The error with everything that a user wants to know."""
        p = self.system.particles
        row, force, singular, partners = culprit(self.system)
        where = f"particle {p.id[row]}" if len(p) else "no particle"
        if partners:
            where += f" and particle {', '.join(str(p.id[r]) for r in partners[:3])}"
        limit, exact = self._largest_safe_dt()
        reason, _, own = str(error).partition(": ")
        advice = self._advice(singular, limit, exact) or own or "use a smaller dt or softer forces"
        return Diverged(
            f"diverged in step {self.steps} (t = {self.t:.6g} s) at {where}, force {force}: {advice} ({reason})",
            particle=int(p.id[row]) if len(p) else None,
            force=force,
            step=self.steps,
            time=self.t,
            largest_safe_dt=limit,
        )

    def _advice(self, singular: bool, limit: float | None, exact: bool) -> str:
        """What to do, where the forces tell; else an empty string.

        Parameters
        ----------
        exact : whether the limit is the largest stable dt, not a bound that is below it.
        """
        if singular:
            return "it has no finite value there, so soften it or keep particles away"
        if limit == 0:
            return f"{self.solver.name} amplifies this motion at any dt: use symplectic_euler, rk4 or implicit_euler"
        if limit is not None and limit < self.dt and not exact:
            return (
                f"{self.solver.name} bears the stiffness of these forces up to a dt of at least {limit:.3g} s, and dt"
                f" is {self.dt:.3g} s"
            )
        if limit is not None and limit < self.dt:
            return f"the largest stable dt of {self.solver.name} is {limit:.3g} s and dt is {self.dt:.3g} s"
        return ""

    def _largest_safe_dt(self) -> tuple[float | None, bool]:
        """From the stiffnesses at the start of the run, before anything was torn apart, and whether it is exact.

        Of many particles it is a step that is safe, as all their motions take minutes to find.
        """
        system = self.system
        exact = system.order == 1 or len(system.particles) <= MANY_MOTIONS
        now = system.get_state()
        system.set_state(self._start if self._start.shape == now.shape else now)
        try:
            if exact:
                return system.stability(self.solver).largest_safe_dt, exact
            return safe_bound(system, self.solver), exact
        except InvalidInput:
            return None, exact
        finally:
            system.set_state(now)


def _grouped(state: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, Any]]:
    """A state by the parts of the run that it is of."""
    groups: dict[str, dict[str, Any]] = {}
    for key, values in state.items():
        group, _, name = key.partition(".")
        groups.setdefault(group, {})[name] = values
    return groups


def culprit(system: ParticleSystem) -> tuple[int, str, bool, list[int]]:
    """Row of the particle that is worst off, the force that acts most on it, whether that is singular there, and if so
    rows of its partners in that force."""
    p = system.particles
    if not len(p):
        return 0, "none", False, []
    strengths: dict[str, NDArray[Any]] = {}
    forces = [f for f in system.forces if f.enabled]
    for force in forces:
        f = np.zeros_like(p.x)
        with np.errstate(all="ignore"):
            force.add_forces(p, system.t, p.x, p.v, f)
            strengths[force.name] = np.where(np.isfinite(f).all(axis=1), np.sqrt((f * f).sum(axis=1)), np.inf)
    with np.errstate(all="ignore"):
        speed = np.where(p.pinned, 0, np.sqrt((p.v * p.v).sum(axis=1)))
    total = sum(strengths.values(), np.zeros(len(p)))
    row = int(np.argmax(~np.isfinite(total))) if not np.isfinite(total).all() else int(np.argmax(speed))
    if not strengths:
        return row, "none", False, []
    name = max(strengths, key=lambda n: strengths[n][row])
    force = next(f for f in forces if f.name == name)
    singular = not np.isfinite(strengths[name][row])
    return row, name, singular, force.partners(p, row) if singular else []
