// The camera: it stands where the scene says, and turns around what it looks at.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { View } from "./messages";

export const ROOMY = 900; // a narrower picture has no room for parameters beside it [pixels]
const LIFTED = 24; // [pixels]
const MOST = 0.6; // of the picture that panels may have before what is behind them stays there
const EASE = 4; // rate at which it comes to where it is led [1/s]

export class Camera {
  readonly eye = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
  readonly orbit: OrbitControls;
  private home: View | null = null;
  private readonly aim = new THREE.Vector3();
  private since = 0; // the last picture [ms]
  private wide = 0; // tangent of half the angle to the sides that is shown at least
  coveredLeft = 0; // by instruments [pixels]
  coveredRight = 0; // by parameters [pixels]
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
    const roomy = clientWidth > ROOMY;
    const free = roomy ? 1 - Math.min(MOST, (this.coveredLeft + this.coveredRight) / clientWidth) : 1;
    const high = Math.tan(THREE.MathUtils.degToRad(this.home?.fov ?? 35) / 2);
    this.eye.fov = 2 * THREE.MathUtils.radToDeg(Math.atan(Math.max(high, this.wide / (this.eye.aspect * free))));
    this.eye.near = this.distance / 200;
    this.eye.far = this.distance * 200;
    // On a wide screen the middle of the picture is the middle of what panels leave free.
    const aside = roomy ? (this.coveredRight - this.coveredLeft) / 2 : 0;
    this.eye.setViewOffset(clientWidth, clientHeight, aside, LIFTED, clientWidth, clientHeight); // updates the projection
    this.eye.updateMatrixWorld();
  }
}
