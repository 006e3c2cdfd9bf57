// What was measured so far: a table that grows by the rows that come with frames.

import type { Frame } from "./frame";
import type { Column, TrackRows } from "./messages";

const MOST = 6000; // rows that are kept

export class Track {
  columns: Column[] = [];
  times: number[] = [];
  values: (number | null)[][] = []; // one array for each column
  private generation = -1;

  /** True if it began anew with other columns. */
  take(rows: TrackRows, frame: Frame): boolean {
    const anew = rows.generation !== this.generation;
    if (anew) {
      this.generation = rows.generation;
      this.columns = rows.columns;
      this.times = [];
      this.values = rows.columns.map(() => []);
    }
    const data = frame.view(rows.data), width = 1 + this.columns.length;
    for (let i = 0; i < data.length; i += width) {
      this.times.push(data[i]);
      this.values.forEach((column, k) => column.push(Number.isFinite(data[i + 1 + k]) ? data[i + 1 + k] : null));
    }
    const over = this.times.length - MOST;
    if (over > 0) for (const column of [this.times, ...this.values]) column.splice(0, over);
    return anew;
  }
}
