// A film: a file that holds the page and its frames, played without a server. It stands in for the connection.

import { Connection } from "./connection";
import { Frame } from "./frame";
import type { Inbound, FilmHead, Timeline } from "./messages";

type Does = { [K in Inbound["kind"]]?: (message: Extract<Inbound, { kind: K }>) => void };

export class Film extends Connection {
  private readonly frames: Frame[] = []; // that are decoded
  private readonly carriers: Map<string, number>[] = []; // for each of them, which one brought the parts that it shows
  private shown = new Map<string, number>(); // what the page has of them
  private playing = true;
  private speed = 1;
  private at = 0; // with a fraction while it plays
  private seen = -1; // the frame that was taken last
  private since = performance.now();
  private timeline: Timeline;

  private readonly does: Does = {
    play: ({ on }) => {
      if (on && this.at >= this.timeline.frames - 1) this.at = 0;
      this.play(on);
    },
    step: () => {
      this.seek(Math.floor(this.at) + 1);
      this.play(false);
    },
    reset: () => this.seek(0),
    seek: ({ frame }) => this.seek(frame),
    speed: ({ factor }) => {
      this.speed = factor;
      this.play(this.playing);
    },
    loop: ({ on, first, last }) => {
      this.timeline = { ...this.timeline, loop: on, first: on ? first : 0, last: on ? last : this.timeline.frames - 1 };
      this.onMessage(this.timeline);
    },
  };

  private constructor(private readonly head: FilmHead) {
    super();
    this.timeline = head.timeline;
  }

  /** The one in this file, if it is one. */
  static embedded(): Film | null {
    const head = document.getElementById("film");
    return head ? new Film(JSON.parse(head.textContent!)) : null;
  }

  override open(): void {
    for (const message of [this.head.welcome, this.head.view, this.timeline]) this.onMessage(message);
    this.play(true);
    void this.decode();
  }

  override send(message: Inbound): void {
    (this.does[message.kind] as ((message: Inbound) => void) | undefined)?.(message);
  }

  /** The frame whose time has come, after those that brought parts which it needs. */
  override take(): Frame[] {
    this.advance();
    const k = Math.min(Math.floor(this.at), this.frames.length - 1);
    if (k === this.seen || k < 0) return [];
    const needed = new Set<number>();
    for (const [name, carrier] of this.carriers[k]) if (this.shown.get(name) !== carrier) needed.add(carrier);
    this.seen = k;
    this.shown = this.carriers[k];
    this.received += 1;
    return [...[...needed].filter((carrier) => carrier !== k).sort((a, b) => a - b), k].map((each) => this.frames[each]);
  }

  private advance(): void {
    const now = performance.now();
    const ready = this.frames.length - 1;
    if (this.playing && ready >= 0) {
      const { loop, first, last, frames } = this.timeline;
      const before = this.at;
      this.at += ((now - this.since) / 1000) * this.head.welcome.fps * this.speed;
      // A page that draws slowly goes past several frames at once: what it goes too far counts in the next round.
      if (loop && before <= last + 1 && this.at >= last + 1) this.at = first + ((this.at - first) % (last + 1 - first));
      this.at = Math.min(this.at, loop && ready >= last ? ready + 0.999 : ready);
      if (this.at >= frames - 1 && !loop) this.play(false);
    }
    this.since = now;
  }

  private seek(frame: number): void {
    this.at = Math.min(Math.max(frame, 0), this.timeline.frames - 1);
  }

  private play(on: boolean): void {
    this.playing = on;
    this.onMessage({ kind: "status", playing: on, speed: this.speed, undo: false, redo: false });
  }

  private async decode(): Promise<void> {
    let parts = new Map<string, number>();
    for (const element of document.querySelectorAll("script.frames")) {
      const packed = Uint8Array.from(atob(element.textContent!), (letter) => letter.charCodeAt(0));
      element.remove();
      const data = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
      const view = new DataView(data);
      for (let begin = 0; begin < data.byteLength; ) {
        const length = view.getUint32(begin, true);
        const frame = new Frame(data.slice(begin + 4, begin + 4 + length));
        begin += 4 + length;
        const last = parts;
        parts = new Map();
        for (const { name, part } of frame.head.items) parts.set(name, part ? this.frames.length : last.get(name)!);
        this.frames.push(frame);
        this.carriers.push(parts);
      }
    }
  }
}
