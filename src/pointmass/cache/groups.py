"""One group of arrays as a folder in Zarr format 3, written beside and renamed into place.

The zarr library takes some 4 ms to create an array, which is more than many a frame takes to compute. Here it is asked
once for the metadata of each kind of array; the chunk of an array is then its bytes, compressed.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Attributes = dict[str, Any]

METADATA = "zarr.json"
LEVEL = 1  # of Zstandard: higher ones take longer and save little on numbers that look random
SMALL = 16  # arrays with fewer entries are kept in the attributes: no files of their own
CODECS = ["bytes", "zstd"]


class Damaged(Exception):
    """A folder that does not hold what `write_group` writes."""


def write_group(folder: Path, attributes: Attributes, arrays: Mapping[str, Array]) -> None:
    """Write a group that is there completely or not at all.

    Raises
    ------
    OSError
        It cannot be written.
    """
    part = folder.with_name(f".{folder.name}.part")
    try:
        part.mkdir()
        for name, array in arrays.items():
            _write_array(part / name, array)
        # Its metadata come last: what a kill leaves behind is then no group for other programs either.
        _write_json(part / METADATA, {"zarr_format": 3, "node_type": "group", "attributes": attributes})
        part.rename(folder)
    except FileExistsError:
        shutil.rmtree(part)
        write_group(folder, attributes, arrays)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def write_attributes(folder: Path, attributes: Attributes) -> None:
    """Give a group that is there other attributes, at once for all who look.

    Raises
    ------
    OSError
        They cannot be written.
    """
    part = folder / f".{METADATA}.part"
    _write_json(part, {"zarr_format": 3, "node_type": "group", "attributes": attributes})
    part.replace(folder / METADATA)


def read_attributes(folder: Path) -> Attributes:
    """The attributes of a group.

    Raises
    ------
    Damaged
        It is no group.
    """
    attributes = _read_json(folder / METADATA).get("attributes")
    if not isinstance(attributes, dict):
        raise Damaged(f"{folder.name} has no attributes")
    return attributes


def read_group(folder: Path) -> tuple[Attributes, dict[str, Array]]:
    """The attributes and the arrays of a group.

    Raises
    ------
    Damaged
        Something in it is missing, cut off, or stored in another way than `write_group` does.
    """
    attributes = read_attributes(folder)
    return attributes, {item.name: _read_array(item) for item in sorted(folder.iterdir()) if item.is_dir()}


def packed(value: Any) -> Any:
    """A number, a small array, a tuple or text as JSON that gives the same bits back."""
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.asarray(value)
        values = [_number(v) for v in array.ravel().tolist()]
        return {"dtype": array.dtype.name, "shape": list(array.shape), "values": values}
    if isinstance(value, (tuple, list)):
        return [packed(v) for v in value]
    return _number(value)


def unpacked(value: Any) -> Any:
    """What `packed` was given; lists come back as tuples."""
    if isinstance(value, Mapping):
        if "number" in value:
            return float(value["number"])
        values = [unpacked(v) for v in value["values"]]
        return np.array(values, value["dtype"]).reshape(value["shape"])[()]
    return tuple(unpacked(v) for v in value) if isinstance(value, list) else value


def _number(value: Any) -> Any:
    """JSON has no NaN and no infinity."""
    return {"number": str(value)} if isinstance(value, float) and not math.isfinite(value) else value


@cache
def _metadata_of(dtype: str, ndim: int) -> Attributes:
    """What zarr writes about an array with a single chunk; its shape is still to be filled in."""
    import zarr
    from zarr.codecs import ZstdCodec
    from zarr.storage import MemoryStore

    contents: dict[str, Any] = {}
    zarr.create_array(
        store=MemoryStore(contents),
        shape=(1,) * ndim,
        chunks=(1,) * ndim,
        dtype=dtype,
        compressors=ZstdCodec(level=LEVEL),
        chunk_key_encoding={"name": "default", "separator": "."},
    )
    result: Attributes = json.loads(contents[METADATA].to_bytes())
    return result


def _write_array(folder: Path, array: Array) -> None:
    from numcodecs.zstd import compress

    array = np.asarray(array, array.dtype.newbyteorder("<"), order="C")
    metadata = dict(_metadata_of(array.dtype.newbyteorder("=").name, array.ndim))
    chunk = [max(1, side) for side in array.shape]
    metadata |= {"shape": list(array.shape), "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}}}
    folder.mkdir()
    _write_json(folder / METADATA, metadata)
    if array.size:  # an array without entries has no chunk
        (folder / _chunk(array.ndim)).write_bytes(compress(array.tobytes(), LEVEL))


def _read_array(folder: Path) -> Array:
    from numcodecs.zstd import decompress

    metadata = _read_json(folder / METADATA)
    try:
        shape, dtype = tuple(metadata["shape"]), np.dtype(metadata["data_type"])
        chunk = tuple(metadata["chunk_grid"]["configuration"]["chunk_shape"])
        codecs = [codec["name"] for codec in metadata["codecs"]]
        if codecs != CODECS or chunk != tuple(max(1, side) for side in shape):
            raise Damaged(f"{folder.name} was stored by another program")
        if 0 in shape:
            return np.zeros(shape, dtype)
        data = decompress((folder / _chunk(len(shape))).read_bytes())
        result = np.frombuffer(data, dtype.newbyteorder("<")).reshape(shape)
        return result.astype(dtype)  # a copy that can be written to: kernels are compiled for such arrays only
    except (OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise Damaged(f"{folder.name} is cut off or damaged ({type(error).__name__})") from None


def _chunk(ndim: int) -> str:
    """File name of the only chunk."""
    return ".".join(["c", *["0"] * ndim])


def _write_json(path: Path, contents: Attributes) -> None:
    path.write_bytes(json.dumps(contents, indent=1, allow_nan=False).encode())


def _read_json(path: Path) -> Attributes:
    try:
        contents = json.loads(path.read_bytes())
    except (OSError, ValueError):
        contents = None
    if not isinstance(contents, dict):
        raise Damaged(f"{path.parent.name} has no {METADATA} that can be read")
    return contents
