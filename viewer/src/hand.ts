// What the keys do to particles: pick, pin and join them, add one, shoot a ball, push with a sphere.

import * as THREE from "three";
import type { Camera } from "./camera";
import type { Connection } from "./connection";
import type { Frame } from "./frame";
import type { Grab } from "./grab";
import type { Vector } from "./messages";
import { ring, ringTexture } from "./ring";
import type { Places } from "./scene/places";

const BALL = 0.04, SPEED = 2.5, BEFORE = 0.3; // radius, way in a second, and how far before the eye, by the distance of the camera
const COLORS = [0x4fd1ff, 0x9fb4cc]; // of the rings around the newest that was picked, and the one before
const PIXELS = [30, 24];

export class Hand {
  readonly mark = new THREE.Group();
  pushing = false;
  private moved = false;
  private frame: Frame | null = null;
  private readonly rings: THREE.Sprite[];
  private readonly open = ringTexture();
  private readonly filled = ringTexture(true); // of who is pinned

  constructor(
    canvas: HTMLCanvasElement,
    private readonly camera: Camera,
    private readonly places: Places,
    private readonly grab: Grab,
    private readonly connection: Connection,
  ) {
    this.rings = COLORS.map((color) => ring(color, 9));
    this.mark.add(...this.rings);
    canvas.addEventListener("pointermove", () => (this.moved = true));
  }

  get works(): boolean {
    return this.grab.enabled;
  }

  /** The particle under the cursor; without one, the next in line. */
  pick(): void {
    const row = this.grab.hovered();
    if (row >= 0) this.send(row);
    else if (this.places.count) this.send(((this.frame?.head.picked[0] ?? -1) + 1) % this.places.count);
  }

  pin(): void {
    this.pickHovered();
    this.connection.send({ kind: "pin" });
  }

  join(): void {
    this.pickHovered();
    this.connection.send({ kind: "join" });
  }

  add(): void {
    const place = this.place();
    if (place) this.connection.send({ kind: "add", place });
  }

  shoot(): void {
    const { origin, direction } = this.grab.sight(), far = this.camera.distance;
    const place = origin.clone().addScaledVector(direction, BEFORE * far).toArray();
    const velocity = direction.clone().multiplyScalar(SPEED * far).toArray();
    this.connection.send({ kind: "shoot", place, velocity, radius: BALL * far });
  }

  togglePush(): void {
    this.pushing = !this.pushing;
    if (this.pushing) this.push();
    else this.connection.send({ kind: "clear" });
  }

  /** Once for each picture, with the newest frame. */
  update(frame: Frame | null): void {
    this.frame = frame;
    if (this.pushing && this.moved) this.push();
    this.moved = false;
    const picked = frame?.head.picked ?? [];
    this.rings.forEach((ring, k) => {
      ring.visible = k < picked.length && picked[k] < this.places.count;
      if (!ring.visible) return;
      this.places.at(picked[k], ring.position);
      if (k === 0) ring.material.map = frame!.head.pinned ? this.filled : this.open;
      ring.scale.setScalar(this.camera.pixels(PIXELS[k]));
    });
  }

  private pickHovered(): void {
    const row = this.grab.hovered();
    if (row >= 0 && row !== this.frame?.head.picked[0]) this.send(row);
  }

  private send(row: number): void {
    if (this.frame) this.connection.send({ kind: "pick", sequence: this.frame.sequence, row });
  }

  private push(): void {
    const place = this.place();
    if (place) this.connection.send({ kind: "push", place, radius: BALL * this.camera.distance });
  }

  /** Where the cursor is on the plane through the middle that is parallel to the picture. */
  private place(): Vector | null {
    return this.grab.sight().intersectPlane(this.camera.plane(), new THREE.Vector3())?.toArray() ?? null;
  }
}
