"""Draws the pictures of the documentation into docs/images: `python docs/draw.py` for all, or with names for some."""

from __future__ import annotations

import sys
from collections import deque
from pathlib import Path

import numpy as np
from PIL import Image

import pointmass as pm
from pointmass.colors import linear
from pointmass.render import fit_camera, image
from pointmass.stability_picture import stability_picture

FOLDER = Path(__file__).parent / "images"
SIZE = (640, 360)
FACE_ON = pm.Camera(azimuth=0.0, elevation=0.0, fov=20.0)
RED, YELLOW, BLUE, GREEN, GREY = (linear(c) for c in ("#ff6b6b", "#ffd23f", "#5fa8ff", "#5fe3a1", "#5b6678"))


def curve(name, points, color, width=0.02):
    """A line through points, shape (k, 2) or (k, 3)."""
    points = np.asarray(points, np.float32)
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points), np.float32)])
    ends = np.array([0, len(points)], np.int32)
    index = np.arange(len(points), dtype=np.int32)
    return pm.Curves(name=name, vertices=points, index=index, offsets=ends, width=width, color=color)


def dots(name, points, color, radius):
    """Balls at points."""
    points = np.asarray(points, np.float32)
    return pm.Points(name=name, vertices=np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), color=color, radius=radius)


def drawing(*drawables):
    """A frame of curves and dots alone."""
    nothing = np.zeros((0, 3))
    return pm.Frame(
        number=0, time=0.0, ids=np.zeros(0, int), positions=nothing, velocities=nothing, drawables=drawables
    )


def save(name, frame, camera=FACE_ON, size=SIZE):
    """Draw a frame into docs/images."""
    store(name, image(frame, camera=camera, size=size))


def store(name, pixels):
    """Write a picture into docs/images."""
    target = FOLDER / f"{name}.jpg"
    picture = Image.fromarray(pixels)
    picture.save(target, quality=90, subsampling=0, optimize=True)  # smooth glows want more than a PNG's 256 colours
    print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")


def last(frames):
    """The last of some frames."""
    return deque(frames, maxlen=1)[0]


def scene_picture(name, scene, number, shown, size=SIZE):
    """A frame of a scene, by a camera that shows so many frames up to it."""
    frames = list(scene.simulation().frames(number + 1, scene.fps))
    save(name, frames[number], fit_camera(frames[-shown:], scene.camera, size), size)


def of_page(name):
    """The last frame of a scene file in docs/scenes.md, and its camera."""
    page = (FOLDER.parent / "scenes.md").read_text(encoding="utf-8")
    scene = pm.Scene.from_toml(page.split(f"```toml\n# {name}.toml\n")[1].split("```")[0])
    frame = last(scene.simulation().frames(scene.frames, scene.fps))
    return frame, scene.camera


def shipped(name, number, shown=1):
    """A frame of a scene that comes with pointmass."""
    scene_picture(f"scene-{name}", pm.SCENES[name]().build(), number, shown)


def readme():
    """The picture of the README: the example, by the camera of its film."""
    scene_picture("fountain", pm.Scene.load(FOLDER.parents[1] / "examples" / "fountain.toml"), 130, 131, (960, 540))


# ---------------------------------------------------------------------------------------------------- the lecture


def flow():
    """Arrows, integral curves and particles of two vortices."""
    start = np.column_stack([np.linspace(-1.4, 1.4, 22), np.full(22, -0.45), np.zeros(22)])
    system = pm.ParticleSystem(
        pm.Particles(start), [pm.Vortex(2.0, (-0.6, 0, 0), eps=0.2), pm.Vortex(-2.0, (0.6, 0, 0), eps=0.2)]
    )
    box = ((-1.6, -0.9, 0.0), (1.6, 0.9, 0.0))
    look = pm.Look(arrows=16, streamlines=40, field_box=box, size=0.03, trails=1.2)
    save("flow", last(pm.Simulation(system, look=look).frames(90, 60)))


