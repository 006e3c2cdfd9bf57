// The page: frames come from the connection, the registry draws them, and controls send back what the user does.

import { copyScene } from "./clipboard";
import { Camera } from "./camera";
import { Connection } from "./connection";
import { Controls } from "./controls";
import { Curves } from "./curves";
import { Duel } from "./duel";
import type { Frame } from "./frame";
import { Grab } from "./grab";
import { Hand } from "./hand";
import { Keys } from "./keys";
import { Film } from "./film";
import { Lens } from "./lens";
import type { Status, Welcome } from "./messages";
import { Parameters } from "./parameters";
import { Pick } from "./pick";
import { Plots } from "./plots";
import { setBackdrop } from "./scene/light";
import { Picture } from "./scene/picture";
import { Registry } from "./scene/registry";
import { Setup } from "./setup";
import "./style.css";
import { firstTheme, other } from "./theme";
import { Timeline } from "./timeline";
import { Tools, type Tool } from "./tools";
import { Wind } from "./wind";

const find = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

const canvas = find<HTMLCanvasElement>("picture");
const note = find("note"), instruments = find("instruments");
const connection = Film.embedded() ?? new Connection();
const camera = new Camera(canvas);
const picture = new Picture(canvas);
let theme = firstTheme();
const registry = new Registry(theme);
const wind = new Wind(find("wind"), canvas, camera, connection); // hears of a press before the grab does
const grab = new Grab(canvas, camera, registry.places, connection);
const hand = new Hand(canvas, camera, registry.places, grab, connection);
const plots = new Plots(find("plots"), connection);
const curves = new Curves(find("curves"), camera, connection, () => lens.update());
const lens = new Lens(find("shown"), find("legend"), connection, () => plots.toggle(), curves);
const pick = new Pick(find("picked"), canvas, grab, registry.places, connection, (event) => curves.click(event));
const duel = new Duel(find("duel"));
picture.scene.add(registry.group, grab.mark, hand.mark, wind.mark, pick.mark);
let welcome: Welcome | null = null;
let newest: Frame | null = null;

function dress(): void {
  document.documentElement.dataset.theme = theme.name;
  setBackdrop(theme);
  registry.dress(theme);
  wind.dress(theme);
  plots.dress();
  pick.dress();
}

function say(level: string, text: string): void {
  note.hidden = text === "";
  note.textContent = text;
  note.dataset.level = level;
}

let status: Status | null = null;
const setup = new Setup(connection);
const parameters = new Parameters(connection, setup);
const tools: Tool[] = [
  { key: "ctrl+z", shown: "Ctrl Z", does: "undo", shape: "M9 14 4 9l5-5M4 9h10a6 6 0 0 1 0 12h-3", action: () => connection.send({ kind: "undo" }), ready: () => status?.undo ?? false },
  { key: "ctrl+shift+z", shown: "Ctrl Shift Z", does: "redo", shape: "M15 14l5-5-5-5M20 9H10a6 6 0 0 0 0 12h3", action: () => connection.send({ kind: "redo" }), ready: () => status?.redo ?? false },
  { key: "c", shown: "C", does: "copy the scene as TOML", shape: "M9 9h11v11H9zM5 15H4V4h11v1", action: copy, ready: () => (welcome?.solvers.length ?? 0) > 0 },
  { key: "n", shown: "N", does: "pick the particle under the cursor, or the next one", shape: "M12 4v4M12 16v4M4 12h4M16 12h4M12 12h.01", action: () => hand.pick(), ready: () => hand.works },
  { key: "p", shown: "P", does: "pin the picked particle, or let it go", shape: "M9 4h6l-1 6 3 3H7l3-3zM12 13v7", action: () => hand.pin(), ready: () => hand.works },
  { key: "j", shown: "J", does: "a spring between the last two picked", shape: "M4 16l3-8 3 8 3-8 3 8 3-8", action: () => hand.join(), ready: () => hand.works },
  { key: "a", shown: "A", does: "add a particle at the cursor", shape: "M12 6v12M6 12h12", action: () => hand.add(), ready: () => hand.works },
  { key: "b", shown: "B", does: "shoot a ball", shape: "M15 9a4 4 0 1 1-.01 0M3 21l5-5M3 16l3-3M8 21l3-3", action: () => hand.shoot(), ready: () => hand.works },
  { key: "x", shown: "X", does: "push with a sphere at the cursor", shape: "M12 5a7 7 0 1 1-.01 0M8 12l4-4", action: () => hand.togglePush(), pressed: () => hand.pushing, ready: () => hand.works },
  { key: "w", shown: "W", does: "turn the wind, also by the tip of its arrow", shape: "M3 9h11a3 3 0 1 0-3-3M3 14h15a3 3 0 1 1-3 3", action: () => wind.turn(), ready: () => wind.blows },
];
const toolbar = new Tools(find<HTMLDetailsElement>("tools"), tools);

