"""The live page in a notebook, or from a script."""

from __future__ import annotations

import html
import os
import threading
import webbrowser
from typing import TYPE_CHECKING

from pointmass.cache import Cache
from pointmass.errors import InvalidInput, shown, whole_number
from pointmass.frame import Camera
from pointmass.scene import Scene
from pointmass.scenes import ShippedScene
from pointmass.simulation import Simulation
from pointmass.viewer.live import Live
from pointmass.viewer.page import page_folder, server_type
from pointmass.viewer.playback import Playback
from pointmass.viewer.running import Running
from pointmass.viewer.session import Session
from pointmass.viewer.subject import Subject

if TYPE_CHECKING:
    from pointmass.viewer.player import Player
    from pointmass.viewer.server import Server

HUB = "JUPYTERHUB_SERVICE_PREFIX"  # set by JupyterHub: the path of a user's server


def show(
    source: Simulation | Scene | ShippedScene | Cache,
    *,
    fps: float = 60.0,
    camera: Camera | None = None,
    height: int = 600,
    proxy: str | None = None,
) -> Shown:
    """Open the live page of something. In a notebook the last line of a cell, `pm.show(sim)`, shows it below.

    The page is served by threads of this process, for this machine only. Where the notebook's server is on another
    machine, the browser reaches the page through that server, with jupyter-server-proxy: at the path given as `proxy`,
    which is known under JupyterHub.

    Parameters
    ----------
    source : a simulation, of which a copy runs; a scene, such as `pm.SCENES["cloth"]()` with its sliders; or a cache.
    fps : frames per second of simulated time, of a simulation.
    camera : of a simulation; chosen to show everything by default.
    height : of the page in a notebook [pixels].
    proxy : path at which the notebook's server hands on what comes for a port, such as "/proxy/{port}/".

    Returns
    -------
    Shown
        Its `address` is that of the page; `stop()` ends it, and `wait()` keeps a script alive.

    Raises
    ------
    InvalidInput
        It is nothing that can be shown, or the page is missing.

    Examples
    --------
    >>> pm.show(sim)  # in a notebook
    >>> pm.show(sim).wait()  # in a script: until Ctrl-C
    """
    serve = server_type()
    whole_number("height", height, at_least=100)
    if proxy is None and HUB in os.environ:
        proxy = f"{os.environ[HUB]}proxy/{{port}}/"
    if proxy is not None and "{port}" not in proxy:
        raise InvalidInput(f"proxy = {proxy!r} is not allowed: it must hold {{port}}, such as '/proxy/{{port}}/'")
    page = page_folder()
    session = Session(_player(source, fps, camera))
    server = serve(session, page, framed=True, proxied=proxy is not None)
    session.start()
    server.start()
    return Shown(session, server, height, proxy)


class Shown:
    """A live page that is being served.

    Attributes
    ----------
    address : of the page, on this machine.
    """

    def __init__(self, session: Session, server: Server, height: int, proxy: str | None) -> None:
        self._session, self._server, self._height = session, server, height
        self.address = server.address
        self._source = self.address
        if proxy is not None:
            self._source = f"{proxy.replace('{port}', str(server.port)).rstrip('/')}/?token={server.token}"

    def stop(self) -> None:
        """End the page and what it shows."""
        self._server.stop()
        self._session.stop()

    def wait(self) -> None:
        """Open the page in a browser, and stop at Ctrl-C."""
        webbrowser.open(self.address)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            pass
        finally:
            self.stop()

    def __repr__(self) -> str:
        return f"the live page at {self.address}"

    def _repr_html_(self) -> str:
        """For notebooks."""
        source = html.escape(self._source, quote=True)
        return (
            f'<iframe src="{source}" title="pointmass" width="100%" height="{self._height}" allow="fullscreen"'
            ' style="border: 0"></iframe>'
        )


def _player(source: object, fps: float, camera: Camera | None) -> Player:
    match source:
        case Simulation():
            return Running(source, fps=fps, camera=camera)
        case Scene():
            return Live(Subject.of_scene(source))
        case ShippedScene():
            return Live(Subject.of_shipped(source))
        case Cache():
            return Playback(source)
    raise InvalidInput(f"source must be a simulation, a scene or a cache, not {shown(source)}")
