// The timeline of a cache or a film: any of its frames, a range that is played again and again, and from where a simulation goes on.

import { addButton } from "./button";
import type { Connection } from "./connection";
import type { Frame } from "./frame";
import type { Timeline as Message } from "./messages";

export class Timeline {
  private readonly scrub = document.createElement("input");
  private readonly place = document.createElement("output");
  private readonly loop: HTMLButtonElement;
  private readonly resume: HTMLButtonElement;
  private state: Message | null = null;
  private at = 0; // the frame that is seen
  private first: number | null = null; // where a loop will begin, once its end is set
  private wanted: number | null = null; // asked for, and not sent yet

  constructor(
    private readonly bar: HTMLElement,
    private readonly connection: Connection,
  ) {
    bar.hidden = true;
    this.scrub.type = "range";
    this.scrub.min = "0";
    this.scrub.ariaLabel = "Frame";
    this.scrub.addEventListener("input", () => this.seek(Number(this.scrub.value)));
    this.scrub.addEventListener("pointerup", () => this.scrub.blur()); // the page's keys are heard again
    const button = (text: string, label: string, action: () => void) => addButton(bar, text, label, action);
    const track = document.createElement("div"), looped = document.createElement("i");
    track.append(this.scrub, looped);
    bar.append(track, this.place);
    button("⟦", "Loop from here (I)", () => this.from());
    button("⟧", "Loop to here (O)", () => this.to());
    this.loop = button("↻", "Loop, or not (L)", () => this.toggle());
    this.resume = button("go on", "Let the simulation go on from this frame (G)", () => this.goOn());
  }

  show(message: Message): void {
    this.state = message;
    this.bar.hidden = false;
    this.scrub.max = String(message.frames - 1);
    this.loop.ariaPressed = String(message.loop);
    this.resume.hidden = !message.resumable;
    this.resume.disabled = message.computing >= 0 || message.live;
    this.resume.textContent = message.computing >= 0 ? `${message.computed} of ${message.computing + 1}` : message.live ? "live" : "go on";
    this.bar.style.setProperty("--first", String(this.share(message.loop ? message.first : 0)));
    this.bar.style.setProperty("--last", String(this.share(message.loop ? message.last : message.frames - 1)));
    this.bar.dataset.loop = String(message.loop);
    this.count(this.at);
  }

  /** After each picture: which frame it shows; and what was scrubbed to meanwhile. */
  update(frame: Frame | null): void {
    if (!this.state) return;
    if (this.wanted !== null) {
      this.connection.send({ kind: "seek", frame: this.wanted });
      this.wanted = null;
    } else if (frame && frame.head.number !== this.at) this.count(frame.head.number);
  }

  /** Some frames on, or back. */
  move(by: number): void {
    if (this.state) this.seek(this.at + by);
  }

  seek(frame: number): void {
    if (!this.state) return;
    this.wanted = Math.min(Math.max(frame, 0), this.state.frames - 1);
    this.count(this.wanted);
  }

  end(): void {
    if (this.state) this.seek(this.state.frames - 1);
  }

  from(): void {
    const { state, at } = this;
    if (!state) return;
    this.first = at;
    this.send(true, at, state.loop && state.last > at ? state.last : state.frames - 1);
  }

  to(): void {
    if (this.state) this.send(true, Math.min(this.first ?? (this.state.loop ? this.state.first : 0), this.at), this.at);
  }

  toggle(): void {
    if (this.state) this.send(!this.state.loop, 0, this.state.frames - 1);
  }

  goOn(): void {
    if (this.state?.resumable) this.connection.send({ kind: "resume", frame: Math.min(this.at, this.state.frames - 1) });
  }

  private send(on: boolean, first: number, last: number): void {
    this.connection.send({ kind: "loop", on, first, last: Math.min(last, (this.state?.frames ?? 1) - 1) });
  }

  private share(frame: number): number {
    return frame / Math.max(1, (this.state?.frames ?? 1) - 1);
  }

  private count(frame: number): void {
    this.at = frame;
    this.scrub.value = String(frame);
    const frames = this.state?.frames ?? 0;
    this.place.textContent = this.state?.live ? `${frame} · ${frames} kept` : `${frame + 1} / ${frames}`;
    this.scrub.ariaValueText = `frame ${frame + 1} of ${frames}`;
  }
}
