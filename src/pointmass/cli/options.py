"""Options that several commands share, and the scene that they describe."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pointmass.engine.threads import use_threads
from pointmass.errors import InvalidInput, number, unknown, whole_number

if TYPE_CHECKING:
    from pointmass.scene import Scene
    from pointmass.scenes import ShippedScene
    from pointmass.viewer.subject import Subject

Command = TypeVar("Command", bound=Callable[..., Any])

quiet = click.option("--quiet", "-q", is_flag=True, help="Say nothing but errors.")
as_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")


OPTIONS = ("frames", "fps", "dt", "substeps", "solver", "seed", "dtype", "preset")  # that change a simulation


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What a command line says about a run; None = as the scene says.

    Attributes
    ----------
    settings : of `--set`, each "name=value".
    threads : of Numba; changes no result.
    allow_outside : whether a scene file may name files outside of its folder.
    """

    frames: int | None = None
    fps: float | None = None
    dt: float | None = None
    substeps: int | None = None
    solver: str | None = None
    seed: int | None = None
    dtype: str | None = None
    preset: str | None = None
    threads: int | None = None
    allow_outside: bool = False
    settings: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Those that change a simulation, as they can stand in JSON; `RunOptions(**...)` has them again."""
        given = {name: getattr(self, name) for name in OPTIONS if getattr(self, name) is not None}
        return given | ({"settings": list(self.settings)} if self.settings else {})

    def given(self) -> list[str]:
        """The options that change a simulation."""
        values = {name: getattr(self, name) for name in OPTIONS}
        return [f"--{name}" for name, value in values.items() if value is not None] + ["--set"] * bool(self.settings)


def run_options(command: Command) -> Command:
    """Add the options of a run; the command takes `RunOptions` with `options_from(**values)`."""
    for option in reversed(
        [
            click.option("--frames", type=int, help="Length of the run."),
            click.option("--fps", type=float, help="Frames for a second of simulated time [1/s]."),
            click.option("--dt", type=float, help="Step of the solver [s]."),
            click.option("--substeps", type=int, help="Steps for each frame: dt = 1/(fps N)."),
            click.option("--solver", help="Such as rk4, see pointmass list; auto chooses."),
            click.option("--seed", type=int, help="Seed of all chance while it runs."),
            click.option("--dtype", help="float64 or float32."),
            click.option("--preset", help="Of a shipped scene, such as geyser of fountain; see pointmass list."),
            click.option("--threads", type=int, envvar="POINTMASS_THREADS", help="Threads; the result is the same."),
            click.option("--allow-outside", is_flag=True, help="A scene file may name files outside of its folder."),
            click.option(
                "--set",
                "settings",
                multiple=True,
                metavar="NAME=VALUE",
                help="Set a parameter of a scene, or a value in a TOML file by its path, such as forces.0.k=0.2.",
            ),
        ]
    ):
        command = option(command)
    return command


def load_scene(source: str, options: RunOptions) -> Scene:
    """The scene that a command line names, with its options.

    Raises
    ------
    InvalidInput
        No such scene, a file that is no scene, an option that is not allowed.
    """
    _prepare(options)
    return _with_options(_described(source, options), options)


def load_subject(source: str, options: RunOptions) -> Subject:
    """The scene that a command line names, with parameters that a live page can turn.

    Raises
    ------
    InvalidInput
        As for `load_scene`.
    """
    from pointmass.viewer.subject import Subject

    kind = shipped(source)
    if kind is None:
        return Subject.of_scene(load_scene(source, options))
    _prepare(options)
    scene = kind.with_settings(_settings(options.settings), options.preset)
    return Subject.of_shipped(scene, lambda built: _with_options(built, options))


def shipped(source: str) -> type[ShippedScene] | None:
    """The shipped scene of this name, if no file has it."""
    from pointmass.scenes import SCENES

    return None if Path(source).is_file() else SCENES.get(source)


def default_output(source: str, suffix: str) -> Path:
    """<scene>.zarr or <scene>.mp4 in the current folder."""
    return Path(f"{Path(source).stem}{suffix}")


def parse_size(text: str) -> tuple[int, int]:
    """Width and height [pixels] from text such as 1280x720."""
    match = re.fullmatch(r"(\d{1,6})[xX](\d{1,6})", text)
    if not match:
        raise InvalidInput(f"--size {text!r} is not allowed: write width and height in pixels, such as 1280x720")
    return int(match[1]), int(match[2])


def _prepare(options: RunOptions) -> None:
    use_threads(options.threads)
    if options.dt is not None and options.substeps is not None:
        raise InvalidInput("--dt and --substeps both set the step: give one of them")


def _described(source: str, options: RunOptions) -> Scene:
    path, settings, preset = Path(source), _settings(options.settings), options.preset
    if path.suffix == ".toml" or path.is_file():
        if preset is not None:
            raise InvalidInput(
                f"--preset {preset!r} is not allowed: only scenes that are shipped have presets, not files"
            )
        from pointmass.scene import Scene

        return Scene.load(path, settings, allow_outside=options.allow_outside)
    from pointmass.scenes import SCENES

    kind = shipped(source)
    if kind is not None:
        return kind.with_settings(settings, preset).build()
    if path.is_dir():
        raise InvalidInput(f"{source!r} is a folder, not a scene: give a TOML file or one of {', '.join(SCENES)}")
    raise unknown("scene", source, SCENES)


def _with_options(scene: Scene, options: RunOptions) -> Scene:
    from pointmass.solver_choice import AUTO
    from pointmass.solvers import find_solver

    changes: dict[str, Any] = {name: getattr(options, name) for name in ("frames", "fps", "dt", "seed", "dtype")}
    if options.solver is not None:
        changes["solver"] = AUTO if options.solver == AUTO else find_solver(options.solver)()
    changes = {name: value for name, value in changes.items() if value is not None}
    if options.substeps is not None:
        fps = number("fps", changes.get("fps", scene.fps), above=0, unit="1/s")
        changes["dt"] = 1 / (fps * whole_number("substeps", options.substeps, at_least=1))
    return scene.changed(**changes) if changes else scene


def _settings(texts: tuple[str, ...]) -> dict[str, Any]:
    """Values by name; each is read as a TOML value, or else as text."""
    result: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name:
            raise InvalidInput(f"--set {text!r} is not allowed: write name=value, such as k=0.2")
        result[name] = _value(value.strip())
    return result


def _value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return parsed["value"] if list(parsed) == ["value"] else text
