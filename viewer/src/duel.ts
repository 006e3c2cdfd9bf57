// The table of a duel: who runs, how far from the reference, with which energy, at which cost.

import { short } from "./chart";
import type { Contender } from "./messages";

const EVERY = 200; // [ms]

export class Duel {
  private since = 0;

  constructor(private readonly card: HTMLElement) {}

  show(contenders: Contender[]): void {
    this.card.hidden = contenders.length === 0;
    const now = performance.now();
    if (this.card.hidden || now - this.since < EVERY) return;
    this.since = now;
    const row = ({ name, color, error, energy, cost, ended }: Contender) =>
      `<tr><th scope="row"><s style="background:${color}"></s>${name.replaceAll("_", " ")}</th>` +
      (ended
        ? `<td colspan="3" title="${ended.replaceAll('"', "&quot;")}">blew up</td></tr>`
        : `<td>${error === null ? "–" : short(Number(error.toPrecision(2)))}</td><td>${short(energy)}</td>` +
          `<td>${short(Number((1000 * cost).toPrecision(2)))}</td></tr>`);
    this.card.innerHTML =
      `<table><thead><tr><th></th><th scope="col">error <small>m</small></th><th scope="col">energy <small>J</small></th>` +
      `<th scope="col">cost <small>ms</small></th></tr></thead><tbody>${contenders.map(row).join("")}</tbody></table>`;
  }
}
