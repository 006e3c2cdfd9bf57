"""The page itself, in a browser without a window. It is asked for its state; what it looks like is for eyes."""

from __future__ import annotations

import re
import shutil
import time

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scene import Scene
from pointmass.scenes import SCENES, ShippedScene
from pointmass.viewer.duel import Duel, entries
from pointmass.viewer.inputs import Drop, Hold, Join, LetGo, Shoot
from pointmass.viewer.live import Live
from pointmass.viewer.mouse import RATE
from pointmass.viewer.page import page_folder
from pointmass.viewer.playback import Playback
from pointmass.viewer.server import Server
from pointmass.viewer.session import Session
from pointmass.viewer.subject import Subject
from tests.small import SMALL

CHROMIUM = shutil.which("chromium")
FLAGS = [
    *("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
    *("--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
]
THREE_PICTURES = """() => new Promise((done) => {
    let left = 3;
    const next = () => (left-- ? requestAnimationFrame(next) : done());
    next();
})"""
PATIENCE = 240_000  # a machine without graphics draws slowly [ms]


@pytest.fixture(scope="module")
def browser():
    sync = pytest.importorskip("playwright.sync_api", reason="there is no playwright")
    if CHROMIUM is None:
        pytest.skip("there is no chromium: apt-get install chromium")
    try:
        page_folder()
    except InvalidInput as error:
        pytest.skip(str(error))
    with sync.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


class Opened:
    """A scene with its page."""

    def __init__(self, browser, player):
        self.live = player
        self.session = Session(self.live)
        self.server = Server(self.session, page_folder())
        self.session.start()
        self.server.start()
        self.problems, self.requests = [], []
        self.page = browser.new_page(viewport={"width": 480, "height": 360})
        self.page.on("console", lambda m: self.problems.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.goto(self.server.address + "&noaa")

    def until(self, condition):
        self.page.wait_for_function(condition, timeout=PATIENCE)

    def on_screen(self, row):
        """Where a particle is on the page [pixels]."""
        return self.page.evaluate(
            """row => {
                const { registry, camera } = pointmass, canvas = document.getElementById("picture");
                const at = camera.eye.position.clone();
                registry.places.at(row, at).project(camera.eye);
                return [(at.x + 1) / 2 * canvas.clientWidth, (1 - at.y) / 2 * canvas.clientHeight];
            }""",
            row,
        )

    def seen_at(self, place):
        """Where a place [m] is on the page [pixels]."""
        return np.array(
            self.page.evaluate(
                """place => {
                    const { camera } = pointmass, canvas = document.getElementById("picture");
                    const at = camera.eye.position.clone().fromArray(place).project(camera.eye);
                    return [(at.x + 1) / 2 * canvas.clientWidth, (1 - at.y) / 2 * canvas.clientHeight];
                }""",
                list(place),
            )
        )

    def settled(self, row):
        """The same when the camera, and the last frames, have come to rest."""
        last, here = None, self.on_screen(row)
        while last is None or np.abs(np.subtract(last, here)).max() > 0.5:
            self.page.evaluate(THREE_PICTURES)
            last, here = here, self.on_screen(row)
        assert self.page.evaluate("([x, y]) => document.elementFromPoint(x, y).id", here) == "picture"
        return here

    def pause_at_the_start(self):
        """Where everything is in the same place each time, so that nothing lies under the page's controls."""
        self.page.keyboard.press(" ")
        eventually(lambda: not self.session._playing)
        self.page.keyboard.press("r")
        self.until("() => pointmass.frame()?.head.number === 0")

    def close(self):
        self.page.close()
        self.server.stop()
        self.session.stop()


@pytest.fixture
def opened(browser):
    pages = []

    def open_page(what):
        pages.append(Opened(browser, Live(Subject.of_shipped(what)) if isinstance(what, ShippedScene) else what))
        return pages[-1]

    yield open_page
    for each in pages:
        each.close()


def eventually(condition):
    end = time.monotonic() + PATIENCE / 1000
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_scene_opens_and_a_drag_moves_a_particle(opened):
    it = opened(SCENES["pendulum"](links=1))
    it.until("() => pointmass.connection.received > 5 && pointmass.frame().head.time > 0")
    page = it.page
    assert page.title() == "pendulum · pointmass"
    assert page.locator("#title h1").inner_text() == "pendulum"

    it.pause_at_the_start()
    it.until("() => document.querySelector('#transport button:nth-child(2)').title.startsWith('Play')")

    row = len(it.live.sim.system.particles) - 1  # the bob
    before = it.live.sim.system.particles.x[row].copy()
    x, y = it.settled(row)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 60, y - 50)
    page.keyboard.press(" ")
    it.until("() => pointmass.frame().head.held >= 0")
    eventually(lambda: it.live.held == row and np.linalg.norm(np.subtract(it.live.target, before)) > 0.05)
    target = np.array(it.live.target)
    far = np.linalg.norm(target - before)
    eventually(lambda: np.linalg.norm(it.live.sim.system.particles.x[row] - target) < 0.9 * far)
    page.mouse.up()
    eventually(lambda: it.live.held < 0)

    kinds = [type(what) for _, what in it.live.recording.inputs]
    assert kinds[0] is Hold
    assert kinds[-1] is LetGo
    camera = page.evaluate("() => pointmass.camera.led")
    assert camera  # the drag did not turn it
    assert it.problems == []


def test_u01_a_mass_held_with_the_mouse_rests_m_g_over_k_m_below_the_cursor(opened):
    m, g, camera = 2.0, 9.81, pm.Camera(position=(0, 1, 3), target=(0, 1, 0))
    body = pm.body_of(pm.Particles([(0, 1, 0)], m=m, radius=0.05))
    scene = pm.Scene(bodies=[body], forces=[pm.Gravity((0, -g, 0))], dt=1 / 240, camera=camera)
    it = opened(Live(Subject.of_scene(scene)))
    page, live = it.page, it.live
    it.until("() => pointmass.connection.received > 0")
    it.pause_at_the_start()
    x, y = it.settled(0)
    cursor = np.array([x + 40, y - 30])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(*cursor.tolist())
    eventually(lambda: live.held == 0 and np.abs(it.seen_at(live.target) - cursor).max() < 1e-3)
    assert live.target[2] == pytest.approx(0.0, abs=1e-4)  # on the plane through the mass, parallel to the picture
    page.keyboard.press(" ")
    eventually(lambda: live.sim.t > 31 / RATE)  # 30 sqrt(m / k_m)
    page.keyboard.press(" ")
    eventually(lambda: not it.session._playing)
    k_m = m * RATE**2
    below = np.subtract(live.target, live.sim.system.particles.x[0])
    np.testing.assert_allclose(below, [0, m * g / k_m, 0], rtol=0, atol=1e-6 * m * g / k_m)
    np.testing.assert_allclose(it.settled(0), it.seen_at(live.sim.system.particles.x[0].tolist()), atol=0.1)
    page.mouse.up()
    eventually(lambda: live.held < 0)
    assert it.problems == []


def test_a_slider_changes_the_scene(opened):
    it = opened(SCENES["pendulum"]())
    it.until("() => pointmass.connection.received > 0")
    box = it.page.locator(".lil-controller", has_text="gravity").locator("input").first
    it.page.keyboard.press("s")  # opened, for a narrow page hides it
    box.fill("3")
    box.press("Enter")
    eventually(lambda: it.live.settings.get("gravity") == 3.0)
    assert it.problems == []


def test_a_narrow_page_shows_all_that_there_is_as_large_as_it_goes(opened):
    camera = pm.Camera(position=(0, 0, 10), target=(0, 0, 0), fov=30)
    body = pm.body_of(pm.Particles([(-2, 0, 0), (2, 0, 0)], radius=0.05))
    it = opened(Live(Subject.of_scene(pm.Scene(bodies=[body], forces=[], camera=camera))))
    it.until("() => pointmass.connection.received > 0")
    it.page.set_viewport_size({"width": 390, "height": 780})
    it.until("() => Math.abs(pointmass.camera.eye.aspect - 0.5) < 1e-6")
    across = it.settled(1)[0] - it.settled(0)[0]
    assert across == pytest.approx(390 / 1.12 * 4 / 4.1, abs=3)
    assert it.problems == []


def test_light_and_dark_show_the_same(opened, monkeypatch):
    monkeypatch.setenv("POINTMASS_ENGINE", "reference")
    it = opened(SCENES["cloth"](particles=8))
    it.until("() => pointmass.connection.received > 0")
    it.page.keyboard.press(" ")
    eventually(lambda: not it.session._playing)
    it.page.keyboard.press("d")
    it.page.evaluate(THREE_PICTURES)
    assert it.page.evaluate("() => document.documentElement.dataset.theme") == "light"
    bent = it.page.evaluate(
        """() => [...pointmass.registry.shown.values()].filter(({ part }) => part.kind === "triangles").map(
            ({ drawable }) => drawable.object.material.uniforms.normals.value.image.data.some((n) => n !== 0))"""
    )
    assert bent
    assert all(bent)  # a mesh without normals is black
    assert it.problems == []


LOOKS = ("cloth", "fireworks", "hair", "smoke")  # one of each kind: a mesh, glows, curves, smoke


@pytest.mark.parametrize("name", [n if n in LOOKS else pytest.param(n, marks=pytest.mark.full) for n in SCENES])
def test_each_scene_opens(opened, monkeypatch, name):
    monkeypatch.setenv("POINTMASS_ENGINE", "reference")  # small as they are, nothing needs to be compiled
    it = opened(SCENES[name](**SMALL.get(name, {})))
    it.until("() => pointmass.connection.received > 1 && pointmass.frame().head.number >= 1")
    shown = it.page.evaluate("() => [...pointmass.registry.shown.values()].map(({ part }) => part.kind)")
    assert shown
    assert it.page.locator("#title h1").inner_text() == name
    assert it.page.locator("#note").is_hidden()
    assert it.problems == []


def test_the_timeline_of_a_cache_scrubs_loops_and_goes_on(opened, tmp_path):
    scene = SCENES["springs"](side=2).build()
    it = opened(Playback(pm.record(scene.simulation(), tmp_path / "a.zarr", 20, scene.fps, scene=scene)))
    page = it.page
    it.until("() => pointmass.connection.received > 0 && !document.getElementById('timeline').hidden")
    if it.session._playing:
        page.keyboard.press(" ")
    eventually(lambda: not it.session._playing)
    page.locator("#timeline input").fill("12")
    it.until("() => pointmass.frame().head.number === 12")
    page.keyboard.press("i")
    page.keyboard.press("ArrowRight")
    it.until("() => pointmass.frame().head.number === 13")
    page.keyboard.press("ArrowLeft")
    it.until("() => pointmass.frame().head.number === 12")
    page.keyboard.press("End")
    it.until("() => pointmass.frame().head.number === 19")
    page.keyboard.press("o")
    eventually(lambda: (it.live.state().loop, it.live.state().first, it.live.state().last) == (True, 12, 19))
    page.keyboard.press("l")
    eventually(lambda: not it.live.state().loop)
    page.keyboard.press("g")
    it.until("() => pointmass.frame().head.number > 20")
    assert it.live.live.sim.frames_seen > 20
    it.until("() => document.querySelector('#timeline output').textContent.endsWith('20 kept')")
    page.keyboard.press("Home")
    it.until("() => pointmass.frame().head.number < 20")
    eventually(lambda: it.live.live is None)
    assert it.problems == []
    assert all(request.startswith(it.server.address.split("?")[0]) for request in it.requests)
    blocked = page.evaluate(
        """() => new Promise((done) => {
            addEventListener("securitypolicyviolation", (event) => done(event.blockedURI));
            fetch("http://127.0.0.1:1/").catch(() => {});
        })"""
    )
    assert blocked.startswith("http://127.0.0.1:1")  # nothing leaves, whatever the page's code does


def test_a_film_plays_from_a_file(browser, tmp_path):
    frames = list(SCENES["fountain"]().build().simulation().frames(30, 30))
    path = pm.to_html(frames, tmp_path / "a.html", fps=30)
    context = browser.new_context(viewport={"width": 480, "height": 360}, offline=True)
    page, problems = context.new_page(), []
    page.on("console", lambda m: problems.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto(f"{path.as_uri()}?noaa")
    page.wait_for_function("() => pointmass.frame()?.head.number > 2", timeout=PATIENCE)
    page.keyboard.press(" ")
    for k in (29, 4, 17):
        page.evaluate("k => pointmass.timeline.seek(k)", k)
        page.wait_for_function("k => pointmass.frame().head.number === k", arg=k, timeout=PATIENCE)
        shown = page.evaluate(
            """() => {
                const { places, shown } = pointmass.registry, at = pointmass.camera.eye.position.clone();
                const all = [];
                for (let k = 0; k < places.count; k++) all.push(places.at(k, at).toArray());
                return [all, [...shown.values()].map(({ part }) => [part.kind, part.count ?? 0])];
            }"""
        )
        np.testing.assert_allclose(shown[0], frames[k].positions, atol=np.ptp(frames[k].positions) / 65535)
        assert ["points", len(frames[k].positions)] in shown[1]  # the drawables are those of the frame, too
    page.evaluate("() => pointmass.connection.send({ kind: 'loop', on: true, first: 3, last: 5 })")
    page.evaluate("() => (pointmass.timeline.seek(3), pointmass.timeline.update(null))")
    page.keyboard.press(" ")
    page.wait_for_function(
        """() => {
            const n = pointmass.frame().head.number, seen = (window.seen ??= []);
            if (seen.at(-1) !== n) seen.push(n);
            return seen.filter((k) => k === 3).length >= 2;
        }""",
        timeout=PATIENCE,
    )
    assert max(page.evaluate("() => window.seen.slice(window.seen.indexOf(3))")) <= 5
    context.close()
    assert problems == []


def test_a_click_picks_a_particle_and_what_is_typed_is_plotted(opened):
    it = opened(SCENES["pendulum"](links=1))
    page = it.page
    it.until("() => pointmass.connection.received > 2")
    it.pause_at_the_start()
    row = len(it.live.sim.system.particles) - 1
    page.mouse.click(*it.settled(row))
    it.until(f"() => pointmass.frame().head.inspected?.row === {row}")
    it.until("() => document.querySelector('#picked dl').textContent.includes('kg')")

    page.keyboard.press("t")
    field = page.locator("#plots input")
    field.fill("y")
    field.press("Enter")
    it.until("() => document.getElementById('note').textContent.includes('such as mean(y)')")
    field.fill("mean(y)")
    field.press("Enter")
    eventually(lambda: it.session._instruments.message.expressions == ["mean(y)"])
    page.locator("#transport button").nth(2).click()
    it.until(
        "() => pointmass.plots.track.columns.some(c => c.name === 'mean(y)') && pointmass.plots.track.times.length > 0"
    )
    plotted = page.evaluate(
        "() => pointmass.plots.track.values[pointmass.plots.track.columns.findIndex(c => c.name === 'mean(y)')].at(-1)"
    )
    assert plotted == pytest.approx(it.session._frame.positions[:, 1].mean(), rel=1e-6)
    it.until("() => document.querySelectorAll('#plots figure').length >= 4")

    page.locator("#shown select").select_option("stretch")
    it.until("() => pointmass.frame().head.legend?.title === 'stretch of springs'")
    assert page.locator("#legend").is_visible()
    assert it.problems == []


def test_a_duel_is_shown_with_its_figures(opened):
    it = opened(Duel(Subject.of_shipped(SCENES["pendulum"](links=1)), entries("symplectic_euler,rk4")))
    it.until("() => document.querySelectorAll('#duel tbody tr').length === 3 && pointmass.frame().head.time > 0")
    assert it.page.locator("#duel tbody th").all_inner_texts() == ["symplectic euler", "rk4", "reference"]
    assert it.live.beside
    it.page.keyboard.press("m")
    eventually(lambda: not it.live.beside)
    it.until("() => document.querySelector('#shown button[aria-pressed=false][title^=Beside]') !== null")
    assert it.problems == []


def test_keys_and_the_panel_do_what_they_say(opened):
    it = opened(SCENES["fountain"](jets=2, rate=60.0, wind=1.0))
    live, page = it.live, it.page
    it.until("() => pointmass.connection.received > 0")
    page.keyboard.press("s")  # opened, for a narrow page hides it
    page.locator(".lil-title", has_text="Solver").click()
    page.locator(".lil-controller", has_text="solver").locator("select").first.select_option("rk4")
    eventually(lambda: live.solver == "rk4")
    it.until("() => !document.querySelector('[title^=undo]').disabled")
    page.keyboard.press("w")
    eventually(lambda: live.setup.wind is not None)
    page.keyboard.press("Control+z")
    eventually(lambda: live.setup.wind is None)
    page.keyboard.press("Control+z")
    eventually(lambda: live.solver != "rk4")
    page.keyboard.press("Control+Shift+z")
    eventually(lambda: live.solver == "rk4")

    page.get_by_role("button", name="Pause").click()
    eventually(lambda: not it.session._playing and it.session.latest.picked == [])
    page.mouse.move(300, 60)
    page.keyboard.press("a")
    eventually(lambda: any(type(what) is Drop for _, what in live.recording.inputs))
    it.until(f"() => pointmass.frame().sequence >= {it.session.latest.sequence}")
    page.keyboard.press("n")
    eventually(lambda: len(live.picked) == 1)
    page.keyboard.press("p")
    eventually(lambda: live.pinned)
    it.until("() => pointmass.frame().head.pinned")
    page.keyboard.press("Control+z")
    it.until("() => !pointmass.frame().head.pinned")
    page.keyboard.press("Control+Shift+z")
    it.until("() => pointmass.frame().head.pinned")
    page.mouse.move(40, 330)  # nobody is there: the next in line
    page.keyboard.press("n")
    eventually(lambda: len(live.picked) == 2)
    page.keyboard.press("j")
    eventually(lambda: any(type(what) is Join for _, what in live.recording.inputs))
    page.keyboard.press("b")
    eventually(lambda: type(live.recording.inputs[-1][1]) is Shoot)
    it.until("() => pointmass.frame().head.items.some(item => item.name === 'pushing sphere')")

    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.keyboard.press("c")
    it.until("() => document.getElementById('note').textContent.includes('clipboard')")
    assert Scene.from_toml(page.evaluate("() => navigator.clipboard.readText()")).solver.name == "rk4"
    assert it.problems == []


def test_keys_act_whatever_was_clicked_last_and_controls_keep_theirs(opened):
    it = opened(SCENES["pendulum"](links=1))
    page = it.page
    it.until("() => pointmass.connection.received > 0")
    page.locator("#shown button[title^='Velocities']").click()
    page.keyboard.press(" ")
    eventually(lambda: not it.session._playing)
    assert it.session._instruments.message.shown == ["velocity"]  # the space was not the button's
    page.keyboard.press("s")
    page.locator(".lil-title", has_text="Forces").click()
    box = page.locator(".lil-controller input[type=checkbox]").last
    box.scroll_into_view_if_needed()  # when the folder is open
    box.focus()
    page.keyboard.press(" ")
    eventually(lambda: False in it.live.setup.switches.values())
    assert not it.session._playing
    assert it.problems == []


TIP_OF_WIND = """direction => {
    const { camera } = pointmass, canvas = document.getElementById("picture"), { eye } = camera;
    const base = eye.position.clone().set(-0.72, 0.4, 0.5).unproject(eye).sub(eye.position).normalize();
    base.multiplyScalar(camera.distance).add(eye.position);
    const length = camera.pixels(60) * camera.distance;
    const tip = base.clone().set(...direction).normalize().multiplyScalar(length).add(base);
    const pixels = (p) => [(p.x + 1) / 2 * canvas.clientWidth, (1 - p.y) / 2 * canvas.clientHeight];
    return [base, tip].map((p) => pixels(p.project(eye)));
}"""


def test_the_wind_blows_where_its_tip_is_dragged(opened):
    it = opened(SCENES["fountain"](jets=1, rate=10.0, wind=1.0))
    page = it.page
    page.set_viewport_size({"width": 900, "height": 600})
    it.until("() => pointmass.connection.received > 0")
    it.pause_at_the_start()
    it.page.evaluate(THREE_PICTURES)
    (x, y), tip = page.evaluate(TIP_OF_WIND, list(it.live.wind))
    page.mouse.move(*tip)
    page.mouse.down()
    page.mouse.move(x, y - 80)  # beyond the arrow's length: straight up in the picture
    eventually(lambda: it.live.setup.wind is not None)
    page.mouse.up()
    up = np.array(
        page.evaluate("() => { const e = pointmass.camera.eye.matrixWorld.elements; return [e[4], e[5], e[6]]; }")
    )
    wind = np.array(it.live.wind)
    assert wind @ up > 0.9 * np.linalg.norm(wind)
    assert it.problems == []


def test_a_field_is_typed_seen_followed_by_a_curve_and_takes_a_cloth(opened, monkeypatch):
    monkeypatch.setenv("POINTMASS_ENGINE", "reference")  # a cloth's kernel takes long to compile
    it = opened(SCENES["field"](particles=1, arrows=8, streamlines=8))
    live, page = it.live, it.page
    page.set_viewport_size({"width": 900, "height": 600})
    page.set_default_timeout(PATIENCE)
    it.until("() => pointmass.connection.received > 0")
    it.pause_at_the_start()
    if not page.locator(".lil-controller", has_text="gravity").is_visible():
        page.keyboard.press("s")

    def typed(name, text):
        box = page.locator(".lil-controller", has_text=re.compile(f"^{name} m/s")).locator("input")
        box.fill(text)
        box.press("Enter")

    typed("u", "x**")
    it.until("() => document.getElementById('note').textContent.startsWith(\"u 'x**' is not a formula\")")
    assert live.setup.parameters == {}
    typed("u", "1")
    eventually(lambda: live.setup.parameters == {"u": "1"})
    typed("v", "0")
    eventually(lambda: live.setup.parameters == {"u": "1", "v": "0"})
    it.until("() => document.getElementById('note').hidden")
    it.until("() => ['field', 'streamlines'].every((name) => pointmass.registry.shown.has(name))")
    page.locator("#shown select").select_option("divergence")
    it.until("() => document.querySelector('#legend small')?.textContent.includes('spreads')")
    page.locator("#shown button[title^='Streamlines']").click()
    it.until("() => !pointmass.registry.shown.has('streamlines')")

    page.locator("#shown button[title^='Integral']").click()
    it.until("() => !document.getElementById('curves').hidden")
    page.mouse.click(505, 330)  # at the start nobody is born yet who could be meant
    eventually(lambda: it.session._instruments.message.curves.count == 1)
    it.until("() => pointmass.registry.shown.has('integral curves by euler')")
    it.until("() => document.querySelector('#curves output').textContent.endsWith(' m off')")
    place = it.session._instruments._curves._starts[0].place
    assert place[2] == 0
    page.locator("#curves input[name=euler]").click()
    it.until("() => !pointmass.registry.shown.has('integral curves by euler')")
    assert page.evaluate("() => pointmass.registry.shown.has('integral curves by rk4')")

    page.locator(".lil-controller", has_text="drop").locator("select").select_option("cloth")
    it.until("() => pointmass.frame().head.count === 400")
    before = live.sim.system.particles.x[:, 0].mean()
    page.locator("#transport button[title^='One frame']").click()
    eventually(lambda: live.sim.system.particles.x[:, 0].mean() > before)
    it.until("() => pointmass.registry.shown.has('field') && pointmass.registry.shown.has('integral curves by rk4')")
    page.keyboard.press("Control+z")
    eventually(lambda: live.setup.parameters == {"u": "1", "v": "0"})
    it.until("() => pointmass.frame().head.count < 400")
    assert it.problems == []
