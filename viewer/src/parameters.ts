// The scene's parameters as sliders with their units, and its presets.

import GUI, { type Controller } from "lil-gui";
import { ROOMY } from "./camera";
import type { Connection } from "./connection";
import type { Parameter, Value, Welcome } from "./messages";
import type { Setup } from "./setup";

const WIDE = 8; // a range beyond so many times the value is more than a slider can show

export class Parameters {
  private gui: GUI | null = null;
  private values: Record<string, Value> = {};
  private controllers = new Map<string, Controller>();
  private waiting = new Map<string, Value>();
  private shown = ""; // of which the panel is

  constructor(
    private readonly connection: Connection,
    private readonly setup: Setup,
  ) {}

  show(welcome: Welcome): void {
    const shown = [...welcome.parameters, ...welcome.switches].map(({ name }) => name).join();
    if (this.gui && shown === this.shown) {
      for (const { name, value } of welcome.parameters) {
        if (this.values[name] === value || this.waiting.has(name) || this.typing(name)) continue;
        this.values[name] = value;
        this.controllers.get(name)!.updateDisplay();
      }
      this.setup.show(welcome);
      return;
    }
    this.shown = shown;
    this.gui?.destroy();
    this.controllers.clear();
    const gui = (this.gui = new GUI({ title: "Parameters", width: 300, closeFolders: innerWidth < ROOMY }));
    if (innerWidth < ROOMY) gui.close();
    if (welcome.presets.length) {
      const chosen = { preset: "" };
      const options = Object.fromEntries([["as shipped", ""], ...welcome.presets.map((name) => [name, name])]);
      gui.add(chosen, "preset", options).onChange((preset: string) => this.connection.send({ kind: "choose", preset }));
    }
    for (const parameter of welcome.parameters) this.add(gui, parameter);
    this.setup.build(gui, welcome);
    if (!gui.children.length) gui.hide();
  }

  toggle(): void {
    if (this.gui) this.gui.open(this.gui._closed);
  }

  /** Where they are, if they are open. */
  get box(): DOMRect | null {
    return this.gui && !this.gui._closed && !this.gui._hidden ? this.gui.domElement.getBoundingClientRect() : null;
  }

  /** Once for each picture: what was turned meanwhile. */
  update(): void {
    for (const [name, value] of this.waiting) this.connection.send({ kind: "change", name, value });
    this.waiting.clear();
  }

  /** Whether a text is being typed, which nobody else's change may overwrite. */
  private typing(name: string): boolean {
    const { domElement } = this.controllers.get(name)!;
    return domElement.classList.contains("lil-string") && domElement.contains(document.activeElement);
  }

  private add(gui: GUI, p: Parameter): void {
    this.values[p.name] = p.value;
    const controller = this.made(gui, p);
    const label = p.name.replaceAll("_", " ");
    controller.name(label);
    const unit = document.createElement("small");
    unit.textContent = ` ${p.unit.replace(/\^2/g, "²").replace(/\^3/g, "³")}`;
    controller.$name.append(unit);
    controller.domElement.title = p.summary;
    const changed = (value: Value) => this.waiting.set(p.name, value);
    // What makes other particles begins the run again: when the slider is let go, not on its way. A text is typed first.
    const text = typeof p.value === "string" && !p.choices.length;
    if (text) controller.domElement.querySelector("input")!.spellcheck = false;
    if (p.whole || text) controller.onFinishChange(changed);
    else controller.onChange(changed);
    this.controllers.set(p.name, controller);
  }

  private made(gui: GUI, p: Parameter): Controller {
    if (p.choices.length) return gui.add(this.values, p.name, p.choices);
    if (typeof p.value !== "number") return gui.add(this.values, p.name);
    const [low, high] = range(p, p.value);
    if (low === null || high === null) return gui.add(this.values, p.name);
    return gui.add(this.values, p.name, low, high, p.whole ? 1 : undefined);
  }
}

/** Ends of a slider: those declared, but near enough to the value that a hand can set it. */
function range(p: Parameter, value: number): [number | null, number | null] {
  let { minimum: low, maximum: high } = p;
  const size = Math.abs(value);
  if (size > 0) {
    if (high === null || high > WIDE * size) high = p.whole ? Math.ceil(4 * size) : 4 * size;
    if (low === null || low < -WIDE * size) low = p.whole ? -Math.ceil(4 * size) : -4 * size;
  }
  return [low, high];
}
