// The bar at the bottom: play, pause, step, reset, slow motion; and the figures above it.

import { addButton, icon } from "./button";
import type { Connection } from "./connection";
import type { Frame } from "./frame";
import type { Status, Welcome } from "./messages";

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2];
const SHAPES = {
  reset: "M6 5v14M19 5 9 12l10 7z",
  play: "M7 4l13 8-13 8z",
  pause: "M7 4h4v16H7zM14 4h4v16h-4z",
  step: "M5 5l10 7-10 7zM18 5v14",
  help: "M9 9a3 3 0 1 1 4 3c-1 .5-1 1-1 2.5M12 18v.5",
};

export class Controls {
  private status: Status = { kind: "status", playing: true, speed: 1, undo: false, redo: false };
  private readonly play: HTMLButtonElement;
  private readonly pace: HTMLSelectElement;
  private shown = 0;
  private since = performance.now();
  private rate = 0;
  private cost = 0;

  constructor(
    bar: HTMLElement,
    private readonly figures: HTMLElement,
    private readonly connection: Connection,
    help: () => void,
  ) {
    const button = (shape: string, label: string, action: () => void) => addButton(bar, icon(shape), label, action);
    button(SHAPES.reset, "Begin again (R)", () => this.reset());
    this.play = button(SHAPES.pause, "Pause (space)", () => this.toggle());
    button(SHAPES.step, "One frame (.)", () => this.step());
    this.pace = document.createElement("select");
    this.pace.title = this.pace.ariaLabel = "Speed ([ and ])";
    for (const speed of SPEEDS) this.pace.add(new Option(`${speed}×`, String(speed)));
    this.pace.addEventListener("change", () => this.send(Number(this.pace.value)));
    bar.append(this.pace);
    button(SHAPES.help, "Keys (?)", help);
    this.show(this.status);
  }

  show(status: Status): void {
    this.status = status;
    this.play.innerHTML = icon(status.playing ? SHAPES.pause : SHAPES.play);
    this.play.title = this.play.ariaLabel = status.playing ? "Pause (space)" : "Play (space)";
    this.pace.value = String(status.speed);
  }

  toggle(): void {
    this.connection.send({ kind: "play", on: !this.status.playing });
  }

  step(): void {
    this.connection.send({ kind: "step" });
  }

  reset(): void {
    this.connection.send({ kind: "reset" });
  }

  /** The next slower or faster speed. */
  hurry(by: 1 | -1): void {
    const now = SPEEDS.findIndex((speed) => speed >= this.status.speed);
    this.send(SPEEDS[Math.min(Math.max(now + by, 0), SPEEDS.length - 1)]);
  }

  /** The figures, after each picture. */
  count(frame: Frame, frames: number, welcome: Welcome | null): void {
    this.shown += frames;
    const now = performance.now();
    this.cost = this.cost ? 0.9 * this.cost + 0.1 * frame.head.cost : frame.head.cost;
    if (now - this.since > 500) {
      this.rate = (1000 * this.shown) / (now - this.since);
      this.shown = 0;
      this.since = now;
    }
    const { time, count, number, quantities } = frame.head;
    const rows: [string, string][] = [
      ["time", `${time.toFixed(2)} s`],
      ["frames", welcome?.frames ? `${number + 1} of ${welcome.frames}` : `${this.rate.toFixed(0)} /s`],
      ["particles", count.toLocaleString("en")],
    ];
    if (this.cost > 0 && welcome?.solver) rows.push([welcome.solver.replaceAll("_", " "), `${(1000 * this.cost).toFixed(1)} ms`]);
    if (quantities.energy !== undefined && quantities.energy !== null) rows.push(["energy", `${short(quantities.energy)} J`]);
    this.figures.innerHTML = rows.map(([name, value]) => `<span>${name}</span><b>${value}</b>`).join("");
  }

  private send(factor: number): void {
    this.connection.send({ kind: "speed", factor });
  }
}

function short(value: number): string {
  const size = Math.abs(value);
  return size !== 0 && (size < 0.01 || size >= 1e5) ? value.toExponential(2) : value.toPrecision(4);
}
