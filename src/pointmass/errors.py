"""What can go wrong, each as one sentence: which parameter, which value, what is allowed, what to do."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np


class PointmassError(Exception):
    """Base of every error that pointmass raises on purpose."""


class InvalidInput(PointmassError, ValueError):
    """An argument, scene file or data file that cannot be used; the message is one sentence."""


class Diverged(PointmassError, ArithmeticError):
    """A run produced a number that is not finite, or a solver could not take its step.

    Attributes
    ----------
    particle : int or None
        Id of the first particle that went wrong.
    force : str or None
        The force that acts on it most strongly, or the one that is singular there.
    step : int or None
        The step of the solver, counted from the start of the run.
    time : float or None
        Time at which that step began [s].
    largest_safe_dt : float or None
        Largest step that the stiffnesses and the solver's stability limit allow [s]; of more than 2000 particles a
        bound from below, that is a step that they allow.
    """

    def __init__(
        self,
        message: str,
        *,
        particle: int | None = None,
        force: str | None = None,
        step: int | None = None,
        time: float | None = None,
        largest_safe_dt: float | None = None,
    ) -> None:
        super().__init__(message)
        self.particle = particle
        self.force = force
        self.step = step
        self.time = time
        self.largest_safe_dt = largest_safe_dt


class UnstableStep(UserWarning):
    """A step is longer than the largest with which the motions at the start of a run stay in bounds; it runs anyway."""


class DividedStep(UserWarning):
    """The equations of an implicit step were not solved as they are, so it was made in parts."""


def unknown(what: str, name: object, known: Iterable[str]) -> InvalidInput:
    """The error for a name that is not in a list, with the nearest one that is."""
    names = sorted(known)
    near = get_close_matches(str(name), names, n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return InvalidInput(f"unknown {what} {shown(name)}: {hint}known are {', '.join(names) or 'none'}")


@contextmanager
def about(what: str) -> Iterator[None]:
    """Say at the beginning of an `InvalidInput` what it is about."""
    try:
        yield
    except InvalidInput as error:
        raise InvalidInput(f"{what}: {error}") from None


@contextmanager
def reading(what: str, path: str | Path, endings: Sequence[str]) -> Iterator[Path]:
    """Read a file: whatever its reader runs into, the user hears in one sentence what is wrong with the file.

    Parameters
    ----------
    what : in the file, such as "mesh".
    endings : that are known, in small letters.

    Raises
    ------
    InvalidInput
        Another ending, no such file, or a reader that fails.
    """
    file = Path(path)
    if file.suffix.lower() not in endings:
        raise InvalidInput(f"{what} file {str(path)!r} must end in {', '.join(endings)}, not in {file.suffix!r}")
    if not file.is_file():
        raise InvalidInput(f"{what} file {str(path)!r} does not exist")
    with about(f"{what} file {str(path)!r}"):
        try:
            yield file
        except InvalidInput:
            raise
        except Exception as error:  # readers raise whatever their parsing of damaged bytes runs into
            raise InvalidInput(
                f"it is damaged or not what its ending says ({type(error).__name__}): write it again"
            ) from None


def floats(value: Any) -> np.ndarray | None:
    """`value` as a new float64 array; None for text, complex numbers, and rows of different lengths."""
    try:
        array = np.asarray(value)
        with np.errstate(over="ignore"):  # of long doubles
            return np.array(array, np.float64) if array.dtype.kind in "biufO" else None
    except (TypeError, ValueError, OverflowError):
        return None


def finite_array(name: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """`value` as a float64 array of `shape` (None = any length) without NaN or infinity."""
    array = floats(value)
    if array is None:
        raise InvalidInput(f"{name} must be numbers of shape {_shape(shape)}, not {shown(value)}")
    if array.ndim != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        raise InvalidInput(f"{name} must have shape {_shape(shape)}, not {array.shape}")
    if not np.isfinite(array).all():
        row = int(np.argwhere(~np.isfinite(array))[0][0]) if array.ndim else 0
        raise InvalidInput(f"{name} must be finite, but entry {row} is {array.ravel()[~np.isfinite(array.ravel())][0]}")
    return array


def number(
    name: str,
    value: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    unit: str = "",
) -> float:
    """`value` as a finite float inside the bounds, or `InvalidInput` that names all of them."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise InvalidInput(f"{name} must be a number, not {shown(value)}") from None
    except OverflowError:  # a whole number of Python that no float holds
        result = value = math.inf
    bounds = [
        text
        for bound, text in (
            (above, f"greater than {above}"),
            (at_least, f"at least {at_least}"),
            (at_most, f"at most {at_most}"),
        )
        if bound is not None
    ]
    allowed = "finite" + "".join(f" and {b}" for b in bounds) + (f" [{unit}]" if unit else "")
    inside = (
        math.isfinite(result)
        and (above is None or result > above)
        and (at_least is None or result >= at_least)
        and (at_most is None or result <= at_most)
    )
    if not inside:
        raise InvalidInput(f"{name} = {value} is not allowed: it must be {allowed}")
    return result


def whole_number(name: str, value: Any, *, at_least: int) -> int:
    """`value` as an int that is at least `at_least`, of at most 64 bits."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or not at_least <= value < 2**63:
        given = value if isinstance(value, (float, np.number)) else shown(value)
        large = " and less than 2^63" if whole and value > at_least else ""
        raise InvalidInput(f"{name} = {given} is not allowed: it must be a whole number, at least {at_least}{large}")
    return int(value)


def shown(value: object) -> str:
    """A value for a message: one line, arrays too, cut off where it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # a whole number of more digits than Python writes
        text = f"{type(value).__name__} of very many digits"
    return text if len(text) <= 60 else text[:57] + "..."


def _shape(shape: tuple[int | None, ...]) -> str:
    names = ["n" if s is None else str(s) for s in shape]
    return "(" + ", ".join(names) + ("," if len(names) == 1 else "") + ")"