def euler():
    """Euler's method on a circle."""
    t = np.linspace(0, 2 * np.pi, 200)
    lines = [curve("circle", np.stack([np.cos(t), np.sin(t)], axis=1), GREY, 0.025)]
    swirl = pm.ParticleSystem(pm.Particles([1.0, 0, 0]), [pm.Flow(("-y", "x", "0"))])
    for dt, color in ((0.1, GREEN), (0.25, YELLOW), (0.5, RED)):
        y = pm.integrate(swirl, pm.Euler(), (0.0, 2 * np.pi), dt).y
        lines += [curve(f"euler {dt}", y, color), dots(f"steps {dt}", y, color, 0.035)]
    save("euler", drawing(*lines))


def phase():
    """Three methods in the phase space of an oscillator."""
    spring = pm.ParticleSystem(pm.Particles([1.0, 0, 0]), [pm.Harmonic(k_s=1.0)])
    lines = []
    for solver, color, steps in (
        (pm.Euler(), RED, 38),
        (pm.SymplecticEuler(), YELLOW, 300),
        (pm.ImplicitEuler(), BLUE, 60),
    ):
        y = pm.integrate(spring, solver, (0.0, 0.2 * steps), 0.2).y[:, [0, 3]]
        lines += [curve(solver.name, y, color), dots(f"{solver.name} steps", y, color, 0.03)]
    save("phase", drawing(*lines))


def stability():
    """A sheet that becomes stiffer from left to right, for steps of RK4 that are a little too long."""
    at = np.arange(12 * 8).reshape(12, 8)
    links = [(at[1:], at[:-1]), (at[:, 1:], at[:, :-1]), (at[1:, 1:], at[:-1, :-1]), (at[1:, :-1], at[:-1, 1:])]
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in links])
    x = np.array([[0.1 * i, 0.1 * j, 0.0] for i in range(12) for j in range(8)])
    stiffness = 30.0 * 40.0 ** (x[pairs, 0].mean(axis=1) / 1.1)
    sheet = pm.Particles(x, m=0.01)
    sheet.pin(at[:, -1])
    springs = pm.Springs(pairs, k_s=stiffness, k_d=0.45 * np.sqrt(0.005 * stiffness))
    system = pm.ParticleSystem(sheet, [pm.Gravity(), springs])
    limit = system.stability("rk4").largest_safe_dt
    sim = pm.Simulation(system, "rk4", dt=1.08 * limit, look=pm.Look(size=0.012, spring_width=0.009))
    camera = pm.Camera(azimuth=0.0, elevation=0.0, fov=25.0)
    picture = Image.fromarray(stability_picture(sim, system.stability("rk4"), camera))
    store("stability", np.asarray(picture.resize((960, 540), Image.Resampling.LANCZOS)))


def drag():
    """Throws with and without drag, each from the same place."""
    lines = []
    for k, color in ((0.0, YELLOW), (0.4, GREEN), (0.8, BLUE), (1.6, RED)):
        stone = pm.Particles([0, 0, 0], v=[6.5, 6.5, 0])
        system = pm.ParticleSystem(stone, [pm.Gravity(), pm.Drag(k)])
        ground = pm.Event(lambda t, y: y[1], terminal=True, direction=-1)
        path = pm.integrate(system, pm.RK4(), (0, 3), 0.05, events=[ground]).y
        lines += [curve(f"throw {k}", path[:, :2], color, 0.05), dots(f"steps {k}", path[:, :2], color, 0.07)]
    save("drag", drawing(curve("ground", [(-0.3, 0), (9.3, 0)], GREY, 0.04), *lines))


