"""One group of arrays as a folder in Zarr format 3, written beside and renamed into place.

The zarr library takes some 4 ms to create an array, which is more than many a frame takes to compute. Here it is asked
once for the metadata of each kind of array; the chunk of an array is then its bytes, compressed.

What is damaged is noticed: chunks end with Zstandard's checksum, which every reader of them checks, and the attributes
of a group say what arrays it has, with these checksums, and have one of their own.
"""

from __future__ import annotations

import json
import math
import shutil
import zlib
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
CHECK = "check"  # attribute of a group: type, shape and checksum of its arrays, and the checksum of all attributes
SUM = 4  # bytes of the checksum at the end of a chunk
LARGEST = 1 << 30  # bytes of metadata
FRAME = 0xFD2FB528  # how data of Zstandard begin


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
        kinds = {name: _write_array(part / name, array) for name, array in arrays.items()}
        # Its metadata come last: what a kill leaves behind is then no group for other programs either.
        _write_attributes(part / METADATA, attributes, kinds)
        part.rename(folder)
    except FileExistsError:
        shutil.rmtree(part)
        write_group(folder, attributes, arrays)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def write_attributes(folder: Path, attributes: Attributes) -> None:
    """Give a group without arrays that is there other attributes, at once for all who look.

    Raises
    ------
    OSError
        They cannot be written.
    """
    part = folder / f".{METADATA}.part"
    _write_attributes(part, attributes, {})
    part.replace(folder / METADATA)


def read_attributes(folder: Path) -> Attributes:
    """The attributes of a group.

    Raises
    ------
    Damaged
        It is no group, or not the one that was written.
    """
    return _attributes_and_kinds(folder)[0]


def read_group(folder: Path) -> tuple[Attributes, dict[str, Array]]:
    """The attributes and the arrays of a group.

    Raises
    ------
    Damaged
        Something in it is missing, cut off, not what was written, or stored in another way than `write_group` does.
    """
    attributes, kinds = _attributes_and_kinds(folder)
    if any(Path(name).name != name or name == ".." for name in kinds):
        raise Damaged(f"{folder.name} has arrays outside of it")
    arrays = {name: _read_array(folder / name, kind) for name, kind in kinds.items()}
    return attributes, arrays


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
        compressors=ZstdCodec(level=LEVEL, checksum=True),
        chunk_key_encoding={"name": "default", "separator": "."},
    )
    result: Attributes = json.loads(contents[METADATA].to_bytes())
    return result


def _write_array(folder: Path, array: Array) -> list[Any]:
    """Write an array; returns its type, shape and checksum."""
    from numcodecs.zstd import compress

    array = np.asarray(array, array.dtype.newbyteorder("<"), order="C")
    metadata = dict(_metadata_of(array.dtype.newbyteorder("=").name, array.ndim))
    chunk = [max(1, side) for side in array.shape]
    metadata |= {"shape": list(array.shape), "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}}}
    folder.mkdir()
    _write_json(folder / METADATA, metadata)
    data = b""
    if array.size:  # an array without entries has no chunk
        data = compress(array, LEVEL, True)
        (folder / _chunk(array.ndim)).write_bytes(data)
    return _kind(array.dtype, array.shape, data)


def _read_array(folder: Path, kind: list[Any]) -> Array:
    from numcodecs.zstd import decompress

    metadata = _read_json(folder / METADATA)
    try:
        shape, dtype = tuple(metadata["shape"]), np.dtype(metadata["data_type"])
        chunk = tuple(metadata["chunk_grid"]["configuration"]["chunk_shape"])
        codecs = [codec["name"] for codec in metadata["codecs"]]
        if codecs != CODECS or chunk != tuple(max(1, side) for side in shape):
            raise Damaged(f"{folder.name} was stored by another program")
        data = b"" if 0 in shape else (folder / _chunk(len(shape))).read_bytes()
        if _kind(dtype, shape, data) != kind:
            raise Damaged(f"{folder.name} is another array than that which was written")
        if 0 in shape:
            return np.zeros(shape, dtype)
        if _promised(data) != math.prod(shape) * dtype.itemsize:  # before there is room for it
            raise Damaged(f"{folder.name} has another length than its shape says")
        result = np.frombuffer(decompress(data), dtype.newbyteorder("<")).reshape(shape)
        return result.astype(dtype)  # a copy that can be written to: kernels are compiled for such arrays only
    except (OSError, KeyError, TypeError, ValueError, RuntimeError, OverflowError) as error:
        raise Damaged(f"{folder.name} is cut off or damaged ({type(error).__name__})") from None


def _promised(data: bytes) -> int:
    """How many bytes data of Zstandard say that they hold (RFC 8878, 3.1.1); -1 if they do not."""
    if len(data) < 5 or int.from_bytes(data[:4], "little") != FRAME:
        return -1
    descriptor = data[4]
    single = descriptor >> 5 & 1
    width = (single, 2, 4, 8)[descriptor >> 6]
    start = 5 + (1 - single) + (0, 1, 2, 4)[descriptor & 3]
    size = int.from_bytes(data[start : start + width], "little")
    return -1 if width == 0 else size + (256 if width == 2 else 0)


def _chunk(ndim: int) -> str:
    """File name of the only chunk."""
    return ".".join(["c", *["0"] * ndim])


def _kind(dtype: np.dtype[Any], shape: tuple[int, ...], data: bytes) -> list[Any]:
    """Type, shape and checksum of an array as they can stand in JSON."""
    return [dtype.name, *shape, int.from_bytes(data[-SUM:], "little")]


def _write_attributes(path: Path, attributes: Attributes, kinds: Mapping[str, list[Any]]) -> None:
    whole = {**attributes, CHECK: {"arrays": kinds}}
    whole[CHECK] = {"arrays": kinds, "crc32": _checksum(whole)}
    _write_json(path, {"zarr_format": 3, "node_type": "group", "attributes": whole})


def _attributes_and_kinds(folder: Path) -> tuple[Attributes, dict[str, list[Any]]]:
    attributes = _read_json(folder / METADATA).get("attributes")
    if not isinstance(attributes, dict):
        raise Damaged(f"{folder.name} has no attributes")
    check = attributes.get(CHECK)
    if not isinstance(check, dict) or not isinstance(check.get("arrays"), dict):
        raise Damaged(f"{folder.name} has no checksum")
    found = check.pop("crc32", None)
    if found != _checksum(attributes):
        raise Damaged(f"the attributes of {folder.name} are not those that were written")
    del attributes[CHECK]
    return attributes, check["arrays"]


def stated_attributes(folder: Path) -> Attributes:
    """What a folder says of itself, whether that can be believed or not; nothing where it is no group."""
    try:
        attributes = _read_json(folder / METADATA).get("attributes")
    except Damaged:
        attributes = None
    return attributes if isinstance(attributes, dict) else {}


def _checksum(attributes: Attributes) -> int:
    return zlib.crc32(json.dumps(attributes, sort_keys=True).encode())


def _write_json(path: Path, contents: Attributes) -> None:
    path.write_bytes(json.dumps(contents, indent=1, allow_nan=False).encode())


def _read_json(path: Path) -> Attributes:
    try:
        contents = json.loads(path.read_bytes()) if path.stat().st_size <= LARGEST else None
    except (OSError, ValueError, RecursionError):
        contents = None
    if not isinstance(contents, dict):
        raise Damaged(f"{path.parent.name} has no {METADATA} that can be read")
    return contents
