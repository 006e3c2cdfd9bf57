// The picked particle: a click takes it; its numbers, and its way through phase space along an axis.

import * as THREE from "three";
import { addHead } from "./button";
import { PhaseChart, short } from "./chart";
import type { Camera } from "./camera";
import type { Connection } from "./connection";
import type { Frame } from "./frame";
import type { Grab } from "./grab";
import type { Inspected, Vector } from "./messages";
import { ring } from "./ring";
import type { Places } from "./scene/places";
import { Track } from "./track";

const STILL = 5; // a press that moves no more is a click [pixels]
const BRIEF = 400; // and one that takes no longer [ms]
const EVERY = 60; // [ms]
const AXES = ["x", "y", "z"];

export class Pick {
  readonly mark: THREE.Sprite;
  readonly track = new Track();
  private readonly figures = document.createElement("dl");
  private readonly axis = document.createElement("select");
  private readonly phase: PhaseChart;
  private frame: Frame | null = null;
  private down: { x: number; y: number; time: number } | null = null;
  private since = 0;

  constructor(
    private readonly card: HTMLElement,
    private readonly canvas: HTMLCanvasElement,
    private readonly grab: Grab,
    private readonly places: Places,
    private readonly connection: Connection,
    private readonly beside: (event: PointerEvent) => boolean, // a click where nobody is; true if somebody takes it
  ) {
    this.mark = ring(0xffffff, 9);
    this.axis.ariaLabel = "Axis of the phase portrait";
    for (const axis of AXES) this.axis.add(new Option(`v${axis} over ${axis}`, axis));
    this.axis.value = "y";
    this.axis.addEventListener("change", () => this.draw());
    addHead(card, "picked particle", "Pick nobody", () => connection.send({ kind: "dismiss" }));
    card.append(this.figures, this.axis);
    this.phase = new PhaseChart(card);
    // Before the canvas hears of it, where a grab ends what others hear.
    addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    addEventListener("pointerup", (event) => this.release(event), { capture: true });
  }

  take(frames: Frame[]): void {
    for (const frame of frames) for (const rows of frame.head.tracks) if (rows.name === "picked") this.track.take(rows, frame);
    if (frames.length) this.frame = frames[frames.length - 1];
    const picked = this.frame?.head.inspected ?? null;
    this.card.hidden = picked === null;
    this.mark.visible = picked !== null && picked.row >= 0 && picked.row < this.places.count;
    if (this.mark.visible) this.places.at(picked!.row, this.mark.position);
    const now = performance.now();
    if (!picked || !frames.length || now - this.since < EVERY) return;
    this.since = now;
    this.figures.innerHTML = rows(picked).map(([name, value]) => `<dt>${name}</dt><dd>${value}</dd>`).join("");
    this.draw();
  }

  /** As large in the picture from near and far. */
  size(camera: Camera): void {
    this.mark.scale.setScalar(camera.pixels(22));
  }

  dress(): void {
    this.phase.redraw();
  }

  private draw(): void {
    const at = AXES.indexOf(this.axis.value);
    if (this.track.columns.length) this.phase.show(this.track.values[at], this.track.values[at + 3]);
  }

  private press(event: PointerEvent): void {
    const mine = event.target === this.canvas && event.button === 0 && event.isPrimary;
    this.down = mine ? { x: event.clientX, y: event.clientY, time: event.timeStamp } : null;
  }

  private release(event: PointerEvent): void {
    const down = this.down;
    this.down = null;
    if (!down || !this.frame || event.timeStamp - down.time > BRIEF) return;
    if (Math.hypot(event.clientX - down.x, event.clientY - down.y) > STILL) return;
    const row = this.grab.under(event);
    if (row >= 0) this.connection.send({ kind: "inspect", sequence: this.frame.sequence, row });
    else if (!this.beside(event) && this.frame.head.inspected) this.connection.send({ kind: "dismiss" });
  }
}

function rows(picked: Inspected): [string, string][] {
  if (picked.row < 0) return [["id", picked.id], ["", "is no longer there"]];
  const vector = (v: Vector, unit: string) => `${v.map((n) => short(Number(n.toPrecision(3)))).join(", ")} <small>${unit}</small>`;
  const size = (v: Vector) => Math.hypot(...v);
  const result: [string, string][] = [
    ["id", picked.id + (picked.pinned ? " (pinned)" : "")],
    ["place", vector(picked.position, "m")],
    ["velocity", vector(picked.velocity, "m/s")],
    ["speed", `${short(size(picked.velocity))} <small>m/s</small>`],
  ];
  if (picked.force) result.push(["force", vector(picked.force, "N")], ["", `${short(size(picked.force))} <small>N</small>`]);
  if (picked.mass !== null) result.push(["mass", `${short(picked.mass)} <small>kg</small>`]);
  if (picked.age !== null) result.push(["age", `${picked.age.toFixed(2)} <small>s</small>`]);
  if (picked.springs) result.push(["springs", String(picked.springs)]);
  return result;
}
