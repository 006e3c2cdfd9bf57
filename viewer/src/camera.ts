// The camera: it stands where the scene says, and turns around what it looks at.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { View } from "./messages";

export const ROOMY = 900; // a narrower picture has no room for parameters beside it [pixels]
const NARROW = 700; // and one that is narrower has them above and below its middle, as style.css says [pixels]
const ABOVE = 60, BELOW = 84; // what bars take of a wide picture's height [pixels]
const MOST = 0.6; // of the picture's width, or height, that is left to panels and bars; what is behind more than that stays there
const EASE = 4; // rate at which it comes to where it is led [1/s]

export class Camera {
  readonly eye = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
  readonly orbit: OrbitControls;
  private home: View | null = null;
  private readonly aim = new THREE.Vector3();
  private since = 0; // the last picture [ms]
  private wide = 0; // tangent of half the angle to the sides that is shown at least
  private covered = { left: 0, right: 0, top: ABOVE, bottom: BELOW }; // by panels and bars [pixels]
  private led = true; // until the user takes it
  private readonly caster = new THREE.Raycaster();

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.orbit = new OrbitControls(this.eye, canvas);
    this.orbit.enableDamping = true;
    this.orbit.dampingFactor = 0.12;
    this.orbit.zoomToCursor = true;
    this.orbit.addEventListener("start", () => (this.led = false));
  }

  get middle(): THREE.Vector3 {
    return this.orbit.target;
  }

  /** From the eye to what it looks at [m]. */
  get distance(): number {
    return this.eye.position.distanceTo(this.middle);
  }

  /** Scale of a sprite that is so many pixels large in the picture, from near and far. */
  pixels(count: number): number {
    return (2 * count) / Math.max(1, this.canvas.clientHeight) / this.eye.projectionMatrix.elements[5];
  }

  /** Where a pointer is in the picture, from -1 to 1. */
  toPicture(event: PointerEvent, into: THREE.Vector2): void {
    const box = this.canvas.getBoundingClientRect();
    into.set(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
  }

  /** From the eye through a place in the picture. */
  sight(at: THREE.Vector2): THREE.Ray {
    this.caster.setFromCamera(at, this.eye);
    return this.caster.ray.clone();
  }

  /** The plane through the middle that is parallel to the picture. */
  plane(): THREE.Plane {
    return new THREE.Plane().setFromNormalAndCoplanarPoint(this.eye.getWorldDirection(new THREE.Vector3()), this.middle);
  }

  /** The place that the scene gives: the first one is taken at once, later ones smoothly while nobody else leads. */
  setHome(view: View): void {
    const first = this.home === null;
    this.home = view;
    if (first) this.goHome();
  }

  goHome(): void {
    if (!this.home) return;
    this.led = true;
    this.eye.up.set(...this.home.up);
    this.eye.position.set(...this.home.position);
    this.orbit.target.set(...this.home.target);
    this.wide = this.home.wide;
    this.orbit.update();
    this.update();
  }

  /** What lies over the picture: beside its middle, or, where there is no room, above and below it. */
  behind(instruments: DOMRect, opened: boolean, parameters: DOMRect | null): void {
    const { clientWidth, clientHeight } = this.canvas;
    this.covered =
      clientWidth >= NARROW
        ? { left: opened ? instruments.right : 0, right: parameters ? clientWidth - parameters.left : 0, top: ABOVE, bottom: BELOW }
        : { left: 0, right: 0, top: instruments.bottom, bottom: parameters ? clientHeight - parameters.top : BELOW };
  }

  /** Before each picture. */
  update(): void {
    const now = performance.now();
    if (this.home && this.led) {
      const part = 1 - Math.exp((-EASE * (now - this.since)) / 1000);
      this.eye.position.lerp(this.aim.set(...this.home.position), part);
      this.orbit.target.lerp(this.aim.set(...this.home.target), part);
      this.wide += part * (this.home.wide - this.wide);
    }
    this.since = now;
    this.orbit.update();
    const { clientWidth, clientHeight } = this.canvas;
    this.eye.aspect = clientWidth / Math.max(1, clientHeight);
    // What there is to be seen beside the middle is to be in the picture, and not behind panels: a narrow one takes a wider angle.
    const { left, right, top, bottom } = this.covered;
    const free = (pixels: number, all: number) => 1 - Math.min(MOST, pixels / Math.max(1, all));
    const high = Math.tan(THREE.MathUtils.degToRad(this.home?.fov ?? 35) / 2) / free(top + bottom, clientHeight);
    this.eye.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(Math.max(high, this.wide / (this.eye.aspect * free(left + right, clientWidth)))));
    this.eye.near = this.distance / 200;
    this.eye.far = this.distance * 200;
    // The middle of the picture is the middle of what panels leave free.
    this.eye.setViewOffset(clientWidth, clientHeight, (right - left) / 2, (bottom - top) / 2, clientWidth, clientHeight); // updates the projection
    this.eye.updateMatrixWorld();
  }
}
