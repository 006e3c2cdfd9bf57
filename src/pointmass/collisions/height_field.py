"""Ground whose height is given on a grid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.collisions.collider import Contact, Response
from pointmass.collisions.triangulated import Triangulated
from pointmass.errors import InvalidInput, finite_array, number, reading
from pointmass.laws.parameter import Vector
from pointmass.meshes import TriangleMesh

HeightSource = str | Path | ArrayLike
MOST = 1_000_000  # heights: some 1 GB of triangles
ARRAYS = (".npy", ".npz")
IMAGES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".webp")


class HeightField(Triangulated):
    """A block of ground with hills and valleys on top, two triangles for each cell of the grid.

    It covers -size/2 to size/2 along x and z, and is solid down to `depth` below its lowest height. Around it there is
    nothing: who leaves it falls off.

    Parameters
    ----------
    heights : [m], shape (nx, nz) along x and z, at least 2 x 2 and at most a million, y up. Or the path of a file:
        `.npy`, `.npz` with the one array, or an image, whose columns are along x and whose rows are along z; its black
        is 0 and its white is 1.
    size : lengths along x and z [m], each above 0.
    height : factor on the heights, above 0; of an image, how high its white is [m].
    depth : of the ground below its lowest height [m], above 0.
    shift : moves the whole block [m]; a function of t.
    restitution, friction, eps, contact, response : as for every collider.

    Raises
    ------
    InvalidInput
        Another shape, a height that is not finite, a file that is missing, damaged or of another kind.

    Examples
    --------
    >>> x, z = np.meshgrid(np.linspace(-5, 5, 64), np.linspace(-5, 5, 64), indexing="ij")
    >>> dunes = pm.HeightField(0.3 * np.sin(x + 0.5 * z), size=(10, 10), friction=0.6)
    """

    def __init__(
        self,
        heights: HeightSource,
        size: Any = (10.0, 10.0),
        *,
        height: float = 1.0,
        depth: float = 1.0,
        shift: Vector = (0.0, 0.0, 0.0),
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
        response: Response = "bounce",
    ) -> None:
        values = _read(heights) if isinstance(heights, (str, Path)) else _checked(heights)
        sides = finite_array("size", size, (2,))
        if (sides <= 0).any():
            raise InvalidInput(f"size = {size} is not allowed: the lengths of the ground must be greater than 0 [m]")
        self.heights = number("height", height, above=0) * values
        bottom = float(self.heights.min()) - number("depth", depth, above=0, unit="m")
        block = _block(self.heights, sides, bottom)
        super().__init__(block, False, 0.0, shift, restitution, friction, eps, contact, response)


def _checked(heights: Any) -> NDArray[np.float64]:
    values = finite_array("heights", heights, (None, None))
    if min(values.shape) < 2 or values.size > MOST:
        raise InvalidInput(f"heights must be at least 2 x 2 and at most {MOST} numbers, not {values.shape}")
    return values


def _read(path: str | Path) -> NDArray[np.float64]:
    """Heights from a file."""
    with reading("height", path, (*ARRAYS, *IMAGES)) as file:
        return _checked(_array(file) if file.suffix.lower() in ARRAYS else _image(file))


def _array(path: Path) -> Any:
    data = np.load(path, allow_pickle=False)
    if isinstance(data, np.ndarray):
        return data
    with data:
        if len(data.files) != 1:
            raise InvalidInput(f"it must hold one array, but it holds {', '.join(data.files) or 'none'}")
        return data[data.files[0]]


def _image(path: Path) -> NDArray[np.float64]:
    from PIL import Image

    with Image.open(path) as image:
        deep = image.mode.startswith("I") or image.mode == "F"
        levels = np.asarray(image if deep else image.convert("L"), np.float64)
        white = {"F": 1.0}.get(image.mode, 65535.0 if deep else 255.0)
    return levels.T / white


def _block(heights: NDArray[np.float64], sides: NDArray[np.float64], bottom: float) -> TriangleMesh:
    """The skin of the ground: its top, walls around it, and a bottom that is a fan around its middle."""
    nx, nz = heights.shape
    x, z = (np.linspace(-0.5 * s, 0.5 * s, n) for s, n in zip(sides, heights.shape, strict=True))
    places = np.stack([*np.meshgrid(x, z, indexing="ij"), heights], axis=-1)[:, :, [0, 2, 1]]
    number = np.arange(nx * nz).reshape(nx, nz)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    around = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    k = len(around)
    low = places.reshape(-1, 3)[around]
    low[:, 1] = bottom
    vertices = np.concatenate([places.reshape(-1, 3), low, [[0.0, bottom, 0.0]]])
    under, middle = nx * nz + np.arange(k), np.full(k, nx * nz + k)
    ahead, under_ahead = np.roll(around, -1), np.roll(under, -1)
    faces = [
        *([p.ravel() for p in face] for face in ((a, d, c), (a, c, b))),
        *([around, under, ahead], [ahead, under, under_ahead], [under, middle, under_ahead]),
    ]
    return TriangleMesh(vertices, np.concatenate([np.stack(f, axis=1) for f in faces]))