function copy(): void {
  copyScene().then(
    () => say("info", "the scene is on the clipboard: paste it into a file, and give that to pointmass run"),
    (error: Error) => say("error", error.message),
  );
}

const timeline = new Timeline(find("timeline"), connection);
const controls = new Controls(find("transport"), find("figures"), connection, () => keys.toggle());
const keys = new Keys(find<HTMLDialogElement>("help"), [
  { key: " ", shown: "space", does: "play, pause", action: () => controls.toggle() },
  { key: ".", shown: ".", does: "one frame", action: () => controls.step() },
  { key: "r", shown: "R", does: "begin again", action: () => controls.reset() },
  { key: "[", shown: "[", does: "slower", action: () => controls.hurry(-1) },
  { key: "]", shown: "]", does: "faster", action: () => controls.hurry(1) },
  { key: "arrowleft", shown: "←", does: "a frame back", action: () => timeline.move(-1) },
  { key: "arrowright", shown: "→", does: "a frame on, of a cache", action: () => timeline.move(1) },
  { key: "home", shown: "Home", does: "its first frame", action: () => timeline.seek(0) },
  { key: "end", shown: "End", does: "its last frame", action: () => timeline.end() },
  { key: "i", shown: "I", does: "loop from here", action: () => timeline.from() },
  { key: "o", shown: "O", does: "loop to here", action: () => timeline.to() },
  { key: "l", shown: "L", does: "loop, or not", action: () => timeline.toggle() },
  { key: "g", shown: "G", does: "let the simulation go on from here", action: () => timeline.goOn() },
  { key: "f", shown: "F", does: "the camera's first place", action: () => camera.goHome() },
  { key: "s", shown: "S", does: "parameters and settings", action: () => parameters.toggle() },
  { key: "t", shown: "T", does: "plots", action: () => plots.toggle() },
  { key: "e", shown: "E", does: "the next lens", action: () => lens.next() },
  { key: "v", shown: "V", does: "velocities", action: () => lens.arrows("velocity") },
  { key: "k", shown: "K", does: "forces", action: () => lens.arrows("force") },
  { key: "q", shown: "Q", does: "contacts with surfaces", action: () => lens.arrows("contact") },
  { key: "u", shown: "U", does: "arrows of the field", action: () => lens.arrows("field") },
  { key: "h", shown: "H", does: "streamlines", action: () => lens.arrows("streamlines") },
  { key: "y", shown: "Y", does: "integral curves: click where they start", action: () => curves.toggle() },
  { key: "m", shown: "M", does: "a duel over, or beside each other", action: () => lens.arrange() },
  { key: "d", shown: "D", does: "dark, light", action: () => ((theme = other(theme)), dress()) },
  ...tools,
  { key: "?", shown: "?", does: "this list", action: () => keys.toggle() },
]);

connection.onState = (open) => say(open ? "info" : "error", open ? "" : "the connection is lost: is pointmass view still running?");
connection.onMessage = (message) => {
  if (message.kind === "status") {
    controls.show((status = message));
    toolbar.update();
  } else if (message.kind === "advice") setup.advise(message);
  else if (message.kind === "note") say(message.level, message.text);
  else if (message.kind === "view") camera.setHome(message);
  else if (message.kind === "timeline") timeline.show(message);
  else if (message.kind === "instruments") {
    curves.set(message);
    lens.set(message);
    plots.set(message);
  }
  else {
    welcome = message;
    document.title = `${message.name} · pointmass`;
    document.querySelector("#title h1")!.textContent = message.name;
    document.querySelector("#title p")!.textContent = message.summary;
    grab.enabled = message.grabs;
    parameters.show(message);
    wind.show(message);
    toolbar.update();
  }
};

new ResizeObserver(() => picture.resize()).observe(canvas);

function draw(): void {
  const frames = connection.take();
  if (frames.length) {
    newest = frames[frames.length - 1];
    registry.show(frames);
    controls.count(newest, frames.length, welcome);
    lens.show(newest.head.legend);
    duel.show(newest.head.duel);
    curves.show(newest.head.curves);
  }
  parameters.update();
  timeline.update(newest);
  const opened = document.querySelector("#instruments > section:not([hidden]):not(#legend)") !== null;
  camera.behind(instruments.getBoundingClientRect(), opened, parameters.box);
  camera.update();
  grab.update(newest);
  hand.update(newest);
  wind.update();
  plots.take(frames);
  pick.take(frames);
  pick.size(camera);
  picture.draw(camera.eye, camera.middle);
  connection.acknowledge(frames);
  requestAnimationFrame(draw);
}

// What tests, and the curious, may ask.
Object.assign(window, { pointmass: { connection, registry, camera, timeline, plots, pick, frame: () => newest } });

dress();
picture.resize();
connection.open();
requestAnimationFrame(draw);