def bounces():
    """A ball that bounces along."""
    ball = pm.Particles([-2.2, 1.3, 0], v=[1.1, 0, 0], radius=0.06)
    floor = pm.Plane(restitution=0.8, friction=0.0)
    look = pm.Look(trails=10.0, size=0.06, floor_size=40.0)
    sim = pm.Simulation(pm.ParticleSystem(ball, [pm.Gravity()], [floor]), pm.Leapfrog(), look=look)
    frames = list(sim.frames(245, 60))
    path = np.array([f.positions[0] for f in frames])
    lines = (curve("path", path, YELLOW, 0.02), dots("balls", path[::6], linear("#ffb454"), 0.06))
    surface = [d for d in frames[0].drawables if d.kind == "triangles"]
    save(
        "bounces",
        drawing(*surface, *lines),
        pm.Camera(fov=25, target=(0, 0.5, 0), position=(0, 1.2, 6.5)),
    )


def cloth():
    """The lecture's cloth, hanging from two corners."""
    n = 9
    grid = np.arange(n * n).reshape(n, n)

    def join(a, b):
        return np.stack([a.ravel(), b.ravel()], axis=1)

    families = {
        "stretch": [join(grid[1:], grid[:-1]), join(grid[:, 1:], grid[:, :-1])],
        "shear": [join(grid[1:, 1:], grid[:-1, :-1]), join(grid[1:, :-1], grid[:-1, 1:])],
        "bend": [join(grid[2:], grid[:-2]), join(grid[:, 2:], grid[:, :-2])],
    }
    row, column = np.divmod(grid.ravel(), n)
    particles = pm.Particles(np.stack([column, 0 * row, row], axis=1) / (n - 1), m=1 / n**2, radius=0.012)
    particles.pin([0, n - 1])
    springs = [pm.Springs(np.concatenate(pairs), 100.0, 0.02, family=name) for name, pairs in families.items()]
    system = pm.ParticleSystem(particles, [pm.Gravity(), pm.Drag(0.01), *springs])
    sim = pm.Simulation(system, pm.SymplecticEuler(), dt=1 / 300, look=pm.Look(spring_width=0.006, color="#e8edf5"))
    save("cloth", last(sim.frames(45, 60)), pm.Camera(azimuth=25, elevation=15))


# ---------------------------------------------------------------------------------------------------- extending, scenes


def coin():
    """Sparks on the collider of docs/extending.md."""
    page = (FOLDER.parent / "extending.md").read_text(encoding="utf-8")
    source = page.split("<!-- coin -->\n```python\n")[1].split("```")[0]
    names: dict = {"pm": pm, "np": np}
    exec(source, names)  # the page's own class
    coin = names["Coin"]((0, 0.7, 0), (-0.35, 1, 0.1), radius=0.6, thickness=0.16, restitution=0.6)
    rain(
        "coin",
        [coin, pm.Plane(restitution=0.3)],
        pm.Nozzle((0.35, 2.0, 0), direction=(0, -1, 0), rate=500.0, speed=2.0, cone=6.0, radius=0.1, lifetime=1.6),
    )


def rain(name, colliders, nozzle):
    """Sparks of a nozzle that rain on colliders."""
    scene = pm.Scene(
        dt=1 / 120,
        solver=pm.Leapfrog(),
        emitters=[nozzle],
        forces=[pm.Gravity()],
        colliders=colliders,
        look=pm.Look(particles="glow", size=0.018, color_by="speed", trails=0.06, floor_size=40.0),
    )
    save(name, last(scene.simulation().frames(120, 60)), pm.Camera(azimuth=12, elevation=10))


def sparks():
    """Sparks of docs/scenes.md."""
    save("sparks", *of_page("sparks"))


def smoke():
    """Smoke of docs/scenes.md."""
    save("smoke", *of_page("smoke"))


def splashes():
    """Rain of docs/scenes.md."""
    save("splashes", *of_page("splashes"))


def planet():
    """Attractors of docs/scenes.md."""
    save("planet", *of_page("planet"))


def snow():
    """Flakes of docs/scenes.md."""
    save("snow", *of_page("snow"))


