"""What is measured and shown beside the scene: plots, the lens, arrows, the picked particle. They change no run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pointmass.errors import InvalidInput
from pointmass.frame import Frame
from pointmass.viewer import columns as particle_columns
from pointmass.viewer import curves, field, lens, messages, pick, vectors
from pointmass.viewer.columns import Columns
from pointmass.viewer.messages import Contender, CurveEnd, Inbound, Inspected, Legend
from pointmass.viewer.player import Player
from pointmass.viewer.plots import Plots
from pointmass.viewer.track import Track


@dataclass(frozen=True)
class Readings:
    """What instruments say with a frame; see `FrameHead`."""

    tracks: tuple[Track, ...] = ()
    legend: Legend | None = None
    inspected: Inspected | None = None
    duel: Sequence[Contender] = ()
    curves: Sequence[CurveEnd] = ()


class Instruments:
    """All of them, for the frames of a player."""

    def __init__(self, player: Player) -> None:
        self._player = player
        self._plots, self._lens, self._vectors, self._pick = Plots(), lens.Lens(), vectors.Vectors(), pick.Pick()
        self._field, self._curves = field.Field(), curves.IntegralCurves()
        self._seen: field.Seen | None = None  # of the newest frame
        self._version = 0

    @property
    def message(self) -> messages.Instruments:
        """How they are set."""
        sims = self._player.sims
        return messages.Instruments(
            lenses=lens.choices(sims),
            lens=self._lens.name,
            vectors=[*vectors.choices(sims), *(field.CHOICES[name] for name in field.names(sims))],
            shown=[*self._vectors.shown, *self._field.shown(sims)],
            expressions=list(self._plots.expressions),
            names=particle_columns.names(sims),
            curves=self._curves.message(self._seen),
            duel=len(self._player.contenders) > 0,
            beside=self._player.beside,
        )

    def take(self, message: Inbound, frame: Frame, row: int) -> bool:
        """Take a message, if it is for them.

        Parameters
        ----------
        frame : the newest.
        row : of the particle in it that the message names, -1 if it names none.

        Raises
        ------
        InvalidInput
            It is not allowed, and nothing has changed.
        """
        sims = self._player.sims
        match message:
            case messages.Plot(text=text, on=True):
                self._plots.plot(text, Columns(frame, sims))
            case messages.Plot(text=text):
                self._plots.drop(text)
            case messages.Lens(name=name):
                self._lens.choose(name, sims)
            case messages.Vectors(name=name, on=on) if name in field.names(sims):
                self._field.choose(name, on)
            case messages.Vectors(name=name, on=on):
                self._vectors.choose(name, on, sims)
            case messages.Inspect() | messages.Dismiss():
                self._pick.choose(frame, sims, row)
            case messages.StartCurve(place=place):
                if self._seen is None:
                    raise InvalidInput(f"{self._player.name} has no velocity field, and so no integral curves")
                self._curves.start(place, frame.time)
            case messages.ChooseCurveSolver(name=name, on=on):
                self._curves.choose(name, on)
            case messages.SetCurveStep(dt=dt, span=span):
                self._curves.step(dt, span)
            case messages.ClearCurves():
                self._curves.clear()
            case _:
                return False
        return True

    def heed(self) -> None:
        """Settings have changed, and with them what there is to be seen."""
        self._lens.heed(self._player.sims)

    def forget(self) -> None:
        """The player plays something else: what is chosen may not be there."""
        self._lens, self._vectors = lens.Lens(), vectors.Vectors()
        self._field, self._curves = field.Field(), curves.IntegralCurves()
        for text in list(self._plots.expressions):
            self._plots.drop(text)
        self._pick.forget()

    def look(self, frame: Frame, *, fresh: bool) -> tuple[Frame, Readings]:
        """The frame as it is shown, and what is said of it.

        Parameters
        ----------
        fresh : whether it is another one than at the last look, so that it is measured.
        """
        sims = self._player.sims
        columns = Columns(frame, sims)
        self._version -= 1  # below 0: no drawable of the scene has it
        contenders, picked = self._player.contenders, self._pick.find(frame, sims)
        if fresh:
            self._plots.measure(frame, sims, columns, contenders)
            self._pick.measure(frame, picked)
        self._seen = self._field.see(frame, sims, self._player.setup)
        shown = self._lens.show(frame, sims, columns, self._version, self._seen)
        scale = None if shown.legend is None else (self._lens.name, shown.legend.high)
        drawables = self._field.draw(shown.frame, sims, self._seen, shown.paint, scale, self._version)
        lines, ends = self._curves.draw(self._seen, self._version)
        over = (*self._vectors.arrows(frame, columns, self._version), *pick.drawn(frame, picked, self._version))
        readings = Readings(
            tracks=(self._plots.track, self._pick.track),
            legend=shown.legend,
            inspected=pick.numbers(frame, columns, picked),
            duel=contenders,
            curves=ends,
        )
        return replace(shown.frame, drawables=(*drawables, *lines, *over)), readings
