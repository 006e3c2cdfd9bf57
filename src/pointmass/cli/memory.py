"""A limit on the memory of a command, so that no scene, cache or mesh, whoever made it, can take the machine down."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

SHARE = 0.75  # of the machine's memory
CONTAINER = Path("/sys/fs/cgroup/memory.max")  # bytes that a container may have, or "max"


@contextmanager
def limited() -> Iterator[None]:
    """Inside, this process gets three quarters of the machine's memory and then a MemoryError; on Linux.

    Other systems do not keep to such a limit; there it is as if `lift` had been called.
    """
    limits = _limits()
    if limits is None:
        yield
        return
    set_limits, (soft, hard) = limits
    wanted = int(SHARE * _machine())
    inside = [bound for bound in (wanted, soft, hard) if bound >= 0]  # below 0: there is none
    set_limits((min(inside), hard))
    try:
        yield
    finally:
        set_limits((soft, hard))


def lift() -> None:
    """Take the limit away."""
    limits = _limits()
    if limits is not None:
        set_limits, (_, hard) = limits
        set_limits((hard, hard))


def memory_sentence(error: MemoryError) -> str:
    """What there is to say when there is no more memory."""
    limits = _limits()
    bound = -1 if limits is None else limits[1][0]
    if bound < 0 or bound != int(SHARE * _machine()):
        return f"there is not enough memory: {error or 'take fewer particles or a smaller picture'}"
    return (
        f"this needs more than {bound / 2**30:.1f} GiB, {SHARE:.0%} of the machine's memory: take fewer particles or a"
        f" smaller picture, or give --allow-large"
    )


def add_allow_large(command: click.Command) -> click.Command:
    """A command with the option that takes the limit away."""
    if not any(option.name == "allow_large" for option in command.params):
        says = f"Use more than {SHARE:.0%} of the machine's memory if that is asked for."
        command.params.append(
            click.Option(["--allow-large"], is_flag=True, is_eager=True, expose_value=False, callback=_asked, help=says)
        )
    return command


def _asked(context: click.Context, option: click.Parameter, value: bool) -> None:
    if value:
        lift()


def _limits() -> tuple[Any, tuple[int, int]] | None:
    """What sets the limits of this process, and those that it has; None where there are none."""
    if not Path("/proc/self").exists():  # macOS takes a limit and does not keep to it
        return None
    import resource

    def set_limits(both: tuple[int, int]) -> None:
        resource.setrlimit(resource.RLIMIT_DATA, both)

    return set_limits, resource.getrlimit(resource.RLIMIT_DATA)


def _machine() -> int:
    """Memory of the machine, or of the container [bytes]."""
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        return min(whole, int(CONTAINER.read_text()))
    except (OSError, ValueError):
        return whole
