// The drawer of plots: one chart for each plot of the run's track, and a line in which expressions are typed.

import { TimeChart, type Line } from "./chart";
import type { Connection } from "./connection";
import type { Frame } from "./frame";
import type { Instruments } from "./messages";
import { Track } from "./track";

const EVERY = 100; // [ms]

export class Plots {
  readonly track = new Track();
  private readonly charts = new Map<string, TimeChart>();
  private readonly list = document.createElement("div");
  private readonly names = document.createElement("small");
  private colors: Record<string, string> = {};
  private expressions: string[] = [];
  private stale = false;
  private since = 0;

  constructor(
    private readonly drawer: HTMLElement,
    private readonly connection: Connection,
  ) {
    const form = document.createElement("form"), input = document.createElement("input");
    input.placeholder = "plot, such as mean(y)";
    input.ariaLabel = "An expression over the particles";
    input.spellcheck = false;
    input.autocomplete = "off";
    form.append(input);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (input.value.trim()) connection.send({ kind: "plot", text: input.value, on: true });
      input.select();
    });
    this.list.className = "charts";
    drawer.append(form, this.names, this.list);
  }

  /** How the instruments are set. */
  set({ expressions, names }: Instruments): void {
    this.expressions = expressions;
    this.names.textContent = `mean, sum, min, max, std of ${names.join(", ")}`;
  }

  take(frames: Frame[]): void {
    for (const frame of frames) {
      for (const rows of frame.head.tracks) if (rows.name === "run" && this.track.take(rows, frame)) this.clear();
      this.colors = Object.fromEntries(frame.head.duel.map(({ name, color }) => [name, color]));
    }
    this.stale ||= frames.length > 0;
    const now = performance.now();
    if (!this.stale || this.drawer.hidden || now - this.since < EVERY) return;
    this.stale = false;
    this.since = now;
    this.draw();
  }

  /** In other colours. */
  dress(): void {
    this.clear();
    this.stale = true;
  }

  toggle(): void {
    this.drawer.hidden = !this.drawer.hidden;
    this.stale = true;
  }

  private clear(): void {
    for (const chart of this.charts.values()) chart.destroy();
    this.charts.clear();
  }

  private draw(): void {
    const { columns, times, values } = this.track;
    const plots = new Map<string, Line[]>();
    columns.forEach(({ plot, name }, k) => {
      if (!values[k].some((value) => value !== null)) return;
      plots.set(plot, [...(plots.get(plot) ?? []), { name, values: values[k], color: this.colors[name] }]);
    });
    for (const [plot, lines] of plots) {
      let chart = this.charts.get(plot);
      if (!chart?.has(lines)) {
        const first = columns.find((column) => column.plot === plot)!;
        const own = this.expressions.includes(plot);
        const drop = own ? () => this.connection.send({ kind: "plot", text: plot, on: false }) : undefined;
        const old = chart?.element;
        chart = new TimeChart(plot, first.unit, lines, first.log, drop);
        if (old) old.replaceWith(chart.element);
        else if (own) this.list.prepend(chart.element);
        else this.list.append(chart.element);
        this.charts.get(plot)?.destroy();
        this.charts.set(plot, chart);
      }
      chart.show(times, lines);
    }
  }
}
