"""A process that has everything loaded and runs the command in forks of itself, some of which it kills.

So a kill hits the work and not the start of Python, and takes a tenth of the time. Lines of JSON come and go:
`{"arguments": [...], "kill": seconds or null}` -> `{"code": exit code or null, "seconds": ...}`.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from pointmass.cli import main


def run(arguments: list[str], kill: float | None) -> dict[str, float | None]:
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            main(arguments)
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            sys.stderr.flush()
            os._exit(code)
    if kill is not None:
        time.sleep(kill)
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    return {"code": None if code < 0 else code, "seconds": time.monotonic() - start}


def load() -> None:
    """All that the commands need, and their kernels, by doing each once."""
    cache = "warm.zarr"
    commands = [["run", "a.toml", "-o", cache, "--frames", "3"], ["render", cache, "-o", "warm.mp4", "--size", "64x48"]]
    commands += [["export", cache, f"warm{suffix}"] for suffix in (".usd", ".npz", ".pvd", ".gsd", ".glb", ".html")]
    for command in commands:
        with suppress(SystemExit):
            main([*command, "--quiet"])
    for made in Path().glob("warm*"):
        shutil.rmtree(made) if made.is_dir() else made.unlink()


if __name__ == "__main__":
    out = os.dup(1)
    log = os.open("commands.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(log, 1)
    os.dup2(log, 2)
    load()
    with os.fdopen(out, "w") as answers:
        for line in sys.stdin:
            answers.write(json.dumps(run(**json.loads(line))) + "\n")
            answers.flush()
