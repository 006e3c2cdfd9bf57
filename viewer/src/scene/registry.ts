// All that there is to see: one drawable object for each name in the newest frame.

import * as THREE from "three";
import type { Frame } from "../frame";
import type { Block, Item, Part } from "../messages";
import type { Theme } from "../theme";
import { arrows } from "./arrows";
import type { Drawable, Maker } from "./drawable";
import { curves, segments } from "./lines";
import { Places } from "./places";
import { points } from "./points";
import { triangles } from "./triangles";

const MAKERS: { [K in Part["kind"]]: Maker<Extract<Part, { kind: K }>> } = { points, segments, curves, triangles, arrows };

interface Shown {
  drawable: Drawable;
  mark: string; // what is fixed when it is made; another one means another object
  part: Part;
  source: Frame; // of the part
  bent: { normals: Block; source: Frame } | null; // the newest normals, which come without the part
}

export class Registry {
  readonly group = new THREE.Group();
  readonly places = new Places(); // of the particles
  private readonly shown = new Map<string, Shown>();

  constructor(private theme: Theme) {}

  /** Show the last of some frames; parts that only earlier ones brought count, too. */
  show(frames: Frame[]): void {
    const newest = frames[frames.length - 1];
    const parts = new Map<string, { part: Part; source: Frame }>();
    for (const frame of frames) {
      for (const item of frame.head.items) if (item.part) parts.set(item.name, { part: item.part, source: frame });
    }
    this.places.set(newest.head.places, newest);
    for (const item of newest.head.items) this.draw(item, newest, parts.get(item.name));
    const names = new Set(newest.head.items.map((item) => item.name));
    for (const name of [...this.shown.keys()]) if (!names.has(name)) this.drop(name);
  }

  /** Make everything again in another theme. */
  dress(theme: Theme): void {
    this.theme = theme;
    for (const [name, { part, source, bent }] of [...this.shown]) {
      this.drop(name);
      this.update(name, part, source);
      if (bent) this.bend(name, bent.normals, bent.source);
    }
  }

  private draw(item: Item, newest: Frame, fresh: { part: Part; source: Frame } | undefined): void {
    if (fresh) this.update(item.name, fresh.part, fresh.source);
    if (item.normals) this.bend(item.name, item.normals, newest);
  }

  private bend(name: string, normals: Block, source: Frame): void {
    const shown = this.shown.get(name);
    if (!shown) return;
    shown.drawable.bend?.(normals, source);
    shown.bent = { normals, source };
  }

  private update(name: string, part: Part, source: Frame): void {
    const mark = markOf(part);
    let shown = this.shown.get(name);
    if (shown && shown.mark !== mark) this.drop(name);
    shown = this.shown.get(name);
    if (!shown) {
      const make = MAKERS[part.kind] as Maker;
      shown = { drawable: make(part, this.places, this.theme), mark, part, source, bent: null };
      shown.drawable.object.frustumCulled = false;
      this.group.add(shown.drawable.object);
      this.shown.set(name, shown);
    }
    shown.part = part;
    shown.source = source;
    shown.drawable.update(part, source);
  }

  private drop(name: string): void {
    const shown = this.shown.get(name);
    if (!shown) return;
    this.group.remove(shown.drawable.object);
    shown.drawable.dispose();
    this.shown.delete(name);
  }
}

function markOf(part: Part): string {
  const how =
    part.kind === "points" ? [part.glow, part.soft, part.flat, part.daylight]
    : part.kind === "triangles" ? [part.smooth, part.pattern, part.uv === null, Array.isArray(part.color) && part.color[3] < 1]
    : [part.glow];
  return [part.kind, part.places === null, ...how].join();
}
