// Integral curves: while their card is open, a click beside all particles starts one by each chosen solver.

import * as THREE from "three";
import { addHead } from "./button";
import { short } from "./chart";
import type { Camera } from "./camera";
import type { Connection } from "./connection";
import "./curves.css";
import type { CurveEnd, Curves as Settings, Instruments } from "./messages";

const DASH = 5; // of the legend, by the width of six lines in the picture [pixels]

export class Curves {
  private settings: Settings | null = null;
  private open = false;
  private readonly rows = document.createElement("div");
  private readonly dt = document.createElement("input");
  private readonly span = document.createElement("input");
  private readonly errors = new Map<string, HTMLElement>();
  private readonly pointer = new THREE.Vector2();

  constructor(
    private readonly card: HTMLElement,
    private readonly camera: Camera,
    private readonly connection: Connection,
    private readonly changed: () => void,
  ) {
    addHead(card, "integral curves", "Close (Y)", () => this.toggle());
    const hint = document.createElement("small"), foot = document.createElement("footer"), clear = document.createElement("button");
    hint.textContent = "click in the picture to start one";
    clear.textContent = "clear";
    clear.addEventListener("click", () => connection.send({ kind: "clear_curves" }));
    foot.append(this.field(this.dt, "dt", "step of the solvers"), this.field(this.span, "for", "how long the curves are"), clear);
    card.append(hint, this.rows, foot);
  }

  get works(): boolean {
    return this.settings !== null;
  }

  get shown(): boolean {
    return this.open && this.works;
  }

  set({ curves }: Instruments): void {
    this.settings = curves;
    this.card.hidden = !this.shown;
    if (!curves) return;
    this.dt.value = short(curves.dt);
    this.span.value = short(curves.span);
    this.errors.clear();
    this.rows.replaceChildren(
      ...curves.solvers.map(({ name, color, dash, on }) => {
        const row = document.createElement("label"), box = document.createElement("input"), error = document.createElement("output");
        box.type = "checkbox";
        box.checked = on;
        box.name = name;
        box.addEventListener("change", () => this.connection.send({ kind: "curve_solver", name, on: box.checked }));
        const dashes = dash[1] ? `stroke-dasharray="${dash.map((part) => part * DASH).join()}"` : "";
        row.append(box);
        row.insertAdjacentHTML(
          "beforeend",
          `<svg viewBox="0 0 36 8" aria-hidden="true"><path d="M0 4h36" stroke="${color}" ${dashes}/></svg><span>${name.replaceAll("_", " ")}</span>`,
        );
        row.append(error);
        this.errors.set(name, error);
        return row;
      }),
    );
  }

  /** How far the newest curve of each solver ends from the field's own. */
  show(ends: CurveEnd[]): void {
    const known = new Map(ends.map(({ name, error }) => [name, error]));
    for (const [name, output] of this.errors) {
      const error = known.get(name);
      const text = error === undefined ? "" : error === null ? "left" : `${short(Number(error.toPrecision(2)))} m off`;
      if (output.textContent !== text) output.textContent = text;
    }
  }

  toggle(): void {
    if (!this.works) return;
    this.open = !this.open;
    this.card.hidden = !this.shown;
    this.changed();
  }

  /** A click where no particle is; true if it starts a curve. */
  click(event: PointerEvent): boolean {
    if (!this.shown) return false;
    this.camera.toPicture(event, this.pointer);
    const place = this.camera.sight(this.pointer).intersectPlane(this.plane(), new THREE.Vector3());
    if (place) this.connection.send({ kind: "curve", place: place.toArray() });
    return place !== null;
  }

  /** That of a field in a plane; else the one through the camera's middle that is parallel to the picture. */
  private plane(): THREE.Plane {
    const low = new THREE.Vector3(...this.settings!.low), thick = new THREE.Vector3(...this.settings!.high).sub(low).toArray();
    const flat = thick.indexOf(0);
    if (flat >= 0) return new THREE.Plane().setFromNormalAndCoplanarPoint(new THREE.Vector3().setComponent(flat, 1), low);
    return this.camera.plane();
  }

  private field(input: HTMLInputElement, name: string, title: string): HTMLLabelElement {
    const label = document.createElement("label");
    input.type = "text";
    input.inputMode = "decimal";
    input.title = input.ariaLabel = `${title} [s]`;
    input.addEventListener("change", () => {
      this.connection.send({ kind: "curve_step", dt: Number(this.dt.value), span: Number(this.span.value) });
    });
    label.append(name, input, "s");
    return label;
  }
}
