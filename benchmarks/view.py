"""The live page's data path, from a frame to a client over its web socket: `python -m benchmarks.view`.

The client is a plain one, in a process of its own, that acknowledges and draws nothing: browsers that are driven by a
test tool copy each frame through it, and would be measured instead.
"""

from __future__ import annotations

import asyncio
import gzip
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import click
import numpy as np
import websockets

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.viewer.pack import pack
from pointmass.viewer.page import page_folder
from pointmass.viewer.running import Running
from pointmass.viewer.server import Server
from pointmass.viewer.session import Session

SCENE = "cloth"
SECONDS = 5.0  # of each measurement
KEPT = 4  # frames that are sent in turns
FASTER = 1000.0  # frames per second that are asked for: more than there can be


class Frames(Running):
    """A player whose frames are there already, like those of a cache: of particles that fall."""

    sims = ()

    def __init__(self, points: int) -> None:
        system = pm.ParticleSystem(pm.scatter(points, size=(2, 2, 2)).particles, forces=[pm.Gravity()])
        sim = pm.Simulation(system, dt=1 / 60)
        super().__init__(sim, fps=FASTER)
        self.kept = list(sim.frames(KEPT, 60))
        self._next = 0

    def start(self) -> pm.Frame:
        return self.kept[0]

    def advance(self, speed: float) -> pm.Frame:
        self._next += 1
        return self.kept[self._next % KEPT]


async def receive(address: str, origin: str, seconds: float) -> tuple[int, float, int]:
    """How many frames come, in how many seconds, and how many bytes they have."""
    async with websockets.connect(address, origin=origin, max_size=None, compression=None) as socket:
        await binary(socket)
        begun, count, size = time.perf_counter(), 0, 0
        while time.perf_counter() < begun + seconds:
            size += len(await binary(socket))
            count += 1
        return count, time.perf_counter() - begun, size


async def binary(socket: websockets.ClientConnection) -> bytes:
    """The next frame, acknowledged."""
    while True:
        message = await socket.recv()
        if isinstance(message, bytes):
            sequence = int(np.frombuffer(message, "<u4", 2)[1])
            await socket.send(json.dumps({"kind": "ack", "sequence": sequence}))
            return message


def client(address: str, origin: str, seconds: float, answer: multiprocessing.Queue) -> None:
    answer.put(asyncio.run(receive(address, origin, seconds)))


def data_path(points: int) -> tuple[float, float, float, float]:
    """Frames a second, megabytes of a frame, and milliseconds of this process for one, of which to pack it."""
    player = Frames(points)
    kept = player.kept
    known = {d.name: d.version for d in kept[0].drawables}
    times = []
    for k in range(8):
        begun = time.thread_time()
        pack(kept[1 + k % (KEPT - 1)], 1, known)
        times.append(1000 * (time.thread_time() - begun))
    with TemporaryDirectory() as folder:
        session = Session(player)
        server = Server(session, Path(folder))
        session.start()
        server.start()
        origin = f"http://127.0.0.1:{server.port}"
        spawn = multiprocessing.get_context("spawn")
        answer = spawn.Queue()
        where = f"ws://127.0.0.1:{server.port}/frames?token={server.token}"
        process = spawn.Process(target=client, args=(where, origin, SECONDS, answer))
        begun = time.process_time()
        process.start()
        count, seconds, size = answer.get(timeout=60)
        busy = time.process_time() - begun
        process.join()
        server.stop()
        session.stop()
    return count / seconds, size / count / 1e6, 1000 * busy / count, statistics.median(times[1:])


def first_frame(scene: str) -> tuple[float, float]:
    """From the command to the first frame that a client has, on the clock and of the processor [s]."""
    begun, before = time.perf_counter(), os.times().children_user + os.times().children_system
    command = [sys.executable, "-m", "pointmass.cli", "view", scene, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        asyncio.run(one(process.stdout.readline().strip()))
        passed = time.perf_counter() - begun
        process.terminate()
    return passed, os.times().children_user + os.times().children_system - before


async def one(address: str) -> None:
    host = address.split("/")[2]
    where = f"ws://{host}/frames?{address.split('?')[1]}"
    async with websockets.connect(where, origin=f"http://{host}", max_size=None) as socket:
        await binary(socket)


@click.command()
@click.option("--points", multiple=True, type=int, default=(100_000, 1_000_000), show_default=True)
def main(points: tuple[int, ...]) -> None:
    """Print what it takes to bring frames to a page."""
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python {sys.version.split()[0]}\n")
    print("| points | frames/s | MB/frame | processor time of a frame | of which packed |")
    print("|---|---|---|---|---|")
    for count in points:
        rate, size, busy, packing = data_path(count)
        print(f"| {count:,} | {rate:.0f} | {size:.2f} | {busy:.1f} ms | {packing:.1f} ms |", flush=True)
    first_frame(SCENE)  # compiles
    passed, busy = first_frame(SCENE)
    print(f"\nfrom the command to the first frame of {SCENE}: {passed:.2f} s, of the processor {busy:.2f} s")
    try:
        code = [gzip.compress(file.read_bytes()) for file in (page_folder() / "assets").glob("*.js")]
        print(f"the page's JavaScript: {sum(map(len, code)) / 1000:.0f} kB compressed")
    except InvalidInput as error:
        print(error)


if __name__ == "__main__":
    main()
