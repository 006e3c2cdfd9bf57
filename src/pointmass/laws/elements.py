"""Forces on small sets of particles (elements): springs, angles, triangles, hinges.

Each element is evaluated once; its forces are then added to the particles in the order of the elements, so that the
sum has the same bits on any number of threads.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.errors import InvalidInput, whole_number
from pointmass.laws.force import Array, Blocks, Force, Rows, clock, inputs_for, matrix
from pointmass.laws.parameter import Parameter
from pointmass.laws.unary import law_name, law_parameters, origin, parameters_from
from pointmass.particles import Particles, read_only
from pointmass.tracing import functions as fn
from pointmass.tracing.derivative import gradient
from pointmass.tracing.program import flatten
from pointmass.tracing.trace import Traced, trace, vector_names


class ElementForce(Force):
    """A law of k particles.

    Attributes
    ----------
    nodes : particles of one element.
    ids : particle ids of the elements, shape (e, nodes).
    family : what pictures and reports call them: the name of the force, unless it says something else.
    law : (x1, v1, ..., xk, vk, t, *parameters) -> the forces on all nodes, or on all but the last, which takes minus
        their sum.
    divided : names of the parameters of which half an element has half, such as the stiffness of a spring.

    Notes
    -----
    Elements name particles by id. A fresh set of particles has ids 0, 1, 2, ..., so these are also its rows. An
    element goes when one of its particles is removed.
    """

    nodes: ClassVar[int] = 2
    internal: ClassVar[bool] = True
    divided: ClassVar[tuple[str, ...]] = ()
    law: Callable[..., Any]

    def __init__(self, ids: ArrayLike, parameters: list[Parameter], enabled: bool = True) -> None:
        super().__init__(parameters, enabled=enabled)
        self.family = self.name
        self.ids = _node_ids(self.name, ids, self.nodes)
        self._rows: tuple[int, Rows] | None = None  # version of the particles, and rows of the ids then

    def measure(self) -> Callable[..., Any] | None:
        """The function of (x1, ..., xk, t, *parameters) that is the element's energy, if it has one."""
        return None

    @cached_property
    def traced(self) -> Traced:
        """The law as a program with 3 outputs for each node."""
        return trace(self._all_nodes, self._signature(), 3 * self.nodes, self.name)

    @cached_property
    def traced_energy(self) -> Traced | None:
        """The energy of an element as a program."""
        energy = self.measure()
        if energy is None:
            return None
        kept = {n: k for n, k in self._signature().items() if not n.startswith("v")}
        return trace(energy, kept, 1, f"{self.name} energy")

    @property
    def velocity_dependent(self) -> bool:
        return any(name in self.traced.depends_on for name in self._names("v"))

    @property
    def laws(self) -> Sequence[Traced]:
        return (self.traced,)

    def bind(self, particles: Particles) -> None:
        super().bind(particles)
        rows = self.found(particles)
        for p in self.parameters.values():
            p.check(particles, len(self.ids), "elements")
            if p.attributes:
                raise InvalidInput(
                    f"{p.name} of {self.name} belongs to elements: it may depend on t, not on {sorted(p.attributes)}"
                )
        self._rows = (particles.version, rows)
        _ = self.traced

    def found(self, particles: Particles) -> Rows:
        """Rows of the particles of each element, looked up now.

        Raises
        ------
        InvalidInput
            An element that joins a particle that is not there.
        """
        rows = particles.rows(self.ids)
        if (rows < 0).any():
            element, node = np.argwhere(rows < 0)[0]
            raise InvalidInput(f"{self.name} {element} joins particle {self.ids[element, node]}, which does not exist")
        return rows

    def rows(self, particles: Particles) -> Rows:
        """Rows of the particles of each element, shape (e, nodes)."""
        if self._rows is None or self._bound is not particles or self._rows[0] != particles.version:
            self.bind(particles)
        assert self._rows is not None
        return self._rows[1]

    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        rows = self.rows(particles)
        if not len(rows):
            return
        out = matrix(self.traced.columns(*self._inputs(self.traced, particles, t, x, v)), len(rows), x.dtype)
        for axis in range(3):
            np.add.at(f[:, axis], rows.ravel(), out[:, axis::3].ravel())

    def add_jacobian(
        self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks, share: Array | None = None
    ) -> None:
        """Add df/dx and df/dv at (t, x, v).

        Parameters
        ----------
        share : of what may make the matrix of an implicit step indefinite (see `softened`), of each particle; None =
            all of it.
        """
        rows = self.rows(particles)
        dx, dv = self.element_jacobians(particles, t, x, v, share)
        for a in range(self.nodes):
            for b in range(self.nodes):
                blocks.add(rows[:, a], rows[:, b], dx[:, a, :, b], dv[:, a, :, b])

    def element_jacobians(
        self, particles: Particles, t: Any, x: Array, v: Array, share: Array | None = None
    ) -> tuple[Array, Array]:
        """df/dx and df/dv of each element for itself, each of shape (e, nodes, 3, nodes, 3); `share` as above.

        Numbers of one kind lie side by side in memory, so that what is done with all elements runs along them.
        """
        k, e = self.nodes, len(self.ids)
        law = self._jacobian if share is None else self.softened
        values = law.columns(*self._inputs(law, particles, t, x, v, share))
        both = np.empty((len(values), e), x.dtype)
        for row, column in zip(both, values, strict=True):
            row[:] = column
        both = np.moveaxis(both.reshape(k, 3, k, 2, 3, e), -1, 0)
        return both[:, :, :, :, 0], both[:, :, :, :, 1]

    def energy(self, particles: Particles, t: float, x: Array, v: Array) -> float | None:
        if self.traced_energy is None:
            return None
        (value,) = self.traced_energy.columns(*self._inputs(self.traced_energy, particles, t, x, v))
        return float(np.sum(np.broadcast_to(value, len(self.ids)), dtype=np.float64))

    def links(self, particles: Particles) -> Rows:
        rows = self.rows(particles)
        return np.concatenate([rows[:, [0, b]] for b in range(1, self.nodes)])

    def partners(self, particles: Particles, row: int) -> list[int]:
        rows = self.rows(particles)
        return sorted({int(r) for r in rows[(rows == row).any(axis=1)].ravel()} - {row})

    def keep(self, particles: Particles, mask: NDArray[np.bool_]) -> None:
        whole: NDArray[np.bool_] = np.all(mask[self.rows(particles)], axis=1)
        self.ids = self.ids[whole]
        self._rows = None
        for p in self.parameters.values():
            p.keep(whole)

    def remake(self, ids: NDArray[np.int64], source: Rows, share: Array) -> None:
        """Have other elements in place of the present ones: who breaks, is gone, and who tears, is there twice.

        Parameters
        ----------
        ids : particles of the new elements, shape (e, nodes).
        source : number of the present element from which each has its parameters, shape (e,).
        share : of those that are `divided`, of which there is a number for each element, shape (e,).
        """
        self.ids, self._rows = ids, None
        for name, p in self.parameters.items():
            p.keep(source)
            if name in self.divided:
                p.scale(share)

    def state(self) -> dict[str, NDArray[Any]]:
        """Its elements and the numbers of each, which change where something tears: see `Simulation.state`."""
        columns = {f"{name}.{k}": c.value for name, p in self.parameters.items() for k, c in enumerate(p.components)}
        return {"ids": self.ids, **{key: value for key, value in columns.items() if isinstance(value, np.ndarray)}}

    def put_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Have the elements of a `state` of the same force."""
        self.ids, self._rows = np.array(state["ids"], np.int64), None
        for key in state.keys() - {"ids"}:
            name, _, k = key.rpartition(".")
            self.parameters[name].components[int(k)].value = read_only(np.array(state[key], np.float64))

    def shifted(self, offset: int) -> ElementForce:
        """Name particles `offset` higher: for bodies that are put together. Returns itself."""
        self.ids = self.ids + offset
        self._rows = None
        return self

    def among(self, ids: NDArray[np.int64]) -> Rows:
        """Numbers of the elements that join particles with some ids alone."""
        return np.flatnonzero(np.isin(self.ids, ids).all(axis=1))

    def joins(self, other: ElementForce) -> bool:
        """Whether one force can have the elements of both: the same law, with other numbers at most."""
        alike = type(self) is type(other) and (self.family, self.enabled) == (other.family, other.enabled)
        if not alike or self.parameters.keys() != other.parameters.keys():
            return False
        return all(p.joins(other.parameters[name]) for name, p in self.parameters.items())

    def take_in(self, other: ElementForce) -> None:
        """Have the elements of another force that `joins`, after one's own."""
        for name, p in self.parameters.items():
            p.take_in(other.parameters[name], len(self.ids), len(other.ids))
        self.ids = np.concatenate([self.ids, other.ids])
        self._rows = None

    @cached_property
    def _jacobian(self) -> Traced:
        names = [n for a in range(self.nodes) for q in "xv" for n in vector_names(f"{q}{a + 1}")]
        return self.traced.jacobian(*names)

    @property
    def softened(self) -> Traced:
        """df/dx and df/dv, of which an input `share` says how much is kept that may make a matrix indefinite.

        Outputs are entries [node, axis, of node, x or v, axis]. A law of which no more is known is kept as it is.
        """
        return self._jacobian

    def _names(self, quantity: str) -> list[str]:
        return [f"{quantity}{a + 1}" for a in range(self.nodes)]

    def _signature(self) -> dict[str, str]:
        state = {f"{q}{a + 1}": "vector" for a in range(self.nodes) for q in "xv"}
        return state | {"t": "scalar"} | {p.name: "vector" if p.vector else "scalar" for p in self.parameters.values()}

    def _all_nodes(self, *arguments: Any) -> Any:
        forces = self.law(*arguments)
        if forces is None:
            return None
        numbers = list(flatten(forces))
        if len(numbers) not in (3 * self.nodes, 3 * self.nodes - 3):
            nodes = "the first particle" if self.nodes == 2 else f"all {self.nodes} particles or all but the last"
            raise InvalidInput(f"it must return three numbers for {nodes}, but returned {len(numbers)} in all")
        if len(numbers) < 3 * self.nodes:
            numbers += [-sum(numbers[axis + 3 :: 3], start=numbers[axis]) for axis in range(3)]
        return numbers

    def _inputs(
        self, law: Traced, particles: Particles, t: Any, x: Array, v: Array, share: Array | None = None
    ) -> list[Any]:
        rows = self.rows(particles)
        now = clock(t, rows[:, 0])
        numbers = {"t": now} if share is None else {"t": now, "share": share[rows[:, 0]]}
        vectors = {f"{n}{a + 1}": q[rows[:, a]] for a in range(self.nodes) for n, q in (("x", x), ("v", v))}
        everything = np.arange(len(rows))
        return inputs_for(law, vectors, numbers, self.settings(particles, now, everything))


