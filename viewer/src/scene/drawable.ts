// What draws one drawable of the frames: made for a kind of part, given each part that is new, and the normals of each frame.

import type * as THREE from "three";
import type { Frame } from "../frame";
import type { Block, Part } from "../messages";
import type { Theme } from "../theme";
import type { Places } from "./places";

export interface Drawable<P extends Part = Part> {
  readonly object: THREE.Object3D;
  update(part: P, frame: Frame): void;
  bend?(normals: Block, frame: Frame): void;
  dispose(): void;
}

/** `shared`: the places of the frame's particles; a part that brings its own ignores them. */
export type Maker<P extends Part = Part> = (part: P, shared: Places, theme: Theme) => Drawable<P>;
