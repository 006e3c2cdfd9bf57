"""Hair: strands that are clamped at their roots and want their own shape back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass import random
from pointmass.bodies.body import Body, body
from pointmass.collisions.collider import unit
from pointmass.errors import InvalidInput, finite_array, number, unknown, whole_number
from pointmass.forces.angles import Angles
from pointmass.forces.springs import Springs
from pointmass.forces.volumes import Volumes
from pointmass.laws.force import Force
from pointmass.meshes import TriangleSource, as_mesh
from pointmass.particles import Particles
from pointmass.tracing import functions as fn

CurveSource = ArrayLike  # strands of points, shape (strands, points, 3) [m]
Array = NDArray[np.float64]

STYLES = {"straight": (0.0, 0.0), "wavy": (0.006, 10.0), "curly": (0.007, 16.0)}  # radius [m], turns per metre
STRAND = "strand"  # family of the springs along strands, which a look draws as hair
YOUNG = 3e9  # modulus of human hair [Pa]
POISSON = 0.4  # its ratio: G = E / (2 (1 + nu)), and J = 2 I of a round section
GOLDEN = math.pi * (3 - math.sqrt(5))  # angle between neighbours of a sunflower
FEWEST = 5  # links of a turn
HANGING = 50  # weights of a strand that would double its length: it hangs 2% longer at its root
STRAIGHT = 1e-3  # sine of an angle that is no bend
LEAST = 0.25  # of l^3/6: a volume that changes less with the torsion is as soft as if it were this


@body
def hair(
    strands: int = 200,
    points: int = 24,
    length: float = 0.25,
    *,
    style: str = "straight",
    curl_radius: float | None = None,
    curl_turns: float | None = None,
    jitter: float = 0.1,
    center: Any = (0.0, 0.0, 0.0),
    scalp: float = 0.09,
    cap: float = 90.0,
    crown: Any = (0.0, 1.0, 0.0),
    mesh: TriangleSource | None = None,
    curves: CurveSource | None = None,
    comb: Any = (0.0, 0.0, 0.0),
    lean: float = 0.0,
    thickness: float = 8e-5,
    density: float = 1300.0,
    bend: float | None = None,
    twist: float | None = None,
    stretch: float | None = None,
    damping_ratio: float = 0.1,
    seed: int = 0,
) -> Body:
    """Strands of masses on a scalp, a mesh or along given curves, with springs against stretch, bend and torsion.

    A strand of N points has N - 1 links (`Springs`, family "strand"), N - 2 joints (`Angles`) and, if it is not
    straight, N - 3 tetrahedra (`Volumes`) that hold its torsion; a straight strand has none to hold. A link of length l
    has the stiffness EA / l, a joint EI / l, and a tetrahedron gives torsion GJ / l, so that the number of points
    changes how smooth a strand is and not how stiff. Its first two points are pinned: it is clamped.

    Parameters
    ----------
    strands : how many.
    points : of a strand, at least 3; a curl needs 5 links for each of its turns.
    length : of a strand [m], measured along it.
    style : of the curl: "straight", "wavy" or "curly".
    curl_radius : of the helix that a strand is at rest [m]; None = that of the style.
    curl_turns : of the helix, for each metre of the strand [1/m]; None = those of the style; below 0 left-handed.
    jitter : half-range of the strands' lengths, relative, and of the slant of their roots [rad].
    center, scalp : of the sphere from which they grow, and its radius [m].
    cap : how far from the crown they grow [degrees], up to 180.
    crown : direction of the middle of the hair on the sphere.
    mesh : they grow evenly from its triangles instead, along the normals: a path, or a pair (vertices, faces).
    curves : the strands themselves, shape (strands, points, 3) [m], root first, instead of all that is said above.
    comb : the direction to which strands turn from root to tip at the start, around the scalp, as a vector whose length
        says how quickly [1/m], such as (0, -20, -5). Their shape at rest stays.
    lean : how far roots lean over to the direction of `comb` [degrees], up to 85; they are clamped like this.
    thickness : diameter of a hair [m].
    density : [kg/m^3].
    bend : bending stiffness EI [N m^2]; None = that of human hair, E pi r^4 / 4 with E = 3 GPa.
    twist : torsional stiffness GJ [N m^2]; None = EI / 1.4, that of a round section. Where joints are bent by less than
        30 degrees it is less, as a slight bend would take very short steps to tell how it is turned.
    stretch : stiffness EA [N]; None = 50 times the weight of a strand, which so hangs 2% longer at its root. Hair has
        10,000 times as much, which nobody sees and which takes steps 100 times as short.
    damping_ratio : of each spring between masses that are free, 1 = critical.
    seed : of the jitter, and of the roots on a mesh.

    Raises
    ------
    InvalidInput
        A curl that does not fit into its length, or has fewer than 5 links for a turn; both a mesh and curves; comb of
        curves.

    Notes
    -----
    Rosenblum, Carlson, Tripp (J. Visualization and Computer Animation 1991) have masses, springs along and angular
    springs between links; Selle, Lentine, Fedkiw (SIGGRAPH 2008) hold torsion with springs in the tetrahedra of four
    points in a row, see `Volumes`. Their springs from each point to the next but one and but two are not needed
    beside angles and volumes, and would add to EI where a strand is bent.

    Examples
    --------
    >>> wig = pm.hair(strands=500, points=24, style="wavy", comb=(0, -20, 0), lean=45.0)
    """
    ratio = number("damping_ratio", damping_ratio, at_least=0)
    combed = finite_array("comb", comb, (3,))
    r = 0.5 * number("thickness", thickness, above=0, unit="m")
    line_mass = number("density", density, above=0, unit="kg/m^3") * math.pi * r * r
    if curves is not None:
        if mesh is not None or combed.any():
            raise InvalidInput("curves are strands as they are: leave out mesh and comb")
        start = finite_array("curves", curves, (None, None, 3))
        rest = _edges_of_curves(start)
    else:
        strands = whole_number("strands", strands, at_least=1)
        points = whole_number("points", points, at_least=3)
        jitter = number("jitter", jitter, at_least=0, at_most=0.9)
        seed = whole_number("seed", seed, at_least=0)
        longest = number("length", length, above=0, unit="m")
        lengths = random.spread(seed, "hair", np.arange(strands), "length", longest, jitter * longest)
        rest = _helices(lengths / (points - 1), points, *_curl(style, curl_radius, curl_turns, longest))
        middle, size = finite_array("center", center, (3,)), number("scalp", scalp, above=0, unit="m")
        if mesh is None:
            normals = _even_cap(strands, unit("crown", crown), number("cap", cap, above=0, at_most=180, unit="degrees"))
            roots = middle + size * normals
        else:
            roots, normals = _on_mesh(mesh, strands, seed)
        slants = jitter * (2 * random.uniform(seed, "hair", np.arange(strands), "slant") - 1)
        lean = math.radians(number("lean", lean, at_least=0, at_most=85, unit="degrees"))
        frames = _frames(_leant(normals, combed, lean), slants)
        clear = 0.0 if mesh is not None else size + 2 * float(np.abs(rest[..., :2]).max())
        edges = _combed(rest, roots, frames, combed, middle, clear)
        start = np.concatenate([roots[:, None], roots[:, None] + np.cumsum(edges, axis=1)], axis=1)
    links = np.linalg.norm(rest, axis=2)
    mass = line_mass * links.mean(axis=1, keepdims=True)
    stiff_bend = YOUNG * math.pi * r**4 / 4 if bend is None else number("bend", bend, at_least=0, unit="N m^2")
    stiff_twist = stiff_bend / (1 + POISSON) if twist is None else number("twist", twist, at_least=0, unit="N m^2")
    weight = 9.81 * line_mass * float(links.sum(axis=1).mean())
    stiff_stretch = HANGING * weight if stretch is None else number("stretch", stretch, above=0, unit="N")
    at = np.arange(links.shape[0] * (links.shape[1] + 1)).reshape(links.shape[0], -1)
    forces: list[Force] = [
        _stretch(at, links, mass, stiff_stretch, ratio),
        _bend(at, rest, links, mass, stiff_bend, ratio),
    ]
    if at.shape[1] > 3 and not _straight(rest, links):
        forces.append(_torsion(at, rest, links, mass, stiff_twist, ratio))
    particles = Particles(start.reshape(-1, 3), m=np.broadcast_to(mass, at.shape).ravel(), radius=r)
    particles.pin(at[:, :2].ravel())
    return Body(particles, forces)


# ------------------------------------------------------------------------------------------------------------- springs


def _elements(at: NDArray[np.int64], nodes: int) -> NDArray[np.int64]:
    """Ids of `nodes` points in a row, strand by strand: the same order in each, so that strands go side by side."""
    count = at.shape[1] - nodes + 1
    return np.stack([at[:, k : k + count] for k in range(nodes)], axis=2).reshape(-1, nodes)


def _damped(k: Array, ratio: float, slope: Array, mass: Array) -> Array:
    """k_d of springs of a number C: of the motion with w^2 = k |grad C|^2 / m it is 2 ratio k / w."""
    squared = np.where(slope > 0, slope, np.inf)
    return np.asarray(2 * ratio * np.sqrt(k * mass / squared))


def _stretch(at: NDArray[np.int64], links: Array, mass: Array, stiffness: float, ratio: float) -> Springs:
    k = stiffness / links
    k_d = _damped(k, ratio, np.full(links.shape, 2.0), mass)
    return Springs(_elements(at, 2), k.ravel(), k_d.ravel(), links.ravel(), family=STRAND)


def _bend(at: NDArray[np.int64], rest: Array, links: Array, mass: Array, stiffness: float, ratio: float) -> Angles:
    before, after = links[:, :-1], links[:, 1:]
    k = stiffness / (0.5 * (before + after))
    k_d = _damped(k, ratio, 2 * (before**-2 + after**-2 + 1 / (before * after)), mass)
    across, along = (
        np.linalg.norm(np.cross(rest[:, :-1], rest[:, 1:]), axis=2),
        (rest[:, :-1] * rest[:, 1:]).sum(axis=2),
    )
    angle = fn.atan2(across, along)
    return Angles(_elements(at, 3), k.ravel(), k_d.ravel(), np.where(across > 0, angle, 0.0).ravel())


def _torsion(at: NDArray[np.int64], rest: Array, links: Array, mass: Array, stiffness: float, ratio: float) -> Volumes:
    """k_s (dV/dpsi)^2 = GJ / l, with dV/dpsi = (e1 x e2) . (e2 x e3) / (6 |e2|) at rest."""
    e1, e2, e3 = rest[:, :-2], rest[:, 1:-1], rest[:, 2:]
    l1, l2, l3 = links[:, :-2], links[:, 1:-1], links[:, 2:]
    first, second, third = np.cross(e2, e3) / 6, np.cross(e3, e1) / 6, np.cross(e1, e2) / 6  # dV/de1, dV/de2, dV/de3
    turn = 6 * (third * first).sum(axis=2) / l2
    k = stiffness / ((l1 + l2 + l3) / 3) / np.maximum(turn, LEAST * l1 * l2 * l3 / 6) ** 2
    slope = sum((g * g).sum(axis=2) for g in (first, first - second, second - third, third))
    return Volumes(
        _elements(at, 4), k.ravel(), _damped(k, ratio, slope, mass).ravel(), (third * e3).sum(axis=2).ravel()
    )


def _straight(rest: Array, links: Array) -> bool:
    """Whether no strand has two bends in a row, between which there is torsion."""
    bends = np.linalg.norm(np.cross(rest[:, :-1], rest[:, 1:]), axis=2) > STRAIGHT * links[:, :-1] * links[:, 1:]
    return not (bends[:, :-1] & bends[:, 1:]).any()


# -------------------------------------------------------------------------------------------------------------- shapes


def _edges_of_curves(x: Array) -> Array:
    """Links of given strands, shape (strands, points - 1, 3)."""
    if x.shape[0] < 1 or x.shape[1] < 3:
        raise InvalidInput(f"curves must have at least 1 strand of 3 points, not shape {x.shape}")
    edges = np.diff(x, axis=1)
    short = np.argwhere((edges == 0).all(axis=2))
    if len(short):
        strand, point = short[0]
        raise InvalidInput(f"points {point} and {point + 1} of strand {strand} of curves are the same")
    return edges


def _curl(style: str, radius: float | None, turns: float | None, length: float) -> tuple[float, float]:
    """Radius [m] and turns per metre of the helix."""
    if style not in STYLES:
        raise unknown("style of hair", style, STYLES)
    own = STYLES[style]
    radius = number("curl_radius", own[0] if radius is None else radius, at_least=0, unit="m")
    return radius, number("curl_turns", own[1] if turns is None else turns, unit="1/m")


def _helices(link: Array, points: int, radius: float, turns: float) -> Array:
    """Links of helices about their third axis, those of a strand equally long, shape (strands, points - 1, 3)."""
    turn = 2 * math.pi * turns * link[:, None]
    if radius > 0 and np.abs(turn).max() > 2 * math.pi / FEWEST:
        need = math.ceil(FEWEST * abs(turns) * float(link.max()) * (points - 1)) + 1
        raise InvalidInput(
            f"points = {points} is not allowed: a curl with {abs(turns):g} turns per metre needs {FEWEST} links for "
            f"each turn, so give at least {need} points, or fewer turns"
        )
    chord = 2 * radius * np.abs(fn.sin(0.5 * turn))
    if (chord >= 0.98 * link[:, None]).any():
        raise InvalidInput(
            f"curl_radius = {radius} is not allowed: turns as large as that take up the whole length of a strand, so "
            f"give less than {radius * float((0.98 * link[:, None] / chord).min()):.2g} m, or fewer turns"
        )
    k = np.arange(points)
    round_ = radius * np.stack([fn.cos(turn * k), fn.sin(turn * k)], axis=2)
    rise = np.broadcast_to(np.sqrt(link[:, None] ** 2 - chord**2), (len(link), points - 1))
    return np.concatenate([np.diff(round_, axis=1), rise[..., None]], axis=2)


def _even_cap(count: int, crown: Array, cap: float) -> Array:
    """Normals at places that are evenly spread over the cap of a sphere, like the seeds of a sunflower (Vogel 1979)."""
    k = np.arange(count)
    height = 1 - (k + 0.5) / count * (1 - float(fn.cos(math.radians(cap))))
    out, angle = np.sqrt(np.maximum(1 - height**2, 0)), k * GOLDEN
    a, b, c = _frames(crown[None], np.zeros((1, 2)))[0]
    return _sum((out * fn.cos(angle), a), (out * fn.sin(angle), b), (height, c))


def _on_mesh(mesh: Any, count: int, seed: int) -> tuple[Array, Array]:
    """Places on a mesh, evenly by area, and its normals there."""
    ids = np.arange(count)
    place, which = (random.uniform(seed, "hair", ids, name) for name in ("place", "triangle"))
    return as_mesh(mesh).scattered(np.concatenate([place, which[:, :1]], axis=1))


def _frames(normals: Array, slants: Array) -> Array:
    """Three unit vectors for each root, shape (strands, 3, 3): two across, the third the direction of growth."""
    flat = np.abs(normals[:, 1]) > 0.999
    across = _unit(np.cross(np.where(flat[:, None], (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)), normals))
    other = np.cross(normals, across)
    grown = _unit(normals + slants[:, :1] * across + slants[:, 1:] * other)
    across = _unit(across - (across * grown).sum(axis=1, keepdims=True) * grown)
    return np.stack([across, np.cross(grown, across), grown], axis=1)


def _leant(normals: Array, way: Array, angle: float) -> Array:
    """Directions that lean from the normals to another direction by an angle [rad], or as far as it goes."""
    flat = way - (normals * way).sum(axis=1, keepdims=True) * normals
    return np.asarray(float(fn.cos(angle)) * normals + float(fn.sin(angle)) * _unit(flat))


def _combed(rest: Array, roots: Array, frames: Array, comb: Array, center: Array, clear: float) -> Array:
    """Links that turn to a direction from root to tip, around a sphere of the radius `clear`; as long as at rest."""
    place, frame, result = roots, frames, []
    for k in range(rest.shape[1]):
        edge = rest[:, k]
        if k > 0 and comb.any():
            way = frame[:, 2] + comb * np.linalg.norm(edge, axis=1, keepdims=True)
            frame = _turned(frame, _around(_unit(way), place - center, edge[:, 2:], clear))
        step = _sum(*((edge[:, a], frame[:, a]) for a in range(3)))
        result.append(step)
        place = place + frame[:, 2] * edge[:, 2:]
    return np.stack(result, axis=1)


def _around(way: Array, place: Array, step: Array, clear: float) -> Array:
    """A direction that does not lead into a sphere about the origin: it is pushed out along the normal of its end."""
    end = place + step * way
    gap = np.maximum(clear - np.linalg.norm(end, axis=1, keepdims=True), 0)
    return _unit(way + np.minimum(gap / step, 2.0) * _unit(end))


def _turned(frame: Array, way: Array) -> Array:
    """A frame whose third vector becomes `way`, and that turns about it as little as it can."""
    across = _unit(frame[:, 0] - (frame[:, 0] * way).sum(axis=1, keepdims=True) * way)
    return np.stack([across, np.cross(way, across), way], axis=1)


def _sum(*parts: tuple[Array, Array]) -> Array:
    """Sum of numbers times vectors."""
    return np.asarray(sum(np.asarray(s)[..., None] * a for s, a in parts))


def _unit(a: Array) -> Array:
    size = np.linalg.norm(a, axis=-1, keepdims=True)
    return np.asarray(a / np.maximum(size, 1e-300))