def dunes():
    """Grains on a height field, and on a ring that is a mesh."""
    n = np.linspace(-2, 2, 61)
    x, z = np.meshgrid(n, n, indexing="ij")
    around, tube = (a.ravel() for a in np.meshgrid(np.arange(48), np.arange(20), indexing="ij"))
    u, v = 2 * np.pi * around / 48, 2 * np.pi * tube / 20
    ring = np.stack([(0.6 + 0.2 * np.cos(v)) * np.cos(u), (0.6 + 0.2 * np.cos(v)) * np.sin(u), 0.2 * np.sin(v)], axis=1)
    a, b, c, d = (20 * ((around + i) % 48) + (tube + j) % 20 for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    solids = [
        pm.HeightField(0.15 * np.sin(3 * x + z), (4, 4), depth=0.3, friction=0.7, restitution=0.2),
        pm.Mesh((ring, faces), shift=(0, 0.8, 0), friction=0.3, restitution=0.4),
    ]
    rng = np.random.default_rng(1)
    grains = pm.Particles(rng.uniform((-0.9, 1.9, -0.7), (0.9, 4.5, 0.7), (3000, 3)), radius=0.022)
    look = pm.Look(color="#ffb454", collider_color="#7f8aa0")
    sim = pm.Simulation(pm.ParticleSystem(grains, [pm.Gravity()], solids), pm.Leapfrog(), 1 / 120, look=look)
    frame = last(sim.frames(70, 60))
    save("dunes", frame, pm.Camera(position=(2.6, 2.2, 4.2), target=(0, 0.5, 0), fov=35.0))


def pendulum():
    """The shipped scene pendulum."""
    shipped("pendulum", 66)


def bounce():
    """The shipped scene bounce."""
    shipped("bounce", 75, shown=12)


def flow_scene():
    """The shipped scene flow."""
    shipped("flow", 300)


def field_scene():
    """The shipped scene field, with four vortices."""
    scene_picture("scene-field", pm.SCENES["field"].with_settings({}, "vortices").build(), 120, 1)


def orbit():
    """The shipped scene orbit."""
    shipped("orbit", 200)


def springs():
    """The shipped scene springs."""
    shipped("springs", 28, shown=10)


def fountain():
    """The shipped scene fountain."""
    shipped("fountain", 170)


def fireworks():
    """The shipped scene fireworks."""
    shipped("fireworks", 340)


def snow_scene():
    """The shipped scene snow."""
    shipped("snow", 240)


def smoke_scene():
    """The shipped scene smoke."""
    shipped("smoke", 355)


def dust():
    """The shipped scene dust."""
    shipped("dust", 300)


def flock():
    """The shipped scene flock."""
    shipped("flock", 200)


def cloth_scene():
    """The shipped scene cloth."""
    shipped("cloth", 70)


def flag():
    """The shipped scene flag."""
    shipped("flag", 80)


def drape():
    """The shipped scene drape."""
    shipped("drape", 110)


def curtain():
    """The shipped scene curtain."""
    shipped("curtain", 75)


def net():
    """The shipped scene net."""
    shipped("net", 110)


def heap():
    """The shipped scene heap."""
    shipped("heap", 110)


def fish():
    """The shipped scene fish."""
    shipped("fish", 150)


def school():
    """The shipped scene school."""
    shipped("school", 300)


def aquarium():
    """The shipped scene aquarium."""
    shipped("aquarium", 240)


def jelly():
    """The shipped scene jelly."""
    shipped("jelly", 20)


def tear():
    """The shipped scene tear, as it begins, and with one of its presets."""
    shipped("tear", 50)
    scene_picture("tear-pulled", pm.SCENES["tear"].with_settings({}, "pulled apart").build(), 165, 1)


def snake():
    """The shipped scene snake, on its way."""
    shipped("snake", 260)


def worm():
    """The shipped scene worm."""
    shipped("worm", 170)


def hair():
    """The shipped scene hair."""
    shipped("hair", 75)


def curl_noise():
    """Stripes of dust, carried around a ball by curl noise for a second."""
    ball = pm.Sphere(radius=0.35)
    x = np.random.default_rng(1).uniform((-1.9, -1.0, -0.02), (1.9, 1.0, 0.02), (90_000, 3))
    x = x[(np.floor(6 * x[:, 1]) % 2 == 0) & (np.linalg.norm(x, axis=1) > 0.36)]
    air = pm.CurlNoise(0.9, 0.5, rate=0.3, seed=3, around=[ball], distance=0.4)
    dust = pm.ParticleSystem(pm.Particles(x, height=x[:, 1], dtype="float32"), [air], [ball])
    look = pm.Look(particles="glow", size=0.006, color_by="height", brightness=0.5)
    frame = last(pm.Simulation(dust, pm.Midpoint(), 1 / 60, look=look).frames(2, 1))
    save("curl-noise", frame, pm.Camera(position=(0, 0, 5.6), target=(0, 0, 0), fov=20.0))


def page_picture(name, scene, use):
    """The live page of a scene, in a browser without a window, after `use(page)`."""
    import io
    import shutil

    from playwright.sync_api import sync_playwright

    flags = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    shown = pm.show(scene)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": 1120, "height": 630})
        page.set_default_timeout(120_000)
        page.goto(shown.address)
        page.wait_for_function("() => pointmass.frame()?.head.time > 0.5")
        page.keyboard.press(" ")  # who moves is hard to catch
        page.wait_for_timeout(5_000)
        use(page)
        picture = page.screenshot()
        browser.close()
    shown.stop()
    store(name, np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")))


def live_page():
    """A cloth that is pulled at."""

    def pull(page):
        row = page.evaluate("() => Math.round(0.9 * pointmass.registry.places.count)")
        x, y = page.evaluate(
            """row => {
                const { registry, camera } = pointmass, canvas = document.getElementById("picture");
                const at = registry.places.at(row, camera.eye.position.clone()).project(camera.eye);
                return [(at.x + 1) / 2 * canvas.clientWidth, (1 - at.y) / 2 * canvas.clientHeight];
            }""",
            row,
        )
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 190, y - 120)
        page.keyboard.press(" ")
        page.wait_for_function("() => pointmass.frame().head.held >= 0")
        held = page.evaluate("() => pointmass.frame().head.time")
        page.wait_for_function("since => pointmass.frame().head.time > since + 0.7", arg=held)

    page_picture("live", pm.SCENES["cloth"](), pull)


def live_field():
    """A rotation, and what four solvers make of a circle in it."""

    def follow(page):
        page.keyboard.press("y")
        page.wait_for_function("() => !document.getElementById('curves').hidden")
        page.wait_for_timeout(20_000)  # until the camera has made room for it
        page.mouse.click(690, 291)
        page.wait_for_function("() => pointmass.registry.shown.has('integral curves by euler')")
        page.wait_for_timeout(5_000)

    page_picture("live-field", pm.SCENES["field"](particles=30, streamlines=40, arrows=16), follow)


PICTURES = (
    readme,
    flow,
    euler,
    phase,
    stability,
    drag,
    bounces,
    cloth,
    coin,
    sparks,
    smoke,
    splashes,
    planet,
    snow,
    curl_noise,
    dunes,
    pendulum,
    bounce,
    flow_scene,
    field_scene,
    orbit,
    springs,
    fountain,
    fireworks,
    snow_scene,
    smoke_scene,
    dust,
    flock,
    cloth_scene,
    flag,
    drape,
    heap,
    curtain,
    net,
    jelly,
    tear,
    hair,
    snake,
    worm,
    fish,
    school,
    aquarium,
    live_page,
    live_field,
)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for draw in PICTURES:
        if len(sys.argv) == 1 or draw.__name__ in sys.argv[1:]:
            draw()
