// Beside the parameters: solver and step with what is recommended, forces and colliders to switch on and off.

import type GUI from "lil-gui";
import type { Controller } from "lil-gui";
import type { Connection } from "./connection";
import type { Advice, Welcome } from "./messages";

export class Setup {
  private solver: { name: string; dt: number } = { name: "", dt: 0 };
  private on: Record<string, boolean> = {};
  private controllers: Controller[] = [];
  private advised: Advice | null = null;
  private readonly note = document.createElement("div");

  constructor(private readonly connection: Connection) {
    this.note.className = "advice";
    this.note.setAttribute("role", "status");
  }

  /** Into a new panel. */
  build(gui: GUI, welcome: Welcome): void {
    this.controllers = [];
    this.take(welcome);
    if (welcome.solvers.length) {
      const folder = gui.addFolder("Solver");
      const send = () => this.connection.send({ kind: "solver", name: this.solver.name, dt: this.solver.dt });
      this.controllers.push(folder.add(this.solver, "name", welcome.solvers).name("solver").onChange(send));
      const step = folder.add(this.solver, "dt").decimals(6).name("dt").onFinishChange(send);
      step.$name.insertAdjacentHTML("beforeend", "<small> s</small>");
      step.domElement.title = "step of the solver";
      this.controllers.push(step);
      folder.$children.append(this.note);
    }
    if (welcome.switches.length) {
      const folder = gui.addFolder("Forces and colliders").close();
      for (const { name, label } of welcome.switches) {
        const send = (on: boolean) => this.connection.send({ kind: "switch", name, on });
        this.controllers.push(folder.add(this.on, name).name(label).onChange(send));
      }
    }
    this.tell();
  }

  /** After somebody has changed something. */
  show(welcome: Welcome): void {
    this.take(welcome);
    for (const controller of this.controllers) controller.updateDisplay();
    this.tell();
  }

  advise(advice: Advice): void {
    this.advised = advice;
    this.tell();
  }

  private take({ solver, dt, switches }: Welcome): void {
    Object.assign(this.solver, { name: solver, dt });
    for (const { name, on } of switches) this.on[name] = on;
  }

  private tell(): void {
    const { advised } = this;
    const known = advised !== null && advised.solver === this.solver.name && advised.largest !== 0;
    this.note.hidden = !known;
    if (!known) return;
    const over = advised.largest !== null && this.solver.dt > advised.largest;
    this.note.dataset.over = String(over);
    if (advised.largest === null) this.note.textContent = "stable at any step";
    else this.note.textContent = `stable up to ${advised.largest.toPrecision(3)} s${over ? ": dt is too long" : ""}`;
  }
}
