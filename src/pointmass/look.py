"""How a simulation looks: turns particles, springs, fields and colliders into the drawables of a frame."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pointmass import animals, over_life, random
from pointmass.bodies.hair import STRAND
from pointmass.collisions.collider import Collider
from pointmass.collisions.plane import Plane
from pointmass.colors import PALETTES, Color, blackbody, linear, palette
from pointmass.errors import InvalidInput, about, finite_array, number, shown, unknown, whole_number
from pointmass.flow_field import field_arrows, field_of, streamlines
from pointmass.forces.muscles import Muscles
from pointmass.forces.springs import Springs
from pointmass.frame import PATTERNS, Curves, Drawable, Points, Segments, Triangles
from pointmass.over_life import Curve, Gradient
from pointmass.particles import Array, Particles
from pointmass.skin import Skin
from pointmass.strands import Strands
from pointmass.system import ParticleSystem

KINDS = ("solid", "glow", "smoke", "flakes", *animals.SHAPES, "none")  # of particles
OF_GROUP = "particles of "
OWN_COLOR = ("red", "green", "blue")  # attributes: linear light
OF_PARTICLES = (  # what a group may have otherwise
    *(
        "particles",
        "size",
        "color",
        "color_by",
        "color_range",
        "palette",
        "brightness",
        "opacity",
        "daylight",
        "shutter",
    ),
    *("pattern", "pattern_color", "pattern_count"),
    *("size_over_life", "brightness_over_life", "opacity_over_life", "color_over_life"),
)
SMALLEST_FLAKE, LARGEST_FLAKE = 0.5, 1.5  # times the size
EYES = "#0b0d10"
SHORT, LONG = "#ff3b30", "#3a6df0"  # colours of a muscle that is by FAR shorter or longer than at rest
FAR = 0.15
FAMILY_COLORS = {"stretch": "#5fa8ff", "shear": "#5fe3a1", "bend": "#ff6b6b", "volume": "#ff6b6b"}  # as on the slide


@dataclass(frozen=True, kw_only=True)
class Look:
    """What a frame shows.

    Attributes
    ----------
    particles : "solid": shaded balls; "glow": points of light; "smoke": soft puffs that shade each other; "flakes":
        matt flakes of many sizes and directions; "birds", "fish": they look where they go; "none".
    size : radius at which particles are drawn, of animals half their length [m]; None = their own radius, or 1% of the
        scene if they have none.
    color : of particles, a name, "#rrggbb", or the temperature [K] at which a body glows in this colour. Particles with
        attributes red, green and blue (linear light) have their own.
    color_by : "speed", "age", "id" or a particle attribute: colours from the palette instead; "temperature": that of
        each particle's attribute temperature [K].
    color_range : values at both ends of the palette; None = those of the frame.
    palette : fire, ice, spectrum, aurora or viridis.
    brightness : factor on the light of particles.
    opacity : of particles, from 0 to 1; of a puff of smoke in its middle.
    daylight : factor on the light of the picture's lamps on smoke and flakes; 0: only what glows lights them.
    size_over_life, brightness_over_life, opacity_over_life : factors on these over the life of a particle, as pairs of
        a fraction of its lifetime and a value, straight in between: [[0, 1], [0.8, 1], [1, 0]]; or grow, fade, last,
        swell, flare. A particle that never dies stays at the first value.
    color_over_life : pairs of a fraction of the lifetime and a colour or temperature [K], or cooling, or the name of a
        palette: colours instead of `color`, on which `color_by` and particles' own colours are factors.
    groups : other looks for some particles, by the name of a group, or of an attribute that is not 0 for them; tables
        of what is said here of particles. Who is in several has the first.
    shutter : exposure time [s], 0 = a moment: a glowing particle is a streak as long as the way that it went meanwhile,
        and as much dimmer; a ball or a flake is smeared along its way. Films have half the time between two frames.
    surfaces : whether the surfaces and skins of bodies are drawn, such as cloth, in place of their particles, but for
        those of `groups`. A group with the name of a body is the look of its surface.
    pattern : of surfaces: "plain", "checker", or "stripes" side by side, and "bands" one above the other, in turns of
        the particles' colour and `pattern_color`.
    pattern_color : see there.
    pattern_count : fields of the pattern along each side.
    springs : whether springs are drawn, as lines of `spring_width` [m] (None = 0.3% of the scene) and `spring_color`
        (None = by family, and muscles red where they are short and blue where they are long); None = those that are not
        in a surface that is drawn. Those of hair are drawn as strands, `spring_width` thick at the root.
    strand_color, tip_color : of hair at its roots and at its tips.
    children : strands drawn between each strand of hair and its neighbours, which are not simulated.
    children_seed : another one gives other children.
    clump : how far children draw near to their strand from root to tip, 0 to 1: curls then keep their shape.
    trails : length of the particles' trails [s], 0 = none.
    arrows : arrows of a flow, or of the air, along the longest side, 0 = none.
    streamlines : integral curves of a flow, or of the air, 0 = none.
    field_box : corners of the box in which arrows and integral curves are drawn [m]; None = that of the particles at
        the start.
    colliders : whether surfaces are drawn, in `collider_color`.
    floor_size : edge of the part of an infinite plane that is drawn [m]; None = 3 times the scene, and for a floor as
        far as one can see.
    """

    particles: Literal["solid", "glow", "smoke", "flakes", "birds", "fish", "none"] = "solid"
    size: float | None = None
    color: Color = "#ffb454"
    color_by: str | None = None
    color_range: tuple[float, float] | None = None
    palette: str = "fire"
    brightness: float = 1.0
    opacity: float = 1.0
    daylight: float = 1.0
    size_over_life: Curve | None = None
    brightness_over_life: Curve | None = None
    opacity_over_life: Curve | None = None
    color_over_life: Gradient | None = None
    shutter: float = 0.0
    groups: Groups | None = None
    surfaces: bool = True
    pattern: Literal["plain", "checker", "stripes", "bands"] = "plain"
    pattern_color: Color = "#f4efe6"
    pattern_count: int = 8
    springs: bool | None = None
    spring_width: float | None = None
    spring_color: Color | None = None
    strand_color: Color = "#4a2f1c"
    tip_color: Color = "#a9713c"
    children: int = 0
    children_seed: int = 0
    clump: float = 0.0
    trails: float = 0.0
    arrows: int = 0
    streamlines: int = 0
    field_box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    colliders: bool = True
    collider_color: Color = "#5b6678"
    floor_size: float | None = None

    def __post_init__(self) -> None:
        self._check_names()
        whole_number("look.pattern_count", self.pattern_count, at_least=1)
        strands = (self.strand_color, self.tip_color)
        for color in (self.color, self.pattern_color, self.collider_color, self.spring_color, *strands):
            if color is not None:
                linear(color)
        for name in ("size", "spring_width", "floor_size"):
            if getattr(self, name) is not None:
                number(f"look.{name}", getattr(self, name), above=0, unit="m")
        number("look.brightness", self.brightness, at_least=0)
        number("look.opacity", self.opacity, at_least=0, at_most=1)
        number("look.clump", self.clump, at_least=0, at_most=1)
        number("look.daylight", self.daylight, at_least=0)
        number("look.shutter", self.shutter, at_least=0, unit="s")
        for name, most in (("size_over_life", None), ("brightness_over_life", None), ("opacity_over_life", 1.0)):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, over_life.as_curve(f"look.{name}", getattr(self, name), most))
        if self.groups is not None:
            object.__setattr__(self, "groups", {name: _of_group(name, look) for name, look in self.groups.items()})
        if self.color_over_life is not None:
            gradient = over_life.as_gradient("look.color_over_life", self.color_over_life)
            object.__setattr__(self, "color_over_life", gradient)
        number("look.trails", self.trails, at_least=0, unit="s")
        if self.field_box is not None:
            finite_array("look.field_box", self.field_box, (2, 3))
        for name in ("arrows", "streamlines", "children", "children_seed"):
            whole_number(f"look.{name}", getattr(self, name), at_least=0)

    def _check_names(self) -> None:
        if self.particles not in KINDS:
            raise InvalidInput(f"look.particles = {self.particles!r} is not allowed: it must be {', '.join(KINDS)}")
        for what, name, known in (("palette", self.palette, PALETTES), ("pattern", self.pattern, PATTERNS)):
            if name not in known:
                raise unknown(what, name, known)

    def described(self) -> dict[str, Any]:
        """The fields that are not at their default."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}
        if self.groups:
            values["groups"] = {name: look.described() for name, look in self.groups.items()}
        return values

    def drawables(
        self, system: ParticleSystem, t: float, x: Array, v: Array, frame: int, stage: Stage
    ) -> tuple[Drawable, ...]:
        """Everything that a frame shows, for the system at (t, x, v)."""
        extent = stage.extent
        age = np.maximum(system.particles.age - (system.t - t), 0)
        parts = self._parts(system.particles)
        covered = self._covered(system.particles)
        result: list[Drawable] = []
        if self.colliders:
            result += [self._collider(c, k, t, extent, frame) for k, c in enumerate(system.colliders)]
        if self.arrows or self.streamlines:
            result += self._field(system, t, stage, frame)
        if self.surfaces:
            for name, surface in system.particles.surfaces.items():
                if surface.skin is not None:
                    result += self._skin(name, surface.skin, system.particles, x, frame)
                else:
                    result.append(self._surface(name, system.particles, v, age, frame))
        if self.springs is not False:
            result += self._springs(system, x, stage, covered, frame)
        if self.trails > 0:
            _, _, rows = parts[-1]
            colors = self._colors(system.particles, v, age, rows)
            result += stage.trails.drawn(self, system.particles.id[rows], colors, extent, frame)
        for name, look, rows in parts:
            hidden = look is self or name.removeprefix(OF_GROUP) in system.particles.surfaces
            seen = rows[~covered[rows]] if hidden else rows
            if look.particles in animals.SHAPES and len(seen):
                result.append(look._animals(name, system.particles, t, x, v, age, seen, extent, frame))
            elif look.particles != "none" and len(seen):
                result.append(look._particles(name, system.particles, v, age, seen, extent, frame))
        return tuple(result)

    def _parts(self, p: Particles) -> list[tuple[str, Look, NDArray[np.intp]]]:
        """Name, look and rows of the particles of each group, and in the end of all others."""
        parts = []
        rest = np.ones(len(p), bool)
        for name, look in (self.groups or {}).items():
            if name not in p.groups and name not in p.attributes:
                raise unknown("group or attribute of particles in look.groups:", name, [*p.groups, *p.attributes])
            mine = rest & (p.groups[name] if name in p.groups else p.attributes[name] != 0)
            rest &= ~mine
            parts.append((f"{OF_GROUP}{name}", look, np.flatnonzero(mine)))
        return [*parts, ("particles", self, np.flatnonzero(rest))]

    def _covered(self, p: Particles) -> NDArray[np.bool_]:
        """Who is not drawn, but the surface at whose corner it is, or inside of which."""
        result = np.zeros(len(p), bool)
        for name in p.surfaces if self.surfaces else ():
            result[p.corners(name)] = True
            result[p.rows(p.surfaces[name].inside)] = True
        return result

    def _surface(self, name: str, p: Particles, v: Array, age: Array, frame: int) -> Triangles:
        look = (self.groups or {}).get(name, self)
        faces = p.corners(name).astype(np.int32)
        colors = look._colors(p, v, age, np.arange(int(faces.max(initial=-1)) + 1))
        alike = not len(colors) or bool((colors == colors[0]).all())
        uv = p.surfaces[name].uv
        color: Any = (1.0, 1.0, 1.0, 1.0) if not len(colors) else tuple(colors[0].tolist()) if alike else colors
        return Triangles(
            name=name,
            version=p.version if alike else frame,
            faces=faces,
            color=color,
            uv=uv.astype(np.float32) if uv.any() else None,
            **look._patterned(),
        )

    def _patterned(self) -> dict[str, Any]:
        """The pattern of a surface."""
        light = self.brightness * linear(self.pattern_color)[:3]
        return {
            "pattern": self.pattern,
            "pattern_count": self.pattern_count,
            "pattern_color": tuple(light.tolist()),
        }

    def _skin(self, name: str, skin: Skin, p: Particles, x: Array, frame: int) -> list[Drawable]:
        """A smooth skin over the particles at places x, and its eyes."""
        look = (self.groups or {}).get(name, self)
        x = x[p.rows(skin.nodes)]
        color = look.brightness * linear(look.color)
        color[3] = look.opacity
        worn: list[Drawable] = [
            Triangles(
                name=name,
                version=frame,
                vertices=skin.corners(x),
                faces=skin.all_faces(),
                color=color,
                uv=np.tile(skin.uv, (len(skin.nodes), 1, 1)).astype(np.float32),
                **look._patterned(),
            )
        ]
        if len(skin.eyes):
            pupils, color = skin.pupils(x), linear(EYES)
            worn.append(
                Points(name=f"{name} eyes", version=frame, vertices=pupils, radius=skin.eye_radius, color=color)
            )
        return worn

    def _particles(
        self, name: str, p: Particles, v: Array, age: Array, rows: NDArray[np.intp], extent: float, frame: int
    ) -> Points:
        own = p.radius[rows]
        radius: Any = self.size or np.where(own > 0, own, 0.01 * extent).astype(np.float32)
        if self.size_over_life is not None:
            radius = (radius * over_life.values(self.size_over_life, _life(p, age, rows))).astype(np.float32)
        colors = self._colors(p, v, age, rows)
        motion = normals = None
        if self.shutter > 0:
            motion = (v[rows] * np.minimum(age[rows], self.shutter)[:, None]).astype(np.float32)  # nobody moved unborn
        if self.particles == "flakes":
            size = random.uniform(0, "flakes", p.id[rows], "size")[:, 0]
            radius = (radius * (SMALLEST_FLAKE + (LARGEST_FLAKE - SMALLEST_FLAKE) * size)).astype(np.float32)
            normals = random.direction(0, "flakes", p.id[rows], "direction").astype(np.float32)
        return Points(
            name=name,
            version=frame,
            index=None if len(rows) == len(p) else rows.astype(np.int32),
            radius=radius,
            color=colors,
            glow=self.particles == "glow",
            soft=self.particles == "smoke",
            motion=motion,
            normals=normals,
            daylight=self.daylight,
        )

    def _animals(
        self,
        name: str,
        p: Particles,
        t: float,
        x: Array,
        v: Array,
        age: Array,
        rows: NDArray[np.intp],
        extent: float,
        frame: int,
    ) -> Triangles:
        size = self.size or 0.01 * extent
        corners, faces = animals.mesh(self.particles, x[rows], v[rows], p.id[rows], t, size)
        colors = np.repeat(self._colors(p, v, age, rows), len(corners) // len(rows), axis=0)
        return Triangles(name=name, version=frame, vertices=corners, faces=faces, color=colors, smooth=False)

    def _colors(self, p: Particles, v: Array, age: Array, rows: NDArray[np.intp]) -> NDArray[np.float32]:
        """Linear RGBA of each particle."""
        light: Any = 1.0
        if self.color_by == "temperature":
            light = blackbody(p.column("temperature")[rows])
        elif self.color_by is not None:
            light = palette(self.palette, self._levels(p, v, rows))[:, :3]
        elif all(name in p.attributes for name in OWN_COLOR):
            light = np.stack([p.attributes[name][rows] for name in OWN_COLOR], axis=1)
        elif self.color_over_life is None:
            light = linear(self.color)[:3]
        if self.color_over_life is not None:
            light = light * over_life.colors(self.color_over_life, _life(p, age, rows))
        result = np.empty((len(rows), 4), np.float32)
        result[:, :3], result[:, 3] = self.brightness * light, self.opacity
        if self.brightness_over_life is not None:
            result[:, :3] *= over_life.values(self.brightness_over_life, _life(p, age, rows))[:, None]
        if self.opacity_over_life is not None:
            result[:, 3] *= over_life.values(self.opacity_over_life, _life(p, age, rows))
        return result

    def _levels(self, p: Particles, v: Array, rows: NDArray[np.intp]) -> Array:
        """Where each particle stands in the palette, from 0 to 1."""
        if self.color_by == "speed":
            value = np.sqrt((v[rows] ** 2).sum(axis=1))
        elif self.color_by == "id":
            value = (p.id[rows] * 0.6180339887498949) % 1.0  # neighbours get colours far apart
        else:
            value = p.column(str(self.color_by))[rows]
        low, high = self.color_range or ((value.min(), value.max()) if len(rows) else (0.0, 1.0))
        level: Array = np.clip((value - low) / (high - low if high > low else 1.0), 0, 1)
        return level

    def _collider(self, collider: Collider, k: int, t: float, extent: float, frame: int) -> Triangles:
        floor = isinstance(collider, Plane) and collider.direction[1] > 0.95
        corners, faces = collider.mesh(self.floor_size or (200 if floor else 3) * extent)
        inside = getattr(collider, "sign", 1.0) < 0 or bool(getattr(collider, "walls", ()))
        color = linear(self.collider_color)
        color[3] = 0.12 if inside else 1.0  # one has to see into a room
        return Triangles(
            name=f"{collider.name.lower()} {k}",
            version=frame if collider.moves else 0,
            vertices=(corners + collider.at(t)).astype(np.float32),
            faces=faces,
            color=color,
            smooth=collider.smooth,
        )

    def _springs(
        self, system: ParticleSystem, x: Array, stage: Stage, covered: NDArray[np.bool_], frame: int
    ) -> list[Drawable]:
        width = self.spring_width or 0.003 * stage.extent
        result: list[Drawable] = []
        for k, force in enumerate(system.forces):
            if not isinstance(force, Springs) or not len(force.ids):
                continue
            name, p = f"{force.family} {k}", system.particles
            if force in stage.strands:
                ends = linear(self.strand_color), linear(self.tip_color)
                result.append(stage.strands[force].drawn(name, p, x, width, *ends, frame))
                continue
            color: Any = linear(self.spring_color or FAMILY_COLORS.get(force.family, "#9fb4cc"))
            pairs, version = force.rows(p).astype(np.int32), p.version
            if isinstance(force, Muscles) and self.spring_color is None:
                color, version = _contraction(force, p, x), frame
            if self.springs is None:
                seen = ~covered[pairs].all(axis=1)
                pairs, color = pairs[seen], color[seen] if color.ndim == 2 else color
            if len(pairs):
                result.append(Segments(name=name, version=version, pairs=pairs, width=width, color=color))
        return result

    def _field(self, system: ParticleSystem, t: float, stage: Stage, frame: int) -> list[Drawable]:
        field = field_of(system)
        if field is None:
            return []
        low, high = stage.low, stage.high
        key = (field.key, self.arrows, self.streamlines) if field.steady else None
        if key is not None and key == stage.field[0]:
            return stage.field[1]
        version = 0 if key is not None and not stage.field[1] else frame
        result: list[Drawable] = []
        if self.arrows:
            result.append(field_arrows(field, t, low, high, self.arrows, version))
        if self.streamlines:
            result.append(streamlines(field, t, low, high, self.streamlines, version))
        stage.field = key, result
        return result


Groups = Mapping[str, Look]


def _of_group(name: str, look: Any) -> Look:
    """The look of a group, from a table or made already."""
    if not isinstance(look, Look):
        if not isinstance(look, Mapping):
            raise InvalidInput(f"look.groups.{name} must be a look or a table of its values, not {shown(look)}")
        for key in look:
            if key not in OF_PARTICLES:
                raise unknown(f"key in look.groups.{name}:", key, OF_PARTICLES)
        with about(f"look.groups.{name}"):
            return Look(**look)
    for key in look.described():
        if key not in OF_PARTICLES:
            raise InvalidInput(f"look.groups.{name}.{key} is not allowed: a group has {', '.join(OF_PARTICLES)}")
    return look


def _contraction(force: Muscles, p: Particles, x: Array) -> NDArray[np.float32]:
    """Linear RGBA of each muscle: pale at rest, red where it is short, and blue where it is long."""
    idle = force.settings(p, 0.0, np.arange(len(force.ids)))["rest"][0]
    longer = np.clip((force.values(p, x) / idle - 1) / FAR, -1, 1)[:, None]
    pale, short, long = (linear(c) for c in ("#f2eee6", SHORT, LONG))
    way = np.where(longer < 0, short, long)
    return np.asarray(pale + np.abs(longer) * (way - pale), np.float32)


def _life(p: Particles, age: Array, rows: NDArray[np.intp]) -> Array:
    """Which fraction of its lifetime each has behind it."""
    life: Array = np.minimum(age[rows] / p.lifetime[rows], 1)
    return life


class Stage:
    """What looks at one run have in common.

    Attributes
    ----------
    low, high : corners of the box in which fields are drawn [m].
    extent : size of the scene [m]; lines and small particles are drawn in proportion to it.
    trails : where the particles were.
    field : what is drawn of the field, and of which one if it is steady.
    strands : of hair, by the springs along them.
    """

    def __init__(self, look: Look, system: ParticleSystem) -> None:
        x = system.particles.x
        self.low: Array
        self.high: Array
        self.low, self.high = _bounds(x) if look.field_box is None else np.array(look.field_box, np.float64)
        self.extent = _extent(x)
        self.trails = Trails(look)
        self.field: tuple[Any, list[Drawable]] = (None, [])
        self.strands = {
            force: Strands(force, system.particles, look.children, look.clump, look.children_seed)
            for force in system.forces
            if isinstance(force, Springs) and force.family == STRAND and len(force.ids) and look.springs is not False
        }


class Trails:
    """Where particles were in the last seconds."""

    def __init__(self, look: Look) -> None:
        self.span = look.trails
        self._past: deque[tuple[float, NDArray[np.int64], Array]] = deque()

    def remember(self, t: float, ids: NDArray[np.int64], x: Array) -> None:
        """Note a look at time t, and forget what is too long ago."""
        if self.span <= 0:
            return
        self._past.append((t, ids.copy(), x.astype(np.float32)))
        while self._past and self._past[0][0] < t - self.span - 1e-9:
            self._past.popleft()

    def known(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
        """Times of the looks, how many were there in each, and their ids and places, one look after the other."""
        ids = [np.zeros(0, np.int64), *(then for _, then, _ in self._past)]
        places = [np.zeros((0, 3), np.float32), *(x for *_, x in self._past)]
        counts = np.array([len(then) for _, then, _ in self._past], np.int64)
        return np.array([t for t, *_ in self._past]), counts, np.concatenate(ids), np.concatenate(places)

    def know(self, times: Array, counts: NDArray[np.int64], ids: NDArray[np.int64], places: Array) -> None:
        """Know what was `known`."""
        ends = np.cumsum(counts)[:-1]
        looks = zip(times.tolist(), np.split(ids, ends), np.split(places, ends), strict=True) if len(times) else ()
        self._past = deque(looks)

    def drawn(self, look: Look, ids: NDArray[np.int64], colors: Array, extent: float, frame: int) -> list[Drawable]:
        """One curve for each living particle, thinner and fainter towards its past."""
        if len(self._past) < 2 or not len(ids):
            return []
        now = self._past[-1][0]
        order = np.argsort(ids, kind="stable")
        points, owner, age = [], [], []
        for t, then, x in self._past:
            place = np.minimum(np.searchsorted(ids, then, sorter=order), len(ids) - 1)
            row = order[place]
            alive = ids[row] == then
            points.append(x[alive])
            owner.append(row[alive])
            age.append(np.full(int(alive.sum()), (now - t) / self.span, np.float32))
        rows = np.concatenate(owner)
        by_particle = np.argsort(rows, kind="stable")
        counts = np.bincount(rows, minlength=len(ids))
        fade = (1 - np.concatenate(age)[by_particle]).clip(0, 1)
        color = colors[rows[by_particle]].copy()
        color[:, 3] *= fade**1.5
        return [
            Curves(
                name="trails",
                version=frame,
                vertices=np.concatenate(points)[by_particle],
                index=np.arange(len(rows), dtype=np.int32),
                offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
                width=np.float32(look.size or 0.008 * extent) * (0.35 + 0.65 * fade),
                color=color,
                glow=look.particles == "glow",
            )
        ]


def _bounds(x: Array) -> tuple[Array, Array]:
    """Corners of the box of the particles; a box of no size is 2 m wide."""
    low, high = (x.min(axis=0), x.max(axis=0)) if len(x) else (np.zeros(3), np.zeros(3))
    if not (high > low).any():
        low, high = low - np.array([1, 1, 0]), high + np.array([1, 1, 0])
    return low.astype(np.float64), high.astype(np.float64)


def _extent(x: Array) -> float:
    """Size of the scene [m]: robust against a few that have flown far away."""
    if len(x) < 2:
        return 1.0
    low, high = np.percentile(x, [2, 98], axis=0)
    return max(float((high - low).max()), 1e-3)
