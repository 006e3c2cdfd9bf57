"""Resting contact: a surface bears what rests on it, and friction holds or brakes (Witkin, Particle System Dynamics).

A particle stands on a surface while it is within eps of it, pressed towards it, and so slow that its next bounce would
not lift it by eps: |N . v| < sqrt(2 a eps). The forces on it are filtered between calculate and gather: their part
into the surface is taken away, and Coulomb friction of at most mu times that load works along it. Where a surface
makes particles stick, everybody within eps of it stands, and it takes all forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, directions, lengths, rows_dot

Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]
PASSES = 64  # over the contacts of a particle that stands on more than one surface
SETTLED = 1e-13  # relative change of its contact forces at which the passes end
STILL = 64.0  # roundings of a velocity: a slower one along a surface is none
CREEP = 1e-9  # of the speed that counts as resting across a surface: one that is slower along it has been stopped
NONE = np.zeros(3)


@dataclass(eq=False)
class Standing:
    """The particles that stand on one surface, during one piece of a step.

    Attributes
    ----------
    rows : of the particles.
    start : where they are on the surface at first [m], shape (k, 3).
    level : depth at which each stands [m], 0 unless it began the piece inside, shape (k,).
    slide : direction in which each slides along the surface, 0 for those that stick, shape (k, 3).
    speed : of the slide at first [m/s], shape (k,).
    load : force with which each is pressed on at first [N], shape (k,).
    given : force of the contact at the last evaluation, shape (k, 3).
    normal : normals there, shape (k, 3).
    pressed, held : whether it was pressed on there, and friction held it in its place.
    glued : whether the surface makes all of them stick.
    drag : of those that friction brakes by a drag [N s/m], else 0, shape (k,).
    drift : velocity along the surface at the last evaluation [m/s], shape (k, 3).
    friction : Coulomb's mu.
    """

    surface: Collider
    rows: Rows
    start: Array
    level: Array
    slide: Array
    speed: Array
    load: Array
    given: Array = field(init=False)
    normal: Array = field(init=False)
    pressed: Mask = field(init=False)
    held: Mask = field(init=False)
    drag: Array = field(init=False)
    drift: Array = field(init=False)

    def __post_init__(self) -> None:
        k = len(self.rows)
        self.given, self.normal = np.zeros((k, 3)), np.zeros((k, 3))
        self.pressed, self.held = np.zeros(k, bool), np.zeros(k, bool)
        self.drag, self.drift = np.zeros(k), np.zeros((k, 3))
        self.sticks = (self.slide == 0).all(axis=1)
        self.glued = self.surface.response == "stick"
        self.friction = self.surface.impact[1]

    def motion(self, t: Array) -> tuple[Array, Array]:
        """Place and velocity of the surface at the clocks of all particles, for each row."""
        now = t[self.rows]
        return self.surface.at(now), self.surface.velocity(now)


class Contacts:
    """The filter on forces. It is set up before each piece of a step and stays the same during it.

    With `lagged`, loads and whether friction holds are those of the start of the piece, and what stands then cannot
    lift off before the next one: the filter is then linear, and Newton's method sees its exact Jacobian. A force that
    stays the same may turn round a particle that springs hold back in a long step, and bring energy. So where the
    length of the step is given to `find`, friction is a drag that has Coulomb's size at the velocity to which the
    forces of the start lead; it holds at once whom it would stop. With steady forces that is the same.
    """

    def __init__(self, surfaces: Sequence[Collider], order: int, lagged: bool) -> None:
        self.surfaces = surfaces
        self.order = order
        self.lagged = lagged
        self.standing: list[Standing] = []
        self._several = np.zeros(0, bool)  # who stands on more than one surface

    def on(self, surface: Collider) -> Rows:
        """Rows of the particles that stand on a surface."""
        return next((s.rows for s in self.standing if s.surface is surface), np.zeros(0, np.intp))

    def find(
        self,
        x: Array,
        v: Array,
        m: Array,
        acceleration: Callable[[], Array],
        t: Array,
        radius: Array,
        free: Mask,
        braking: Array | None = None,
    ) -> None:
        """Find out who stands where, and stop their motion into and out of the surface.

        Parameters
        ----------
        x, v : state at the start of the piece, shape (n, 3); `v` is changed in place.
        acceleration : gives the unfiltered accelerations, shape (n, 3); called only where something is near a surface.
        t : clock of each particle, shape (n,).
        free : which particles to look at.
        braking : how long the velocity that friction sees is under way, where friction is to be a drag [s], shape (n,);
            0, or None for all, where it is to be a force.
        """
        braking = np.zeros(len(x)) if braking is None else braking
        self.standing = []
        a: Array | None = None
        for surface in self.surfaces:
            if surface.response == "kill":
                continue
            gap = surface.distance(x, t) - radius
            rows = np.flatnonzero(free & (gap <= surface.eps))
            if len(rows):
                a = acceleration() if a is None else a
                self._stand(surface, rows, gap[rows], x, v, m, a, t)
        on = np.concatenate([s.rows for s in self.standing]) if self.standing else np.zeros(0, np.intp)
        self._several = np.bincount(on, minlength=len(x)) > 1
        if self.order == 2:
            self._relax(np.ones(len(x), bool), lambda stand, go: self._stop(stand, v, t, go))
        for stand in self.standing:
            self._choose_slide(stand, v, m, a, t, braking[stand.rows])

    def forces(self, t: Any, x: Array, v: Array, m: Array, f: Array) -> None:
        """Take away what presses into the surfaces, and add friction (projected Gauss-Seidel over the contacts)."""
        looks = {id(stand): self._look(stand, t, x, v, m) for stand in self.standing}

        def bear(friction: bool) -> Callable[[Standing, Mask], Mask]:
            return lambda stand, go: self._bear(stand, *looks[id(stand)], f, friction, go)

        # Loads before friction: in a corner, friction would else be spent on what another surface bears.
        self._relax(self._several, bear(friction=False))
        self._relax(np.ones(len(x), bool), bear(friction=True))

    def projection(self, n: int) -> Array:
        """Directions in which contacts leave particles free, shape (n, 3, 3): what the lagged filter does to df.

        None where it sticks, along the surface where it slides.
        """
        blocks: Array = np.tile(np.eye(3), (n, 1, 1))
        for stand in self.standing:
            across = np.eye(3) - stand.normal[:, :, None] * stand.normal[:, None, :]
            hold = stand.sticks & (stand.friction > 0)
            blocks[stand.rows] = np.where(hold[:, None, None], 0, _products(across, blocks[stand.rows]))
        shared = blocks[self._several]
        for _ in range(PASSES.bit_length() - 1):  # to the power of PASSES
            shared = _products(shared, shared)
        blocks[self._several] = shared
        return blocks

    def drag(self, n: int) -> Array:
        """What friction adds to -df/dv of each particle in those directions [N s/m], shape (n,)."""
        result = np.zeros(n)
        for stand in self.standing:
            result[stand.rows] += stand.drag
        return result

    def settle(self, x: Array, v: Array, t: Array, h: Array, radius: Array) -> None:
        """Bring those that stood back to their surface at the end of a piece; in place.

        Who is held by friction goes where its place on the surface goes, whom friction stopped is where it came to
        rest, who is pressed on is put back on the surface, and nobody is left inside.

        Parameters
        ----------
        t, h : clock at the end of the piece, and its length, of each particle, shape (n,).
        """
        for stand in self.standing:
            self._hold(stand, x, v, t, h)
        self._relax(np.ones(len(x), bool), lambda stand, go: self._put_back(stand, x, v, t, h, radius, go))

    def _relax(self, active: Mask, once: Callable[[Standing, Mask], Mask]) -> None:
        """Go over the contacts of each particle, surface by surface, until its own have settled.

        Who stands on one surface is done at once: its bits do not depend on others.

        Parameters
        ----------
        active : which particles, shape (n,).
        once : changes one contact of those rows of a `Standing` that a mask marks; returns where that did something.
        """
        for _ in range(PASSES):
            changed = np.zeros(len(active), bool)
            for stand in self.standing:
                go = active[stand.rows]
                if go.any():
                    changed[stand.rows] |= go & once(stand, go)
            active = changed & self._several
            if not active.any():
                return

    # ------------------------------------------------------------------------------------------------ at the start

    def _stand(
        self, surface: Collider, rows: Rows, gap: Array, x: Array, v: Array, m: Array, a: Array, t: Array
    ) -> None:
        """Add those of `rows` that stand."""
        now = t[rows]
        local = x[rows] - surface.at(now)
        normal, motion = surface.local_normal(local), surface.velocity(now)
        if self.order == 1:
            lift = rows_dot(a[rows] - motion, normal)
            stands = lift < 0
        else:
            relative = v[rows] - motion
            lift = rows_dot(a[rows] - surface.acceleration(now), normal) + surface.bending(local, relative)
            slow = np.abs(rows_dot(relative, normal)) <= np.sqrt(2 * surface.eps * np.abs(lift))
            stands = (lift < 0) & slow
        if surface.response == "stick":
            stands = np.ones(len(rows), bool)
        rows = rows[stands]
        if len(rows):
            level = np.where(gap < -surface.eps, gap, 0)[stands]
            nothing = np.zeros((len(rows), 3))
            load = -lift[stands] * m[rows]
            self.standing.append(Standing(surface, rows, local[stands], level, nothing, nothing[:, 0], load))
            self.standing[-1].normal = normal[stands]

    def _stop(self, stand: Standing, v: Array, t: Array, go: Mask) -> Mask:
        """Take the velocity into and out of the surface; where there was any."""
        _, motion = stand.motion(t)
        speed = rows_dot(v[stand.rows] - motion, stand.normal)
        after = v[stand.rows] - speed[:, None] * stand.normal
        v[stand.rows] = np.where(go[:, None], after, v[stand.rows])
        moving: Mask = np.abs(speed) > _roundoff(v[stand.rows], motion)
        return moving

    def _choose_slide(self, stand: Standing, v: Array, m: Array, a: Array | None, t: Array, braking: Array) -> None:
        """Who slides along the surface, and in which direction friction will work."""
        if self.order == 1:
            return
        assert a is not None
        rows, surface = stand.rows, stand.surface
        _, motion = stand.motion(t)
        if stand.glued:
            v[rows] = motion
            return
        relative = v[rows] - motion
        relative -= rows_dot(relative, stand.normal)[:, None] * stand.normal
        speed = lengths(relative)
        bounce = np.sqrt(2 * surface.eps * stand.load / m[rows])  # across the surface this speed counts as resting
        creep = max(CREEP, STILL * float(np.finfo(v.dtype).eps)) * bounce
        speed = np.where(speed > _roundoff(v[rows], motion) + creep, speed, 0)
        stand.speed, stand.slide = speed, directions(relative, speed, NONE)
        v[rows] = np.where((speed == 0)[:, None], motion, v[rows])
        if self.lagged:
            push = a[rows] - surface.acceleration(t[rows])
            along = push - rows_dot(push, stand.normal)[:, None] * stand.normal
            pull = lengths(along)
            slips = (speed == 0) & (pull * m[rows] > stand.friction * stand.load)
            stand.slide = np.where(slips[:, None], directions(along, pull, NONE), stand.slide)
            self._choose_drag(stand, v, m, along, motion, braking)
        stand.sticks = (stand.slide == 0).all(axis=1)

    def _choose_drag(self, stand: Standing, v: Array, m: Array, along: Array, motion: Array, braking: Array) -> None:
        """Make friction a drag where it is `braking`, and let it hold those that it would stop."""
        slides = (braking > 0) & (stand.friction > 0) & (stand.slide != 0).any(axis=1)
        most = stand.friction * stand.load
        later = stand.speed + braking * (rows_dot(along, stand.slide) - most / m[stand.rows])
        stops = slides & ~(later > 0)
        drags = slides & ~stops
        stand.drag = np.where(drags, most / np.where(drags, later, 1), 0)
        stand.speed = np.where(slides, 0, stand.speed)
        stand.slide = np.where(stops[:, None], 0, stand.slide)
        v[stand.rows] = np.where(stops[:, None], motion, v[stand.rows])

    # ------------------------------------------------------------------------------------------------ during the piece

    def _look(self, stand: Standing, t: Any, x: Array, v: Array, m: Array) -> tuple[Array, Array]:
        """The force that would move each along with the surface, and that which it takes to follow its bend."""
        surface, rows = stand.surface, stand.rows
        now = t[rows] if isinstance(t, np.ndarray) else t
        local = x[rows] - surface.at(now)
        stand.normal = surface.local_normal(local)
        stand.given = np.zeros((len(rows), 3))
        if self.order == 1:
            return np.broadcast_to(surface.velocity(now), local.shape), np.zeros(len(rows))
        mass = m[rows]
        relative = v[rows] - surface.velocity(now)
        stand.drift = relative - rows_dot(relative, stand.normal)[:, None] * stand.normal
        bend = surface.bending(local, relative)
        return mass[:, None] * surface.acceleration(now), mass * bend

    def _bear(self, stand: Standing, carried: Array, bend: Array, f: Array, friction: bool, go: Mask) -> Mask:
        """Give each contact the force that it bears now; where that is another than before."""
        free = f[stand.rows] - stand.given - carried
        if stand.glued:
            stand.held = stand.held | go
            return self._give(stand, -free, f, go)
        normal = stand.normal
        into = rows_dot(free, normal)
        load = -(into + bend)
        if self.lagged:
            stand.pressed = np.ones(len(load), bool)
        else:
            stand.pressed = np.where(go, load > 0, stand.pressed)
            load = np.where(load > 0, load, 0)
        given = load[:, None] * normal
        if friction and self.order == 2 and stand.friction > 0:
            force, held = self._friction(stand, free - into[:, None] * normal, load)
            given = given + force
            stand.held = np.where(go, held, stand.held)
        return self._give(stand, given, f, go)

    def _give(self, stand: Standing, given: Array, f: Array, go: Mask) -> Mask:
        """Change the force of contacts to `given`; where that is another than before."""
        rows = stand.rows
        change = given - stand.given
        f[rows] = np.where(go[:, None], f[rows] + change, f[rows])
        stand.given = np.where(go[:, None], given, stand.given)
        changed: Mask = lengths(change) > SETTLED * lengths(given)
        return changed

    def _friction(self, stand: Standing, along: Array, load: Array) -> tuple[Array, Mask]:
        """Friction against the force `along` a surface, or against the slide, and whom it holds."""
        if self.lagged:
            most = stand.friction * stand.load
            held = stand.sticks
            hold = along
        else:
            most = stand.friction * load
            size = lengths(along)
            held = stand.sticks & (size <= most)
            hold = np.minimum(most / np.where(size > 0, size, 1), 1)[:, None] * along
        brake = np.where((stand.drag > 0)[:, None], stand.drag[:, None] * stand.drift, most[:, None] * stand.slide)
        return -np.where(stand.sticks[:, None], hold, brake), held

    # ------------------------------------------------------------------------------------------------ at the end

    def _hold(self, stand: Standing, x: Array, v: Array, t: Array, h: Array) -> None:
        """Put those that friction held, or stopped, where they are to be."""
        if not stand.glued and (self.order == 1 or stand.friction == 0):
            return
        rows = stand.rows
        place, motion = stand.motion(t)
        went = h[rows] > 0
        held = went & stand.held
        x[rows] = np.where(held[:, None], stand.start + place, x[rows])
        v[rows] = np.where(held[:, None], motion, v[rows])
        now = rows_dot(v[rows] - motion, stand.slide)
        stopped = went & (now < 0) & (stand.speed > 0)
        way = 0.5 * h[rows] * (stand.speed * stand.speed) / np.where(stopped, stand.speed - now, 1)  # until it stopped
        beyond = rows_dot(x[rows] - place - stand.start, stand.slide) - way
        x[rows] = np.where(stopped[:, None], x[rows] - beyond[:, None] * stand.slide, x[rows])
        v[rows] = np.where(stopped[:, None], v[rows] - now[:, None] * stand.slide, v[rows])

    def _put_back(self, stand: Standing, x: Array, v: Array, t: Array, h: Array, radius: Array, go: Mask) -> Mask:
        """Put those that are pressed on back on the surface, and those that sank out of it; where there were any."""
        rows, surface = stand.rows, stand.surface
        place, motion = stand.motion(t)
        local = x[rows] - place
        normal = surface.local_normal(local)
        gap = surface.local_distance(local) - radius[rows] - stand.level
        pressed = stand.pressed & ~(gap > surface.eps) if surface.lookup else stand.pressed  # or it went over an edge
        on = go & (h[rows] > 0) & (pressed | (gap < 0))
        off = np.where(on & ((gap < 0) | (gap > surface.eps)), gap, 0)
        x[rows] = np.where(on[:, None], x[rows] - off[:, None] * normal, x[rows])
        if self.order == 2:
            speed = rows_dot(v[rows] - motion, normal)
            across = on & (pressed | (speed < 0))
            v[rows] = np.where(across[:, None], v[rows] - speed[:, None] * normal, v[rows])
        moved: Mask = np.abs(off) > _roundoff(x[rows], place)
        return moved


def _products(a: Array, b: Array) -> Array:
    """Products of 3 x 3 matrices, shape (k, 3, 3), each added up in order: matmul's order depends on the machine."""
    result: Array = a[:, :, 0:1] * b[:, 0:1] + a[:, :, 1:2] * b[:, 1:2] + a[:, :, 2:3] * b[:, 2:3]
    return result


def _roundoff(v: Array, motion: Array) -> Array:
    """Size of a difference between `v` and `motion` that is round-off, for each row."""
    scale: Array = np.abs(v).max(axis=1) + np.abs(motion).max(axis=-1)
    return STILL * np.finfo(v.dtype).eps * scale