class ConstraintForce(ElementForce):
    """A damped spring of any scalar C(x1, ..., xk): a length, an angle, a volume.

    `f_a = -[k_s (C - rest) + k_d dC/dt] dC/dx_a`, with `dC/dt = sum_a dC/dx_a . v_a` (Witkin, Particle System Dynamics,
    section on energy functions): force, damping, energy and Jacobian follow from C alone. The first parameters are
    named k_s, k_d and rest; without a rest, C at the start is measured. What others there are act through `resting`.
    A spring that is not linear says so by `excess` and `stored`.

    Attributes
    ----------
    unit : of C.
    convex : whether C is a convex function of the places, as a length is.
    """

    unit: ClassVar[str] = ""
    divided: ClassVar[tuple[str, ...]] = ("k_s", "k_d")
    convex: ClassVar[bool] = False

    @staticmethod
    @abstractmethod
    def constraint(*x: Any) -> Any:
        """C(x1, ..., xk), one number."""

    def bind(self, particles: Particles) -> None:
        """Measure C where no rest was given, and check the nodes."""
        if "rest" not in self.parameters:
            places = particles.x[self.found(particles)].astype(np.float64)
            measured = Parameter("rest", self.at(places), unit=self.unit)
            names = [*list(self.parameters)[:2], "rest", *list(self.parameters)[2:]]
            self.parameters = {name: self.parameters.get(name, measured) for name in names}
        super().bind(particles)

    @staticmethod
    def resting(t: Any, rest: Any, *own: Any) -> Any:
        """C without force at time t, from the parameter `rest` and those after it."""
        return rest

    @staticmethod
    def excess(c: Any, rest: Any) -> Any:
        """Tension for each unit of k_s: C - rest, or what else rises with C and is the same to first order."""
        return c - rest

    @staticmethod
    def stored(c: Any, rest: Any) -> Any:
        """Energy for each unit of k_s: the integral of `excess` over C, from rest."""
        return 0.5 * (c - rest) ** 2

    def law(self, *arguments: Any) -> Any:
        """The forces on all nodes."""
        state, k_s, k_d, rest = self._parts(arguments, 2)
        slopes, _, tension, _ = self._pulled(state, k_s, k_d, rest)
        return [fn.scale(-tension, slope) for slope in slopes]

    def measure(self) -> Callable[..., Any]:
        """E = k_s times what is `stored`: k_s (C - rest)^2 / 2."""

        def energy(*arguments: Any) -> Any:
            x, k_s, _, rest = self._parts(arguments, 1)
            return k_s * self.stored(self.constraint(*x), rest)

        return energy

    @cached_property
    def softened(self) -> Traced:
        """df/dx and df/dv; what makes -df/dx indefinite counts `share` times.

        With the tension T = k_s (C - rest) + k_d dC/dt, -df_a/dx_b = k_s dC/dx_a dC/dx_b + k_d dC/dx_a d(dC/dt)/dx_b +
        T d2C/dx_a dx_b (with another `excess`, k_s times its slope in the first term). That term is positive
        semi-definite, and so is the last where C is convex and T > 0; `share` is on all others. 1 gives the exact
        Jacobian, and 0 that of Choi and Ko (Stable but Responsive Cloth, SIGGRAPH 2002) for springs, that of Gauss and
        Newton for angles.
        """

        def slopes(*arguments: Any) -> Any:
            *given, share = arguments
            state, k_s, k_d, rest = self._parts(given, 2)
            x = state[0::2]
            gradients, rate, tension, stiffness = self._pulled(state, k_s, k_d, rest)
            turns = [gradient(rate, node) for node in x]
            bending = tension * (fn.where(tension > 0.0, 1.0, share) if self.convex else share)
            outputs = []
            for row in (component for along in gradients for component in along):
                for node, along, turn in zip(x, gradients, turns, strict=True):
                    curved = gradient(row, node)
                    outputs += [
                        -(row * (stiffness * along[i] + share * k_d * turn[i]) + bending * curved[i]) for i in range(3)
                    ]
                    outputs += [-(row * k_d * along[i]) for i in range(3)]
            return outputs

        signature = {**self._signature(), "share": "scalar"}
        return trace(slopes, signature, 18 * self.nodes**2, f"d {self.name}")

    @cached_property
    def traced_constraint(self) -> Traced:
        """C - rest, k_s, k_d, dC/dx1, ..., dC/dxk as a program.

        Where `excess` is another, the first two are those of the spring that has its tension and its stiffness now.
        """
        kept = {n: k for n, k in self._signature().items() if not n.startswith("v")}

        def parts(*arguments: Any) -> Any:
            x, k_s, k_d, rest = self._parts(arguments, 1)
            c = self.constraint(*x)
            excess, steep = self._excess(c, rest)
            return [excess / steep, k_s * steep, k_d, *(gradient(c, node) for node in x)]

        return trace(parts, kept, 3 + 3 * self.nodes, f"{self.name} constraint")

    @classmethod
    def at(cls, places: Array) -> Array:
        """C of nodes at places, shape (e, nodes, 3) -> (e,)."""
        return cls._columns(cls.constraint, places, 1)[:, 0]

    @classmethod
    def slopes(cls, places: Array) -> Array:
        """dC/dx of nodes at places, shape (e, nodes, 3)."""

        def gradients(*x: Any) -> Any:
            c = cls.constraint(*x)
            return [gradient(c, node) for node in x]

        return cls._columns(gradients, places, 3 * cls.nodes).reshape(places.shape)

    @classmethod
    def _columns(cls, law: Callable[..., Any], places: Array, count: int) -> Array:
        """So many numbers of each element that follow from the places of its nodes, shape (e, count)."""
        names = [f"x{a + 1}" for a in range(cls.nodes)]
        traced = trace(law, dict.fromkeys(names, "vector"), count, cls.__name__)
        inputs = inputs_for(traced, {n: places[:, a] for a, n in enumerate(names)}, {}, {})
        return matrix(traced.columns(*inputs), len(places), places.dtype)

    def values(self, particles: Particles, x: Array) -> Array:
        """C of each element, shape (e,)."""
        return self.at(x[self.rows(particles)])

    def rests(self, particles: Particles, t: float) -> Array:
        """C of each element without force at time t, shape (e,)."""
        everything = np.arange(len(self.ids))
        inputs = inputs_for(self._traced_rest, {}, {"t": float(t)}, self.settings(particles, t, everything))
        (rest,) = self._traced_rest.columns(*inputs)
        return np.asarray(np.broadcast_to(rest, everything.shape))

    @cached_property
    def _traced_rest(self) -> Traced:
        names = ["t", *list(self.parameters)[2:]]
        return trace(self.resting, dict.fromkeys(names, "scalar"), 1, f"rest of {self.name}")

    def _parts(self, arguments: Sequence[Any], each: int) -> tuple[Sequence[Any], Any, Any, Any]:
        """From a law's arguments: `each` vectors of each node, k_s, k_d, and C without force."""
        state, (t, k_s, k_d, rest, *own) = arguments[: each * self.nodes], arguments[each * self.nodes :]
        return state, k_s, k_d, self.resting(t, rest, *own)

    def _excess(self, c: Any, rest: Any) -> tuple[Any, Any]:
        """`excess` and its slope, of a traced C."""
        excess = self.excess(c, rest)
        (steep,) = gradient(excess, (c,))
        return excess, steep

    def _pulled(self, state: Sequence[Any], k_s: Any, k_d: Any, rest: Any) -> tuple[list[Any], Any, Any, Any]:
        """Of traced places and velocities: dC/dx of each node, dC/dt, the tension k_s (C - rest) + k_d dC/dt, and its
        slope k_s."""
        x, v = state[0::2], state[1::2]
        c = self.constraint(*x)
        slopes = [gradient(c, node) for node in x]
        rate: Any = 0.0
        for slope, velocity in zip(slopes, v, strict=True):
            rate = rate + fn.dot(slope, velocity)
        excess, steep = self._excess(c, rest)
        return slopes, rate, k_s * excess + k_d * rate, k_s * steep


