// Charts: quantities over time, and a curve in a plane. Lines differ by their dashes, too, not by colour alone.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const HEIGHT = 104;
const WIDTH = Math.min(312, innerWidth - 48); // of all charts [pixels]
const LINES: { color: string; dash: number[] }[] = [
  { color: "--line-1", dash: [] },
  { color: "--line-2", dash: [7, 4] },
  { color: "--line-3", dash: [2, 3] },
  { color: "--line-4", dash: [9, 3, 2, 3] },
  { color: "--line-5", dash: [4, 2] },
  { color: "--line-6", dash: [12, 3] },
  { color: "--line-7", dash: [1, 2] },
];

export interface Line {
  name: string;
  values: (number | null)[];
  color?: string;
}

function named(lines: Line[]): string {
  return lines.map(({ name }) => name).join("\n");
}

export function ink(name: string): string {
  return name.startsWith("--") ? getComputedStyle(document.documentElement).getPropertyValue(name) : name;
}

export function short(value: number | null | undefined): string {
  if (value === null || value === undefined) return "–";
  const size = Math.abs(value);
  return size !== 0 && (size < 0.001 || size >= 1e5) ? value.toExponential(1) : String(Number(value.toPrecision(4)));
}

function axis(): uPlot.Axis {
  return {
    stroke: () => ink("--faint"),
    grid: { stroke: () => ink("--edge"), width: 1 },
    ticks: { show: false },
    font: "10px system-ui",
    size: 16,
    gap: 2,
    space: 44,
    values: (_, splits) => splits.map(short),
  };
}

/** Powers of ten, not too many. */
function decades(_: uPlot, _axis: number, low: number, high: number): number[] {
  const first = Math.ceil(Math.log10(low)), last = Math.floor(Math.log10(high));
  const step = Math.max(1, Math.ceil((last - first) / 4));
  return Array.from({ length: Math.max(0, Math.floor((last - first) / step) + 1) }, (_, k) => 10 ** (first + k * step));
}

const FRAME = { legend: { show: false }, cursor: { show: false }, padding: [8, 8, 0, 0] as uPlot.Padding };

/** Of the lines that go on: one that has ended, such as that of a solver that blew up, would leave no room for them. */
function extent(lines: Line[]): [number, number] {
  const going = lines.filter(({ values }) => values.at(-1) !== null);
  let low = Infinity, high = -Infinity;
  for (const { values } of going.length ? going : lines) {
    for (const value of values) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  return low <= high ? [low, high] : [0, 1];
}

/** Lines over time under a head with their names, and their values now. */
export class TimeChart {
  readonly element = document.createElement("figure");
  private readonly head = document.createElement("figcaption");
  private readonly chart: uPlot;
  private readonly figures: HTMLElement[] = [];
  private readonly names: string;
  private range: [number, number] = [0, 1];

  constructor(title: string, unit: string, lines: Line[], private readonly log: boolean, drop?: () => void) {
    this.names = named(lines);
    const name = document.createElement("b");
    name.textContent = title;
    const measure = document.createElement("small");
    measure.textContent = unit;
    this.head.append(name, measure);
    for (const [k, line] of lines.entries()) {
      const item = document.createElement("span"), figure = document.createElement("i"), swatch = document.createElement("s");
      swatch.style.borderTopColor = line.color ?? `var(${LINES[k % LINES.length].color})`;
      swatch.style.borderTopStyle = LINES[k % LINES.length].dash.length ? "dashed" : "solid";
      item.append(swatch, ...(lines.length > 1 ? [line.name] : []), figure);
      this.figures.push(figure);
      this.head.append(item);
    }
    if (drop) {
      const button = document.createElement("button");
      button.textContent = "×";
      button.ariaLabel = button.title = `Plot ${title} no longer`;
      button.addEventListener("click", drop);
      this.head.append(button);
    }
    this.element.append(this.head);
    this.chart = new uPlot(
      {
        ...FRAME,
        width: WIDTH,
        height: HEIGHT,
        scales: { x: { time: false }, y: log ? { distr: 3 } : { range: () => uPlot.rangeNum(...this.range, 0.1, true) } },
        axes: [axis(), { ...axis(), size: 44, space: 26, ...(log && { splits: decades, filter: (_, splits) => splits }) }],
        series: [
          {},
          ...lines.map((line, k) => ({
            stroke: () => ink(line.color ?? LINES[k % LINES.length].color),
            dash: LINES[k % LINES.length].dash,
            width: 1.5,
            points: { show: false },
          })),
        ],
      },
      [[], ...lines.map(() => [])],
      this.element,
    );
  }

  /** Whether its lines are these. */
  has(lines: Line[]): boolean {
    return named(lines) === this.names;
  }

  show(times: number[], lines: Line[]): void {
    const drawn = (values: Line["values"]) => (this.log ? values.map((value) => (value !== null && value > 0 ? value : null)) : values);
    this.range = extent(lines);
    this.chart.setData([times, ...lines.map((line) => drawn(line.values))]);
    lines.forEach((line, k) => (this.figures[k].textContent = short(line.values.at(-1))));
  }

  destroy(): void {
    this.chart.destroy();
    this.element.remove();
  }
}

/** A curve in a plane, with a dot where it is now. */
export class PhaseChart {
  private readonly chart: uPlot;

  constructor(element: HTMLElement) {
    const draw = (plot: uPlot, index: number) => {
      uPlot.orient(plot, index, (_series, xs, ys, scaleX, scaleY, toX, toY, left, top, wide, high) => {
        const pen = plot.ctx, many = xs.length;
        const at = (k: number): [number, number] => [toX(xs[k], scaleX, wide, left), toY(ys[k] as number, scaleY, high, top)];
        pen.save();
        pen.lineWidth = 1.4 * devicePixelRatio;
        pen.lineJoin = "round";
        pen.strokeStyle = ink("--line-1");
        pen.beginPath();
        for (let k = 0; k < many; k++) pen.lineTo(...at(k));
        pen.stroke();
        if (many) {
          pen.fillStyle = ink("--hot");
          pen.beginPath();
          pen.arc(...at(many - 1), 4 * devicePixelRatio, 0, 2 * Math.PI);
          pen.fill();
        }
        pen.restore();
      });
      return null;
    };
    const padded: uPlot.Scale.Range = (_, low, high) => {
      const room = 0.08 * (high - low) || Math.max(1e-6, 0.1 * Math.abs(high));
      return [low - room, high + room];
    };
    this.chart = new uPlot(
      {
        ...FRAME,
        mode: 2,
        width: WIDTH,
        height: 190,
        scales: { x: { time: false, range: padded }, y: { range: padded } },
        axes: [axis(), { ...axis(), size: 44, space: 30 }],
        series: [{}, { paths: draw, points: { show: false }, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }] }],
      },
      [[], [[], []]] as unknown as uPlot.AlignedData,
      element,
    );
  }

  show(xs: (number | null)[], ys: (number | null)[]): void {
    this.chart.setData([[], [xs, ys]] as unknown as uPlot.AlignedData);
  }

  redraw(): void {
    this.chart.redraw();
  }
}
