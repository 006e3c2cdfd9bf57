"""What a picture follows from, as a short text: the same for what gives the same picture."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from hashlib import blake2b
from typing import Any

import numpy as np

from pointmass.frame import Frame

LETTERS = 32


class Fingerprints:
    """Of frames, with all else that a picture of them follows from."""

    def __init__(self, *settings: Any) -> None:
        """Take what is the same for all frames, such as the camera and the style."""
        self._settings = _hash(settings)
        self._seen: dict[int, tuple[Any, bytes]] = {}

    def of(self, frame: Frame) -> str:
        """The fingerprint of a picture of a frame."""
        parts = [_hash((frame.number, frame.time, frame.ids, frame.positions, frame.velocities, frame.quantities))]
        known = {}
        for drawable in frame.drawables:  # one that has not changed is the same object
            known[id(drawable)] = self._seen.get(id(drawable)) or (drawable, _hash(drawable))
            parts.append(known[id(drawable)][1])
        self._seen = known
        return together([self._settings.hex(), *(part.hex() for part in parts)])


def together(texts: list[str]) -> str:
    """One fingerprint of several."""
    return blake2b("\n".join(texts).encode(), digest_size=LETTERS // 2).hexdigest()


def _hash(value: Any) -> bytes:
    whole = blake2b(digest_size=LETTERS // 2)
    _feed(whole, value)
    return whole.digest()


def _feed(whole: blake2b, value: Any) -> None:
    """Feed a value and its kind, so that no two different ones feed the same."""
    whole.update(f"{type(value).__name__}(".encode())
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.ascontiguousarray(value)
        whole.update(f"{array.dtype.str}{array.shape}".encode())
        whole.update(array.data if array.size else b"")
    elif is_dataclass(value):
        for field in fields(value):
            _feed(whole, getattr(value, field.name))
    elif isinstance(value, dict):
        _feed(whole, list(value.items()))
    elif isinstance(value, (tuple, list)):
        for item in value:
            _feed(whole, item)
    else:
        whole.update(repr(value).encode())
    whole.update(b")")