def spring_force(law: Callable[..., Any]) -> type[ElementForce]:
    """Make a force between pairs of particles from a law.

    Parameters
    ----------
    law : `law(x1, v1, x2, v2, t, *parameters) -> fx, fy, fz`, the force on the first particle [N]; the second takes
        the opposite. Positions and velocities are vectors: x1[0], x1 - x2, k * v1. It is called once, on symbols.

    Returns
    -------
    type
        A class of forces; its constructor takes `pairs` (ids, shape (e, 2)) and the law's parameters by name.

    Examples
    --------
    >>> @pm.spring_force
    ... def rubber(x1, v1, x2, v2, t, k=50.0, rest=1.0):
    ...     d = x1 - x2
    ...     stretch = pm.maximum(pm.length(d) - rest, 0.0)  # it pulls and never pushes
    ...     return -k * stretch * pm.inverse(pm.length(d)) * d
    >>> system = pm.ParticleSystem(particles, forces=[rubber(pairs=[(0, 1), (1, 2)], k=80.0)])
    """
    return element_force(2)(law)


def element_force(nodes: int) -> Callable[[Callable[..., Any]], type[ElementForce]]:
    """Make a force between sets of `nodes` particles: like `spring_force`, for (x1, v1, ..., xk, vk, t, *parameters).

    The law returns the forces on all nodes, or on all but the last, which takes minus their sum.
    """

    nodes = whole_number("nodes", nodes, at_least=2)

    def decorate(law: Callable[..., Any]) -> type[ElementForce]:
        fixed = [f"{q}{a + 1}" for a in range(nodes) for q in "xv"] + ["t"]
        own = law_parameters(law, fixed)
        argument = "pairs" if nodes == 2 else "elements"

        def __init__(self: Any, *, enabled: bool = True, **given: Any) -> None:
            if argument not in given:
                raise InvalidInput(f"law {law_name(law)!r} needs {argument!r}: ids of particles, shape (e, {nodes})")
            ids = given.pop(argument)
            ElementForce.__init__(self, ids, parameters_from(law, own, given), enabled=enabled)

        body = {"__init__": __init__, "law": staticmethod(law), "nodes": nodes, **origin(law)}
        return type(law_name(law), (ElementForce,), body)

    return decorate


def _node_ids(name: str, ids: ArrayLike, nodes: int) -> NDArray[np.int64]:
    try:
        array = np.asarray(ids)
        array = array.reshape(0, nodes).astype(np.int64) if array.size == 0 else array
    except ValueError:
        array = np.zeros(0)
    if array.ndim != 2 or array.shape[1] != nodes or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInput(f"{name} needs {nodes} particle ids for each element, shape (e, {nodes})")
    ordered = np.sort(array, axis=1)
    twice = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if twice.any():
        element = int(np.argmax(twice))
        raise InvalidInput(f"{name} {element} joins particle {_repeated(ordered[element])} with itself")
    return array.astype(np.int64)


def _repeated(ordered: NDArray[np.integer[Any]]) -> int:
    return int(ordered[1:][ordered[1:] == ordered[:-1]][0])
