"""What a fish does next: the order of its concerns (Tu & Terzopoulos, SIGGRAPH 1994)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

AVOID_OBSTACLE, AVOID_FISH, EAT, MATE, LEAVE, WANDER, ESCAPE, SCHOOL = range(8)
NAMES = ("avoid obstacle", "avoid fish", "eat", "mate", "leave", "wander", "escape", "school")


def intention(
    obstacle: Any,
    crowded: Any,
    fear: Any,
    greatest: Any,
    hunger: Any,
    libido: Any,
    before: Any,
    suits: Any,
    schools: Any,
    coin: Any,
    *,
    afraid: float,
    panic: float,
    urge: float,
) -> NDArray[np.int64]:
    """The number of the routine of each fish.

    Collisions come first; then fear: who keeps to a school does so unless one predator alone is too near, else it
    escapes; then what it was about, if it was to eat or to mate and still wants to; then the stronger of hunger and
    libido; and else it wanders, or leaves where it does not like the water.

    Parameters
    ----------
    obstacle, crowded : whether an obstacle, or a fish, is too near.
    fear, greatest : of all predators, and of the one that is feared most.
    hunger, libido : from 0 to 1.
    before : the routine of eating or mating that it is in the middle of, else -1.
    suits : whether the water suits it.
    schools : whether it keeps to a school when afraid.
    coin : a number from 0 to 1 that decides a tie.
    afraid, panic : fear f0 that counts, and f1 of one predator beyond which no school helps.
    urge : hunger or libido r that counts.
    """
    result = np.where(suits, WANDER, LEAVE)
    wish = np.where((hunger > libido) | ((hunger == libido) & (np.asarray(coin) < 0.5)), EAT, MATE)
    tie = (hunger == libido) & (np.asarray(before) >= 0)
    wish = np.where(tie, before, wish)
    result = np.where(np.maximum(hunger, libido) > urge, wish, result)
    busy = ((before == EAT) & (hunger > 0)) | ((before == MATE) & (libido > 0))
    result = np.where(busy, before, result)
    together = np.asarray(schools) & (np.asarray(greatest) < panic)
    result = np.where(np.asarray(fear) > afraid, np.where(together, SCHOOL, ESCAPE), result)
    result = np.where(crowded, AVOID_FISH, result)
    return np.asarray(np.where(obstacle, AVOID_OBSTACLE, result), np.int64)
