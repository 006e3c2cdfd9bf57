// The bar of what is shown beside the scene: the lens with its legend, arrows, and the button of the plots.

import { addButton, icon } from "./button";
import { short } from "./chart";
import type { Connection } from "./connection";
import type { Curves } from "./curves";
import type { Instruments, Legend } from "./messages";

const SHAPES: Record<string, string> = {
  plots: "M4 4v16h16M8 15l4-5 3 3 5-7",
  velocity: "M4 20 19 5M10 5h9v9",
  contact: "M3 19h18M12 19V6M7 11l5-5 5 5",
  force: "M4 12h14M13 6l6 6-6 6M4 7v10",
  field: "M3 7h7M7 4l3 3-3 3M13 7h8M18 4l3 3-3 3M3 17h7M7 14l3 3-3 3M13 17h8M18 14l3 3-3 3",
  streamlines: "M3 8c5-5 9 5 18 0M3 16c5-5 9 5 18 0",
  curves: "M4 19c0-9 7-14 12-14s5 7 1 8-6-4-2-7M4 19h.01",
  duel: "M4 5h7v14H4zM14 5h7v14h-7z",
};

const ARROWS = ["velocity", "force", "contact", "field", "streamlines"];

export class Lens {
  private instruments: Instruments | null = null;
  private readonly choice = document.createElement("select");
  private readonly buttons = new Map<string, HTMLButtonElement>();

  constructor(
    private readonly bar: HTMLElement,
    private readonly legend: HTMLElement,
    private readonly connection: Connection,
    plots: () => void,
    private readonly curves: Curves,
  ) {
    bar.hidden = true; // a film has none
    this.choice.ariaLabel = this.choice.title = "Colours (E)";
    this.choice.addEventListener("change", () => connection.send({ kind: "lens", name: this.choice.value }));
    bar.append(this.choice);
    this.button("velocity", "Velocities (V)", () => this.arrows("velocity"));
    this.button("force", "Forces (K)", () => this.arrows("force"));
    this.button("contact", "Contacts (Q)", () => this.arrows("contact"));
    this.button("field", "Arrows of the field (U)", () => this.arrows("field"));
    this.button("streamlines", "Streamlines (H)", () => this.arrows("streamlines"));
    this.button("curves", "Integral curves (Y)", () => this.curves.toggle());
    this.button("duel", "Beside each other, or over each other (M)", () => this.arrange());
    this.button("plots", "Plots (T)", plots);
  }

  set(instruments: Instruments): void {
    this.instruments = instruments;
    this.bar.hidden = false;
    this.choice.replaceChildren(
      new Option("no lens", ""),
      ...instruments.lenses.map(({ name, title }) => new Option(title, name)),
    );
    this.choice.value = instruments.lens;
    for (const name of ARROWS) {
      const button = this.buttons.get(name)!;
      button.hidden = !instruments.vectors.some((each) => each.name === name);
      button.ariaPressed = String(instruments.shown.includes(name));
    }
    const duel = this.buttons.get("duel")!;
    duel.hidden = !instruments.duel;
    duel.ariaPressed = String(instruments.beside);
    this.update();
  }

  /** Whether the integral curves have been opened or closed. */
  update(): void {
    const button = this.buttons.get("curves")!;
    button.hidden = !this.curves.works;
    button.ariaPressed = String(this.curves.shown);
  }

  /** What the colours of the newest frame mean. */
  show(legend: Legend | null): void {
    this.legend.hidden = legend === null;
    if (!legend) return;
    const { low, high, colors, mark } = legend;
    const part = (value: number) => (100 * (value - low)) / (high - low || 1);
    const middle = mark ?? 0.5 * (low + high);
    const short3 = (value: number) => short(Number(value.toPrecision(3)));
    const label = (value: number, text = short3(value)) => `<span style="left:${part(value)}%">${text}</span>`;
    this.legend.innerHTML =
      `<div class="scale" style="background:linear-gradient(90deg,${colors.join()})">` +
      `${mark === null ? "" : `<i style="left:${part(mark)}%"></i>`}</div>` +
      `<div class="labels">${label(low)}${label(middle)}${label(high, `${short3(high)} ${legend.unit}`)}</div>` +
      (legend.meaning ? `<small>${legend.meaning}</small>` : "");
  }

  next(): void {
    const names = ["", ...(this.instruments?.lenses.map(({ name }) => name) ?? [])];
    const at = names.indexOf(this.instruments?.lens ?? "");
    this.connection.send({ kind: "lens", name: names[(at + 1) % names.length] });
  }

  arrows(name: string): void {
    if (this.instruments?.vectors.some((each) => each.name === name)) this.connection.send({ kind: "vectors", name, on: !this.instruments?.shown.includes(name) });
  }

  arrange(): void {
    if (this.instruments?.duel) this.connection.send({ kind: "arrange", beside: !this.instruments.beside });
  }

  private button(shape: string, label: string, action: () => void): void {
    this.buttons.set(shape, addButton(this.bar, icon(SHAPES[shape]), label, action));
  }
}
