// Made by: python -m pointmass.viewer.typescript > viewer/src/messages.ts

export type Vector = [number, number, number];
export type Color = [number, number, number, number];
export type Value = boolean | number | string;

/** The page has drawn a frame; so many more may come. */
export interface Ack {
  kind: "ack";
  sequence: number;
}

/** Run, or stop for a while. */
export interface Play {
  kind: "play";
  on: boolean;
}

/** One frame, and stop. */
export interface Step {
  kind: "step";
}

/** Begin again, with the parameters as they are. */
export interface Reset {
  kind: "reset";
}

/** Simulated seconds for a second on the clock. */
export interface Speed {
  kind: "speed";
  factor: number;
}

/** A parameter of the scene. */
export interface Change {
  kind: "change";
  name: string;
  value: Value;
}

/** A preset of the scene; "" = all parameters at their defaults. */
export interface Choose {
  kind: "choose";
  preset: string;
}

/** Take the particle in a row of a frame, and draw it to a place. */
export interface Grab {
  kind: "grab";
  sequence: number;
  row: number;
  target: Vector;
}

/** Draw the particle that was grabbed to another place. */
export interface Drag {
  kind: "drag";
  target: Vector;
}

/** Let it go. */
export interface Release {
  kind: "release";
}

/** Show a frame of a cache, counted from 0. */
export interface Seek {
  kind: "seek";
  frame: number;
}

/** Play these frames of a cache again and again, both ends included; off: all of them, once. */
export interface Loop {
  kind: "loop";
  on: boolean;
  first: number;
  last: number;
}

/** Let the simulation go on from a frame of a cache. */
export interface Resume {
  kind: "resume";
  frame: number;
}

/** Another solver, by its name, with steps of dt [s]; "" and 0 = those of the scene. */
export interface SetSolver {
  kind: "solver";
  name: string;
  dt: number;
}

/** Switch a force or collider on or off, by its place. */
export interface SetSwitch {
  kind: "switch";
  name: string;
  on: boolean;
}

/** Another direction of the wind. */
export interface SetWind {
  kind: "wind";
  direction: Vector;
}

/** Take the last change of settings back. */
export interface Undo {
  kind: "undo";
}

/** Make the change that was taken back. */
export interface Redo {
  kind: "redo";
}

/** Pick the particle in a row of a frame; the last two that were picked can be joined. */
export interface Pick {
  kind: "pick";
  sequence: number;
  row: number;
}

/** Pin the particle that was picked last, or let it go if it is pinned. */
export interface PinPicked {
  kind: "pin";
}

/** Put a spring between the two particles that were picked last. */
export interface JoinPicked {
  kind: "join";
}

/** Put a particle at a place [m]. */
export interface AddParticle {
  kind: "add";
  place: Vector;
}

/** Shoot a ball of a radius [m] from a place [m] with a velocity [m/s]. */
export interface ShootBall {
  kind: "shoot";
  place: Vector;
  velocity: Vector;
  radius: number;
}

/** Push with a sphere of a radius [m], that comes to a place [m]. */
export interface PushAt {
  kind: "push";
  place: Vector;
  radius: number;
}

/** Take ball and sphere away. */
export interface Clear {
  kind: "clear";
}

/** Plot an expression over the particles from now on, such as "mean(y)"; or no longer. */
export interface Plot {
  kind: "plot";
  text: string;
  on: boolean;
}

/** Look at the particle in a row of a frame: its numbers, its springs. */
export interface Inspect {
  kind: "inspect";
  sequence: number;
  row: number;
}

/** Look at no particle. */
export interface Dismiss {
  kind: "dismiss";
}

/** Colour by a quantity, one of `Instruments.lenses`; "" = as the scene says. */
export interface Lens {
  kind: "lens";
  name: string;
}

/** Show arrows or streamlines, one of `Instruments.vectors`, or no longer. */
export interface Vectors {
  kind: "vectors";
  name: string;
  on: boolean;
}

/** Begin an integral curve of the field at a place [m], by each solver that is chosen. */
export interface StartCurve {
  kind: "curve";
  place: Vector;
}

/** Draw integral curves by a solver, one of `Instruments.curves`, or no longer. */
export interface ChooseCurveSolver {
  kind: "curve_solver";
  name: string;
  on: boolean;
}

/** Integral curves in steps of dt, for a time span [s]. */
export interface SetCurveStep {
  kind: "curve_step";
  dt: number;
  span: number;
}

/** Take the integral curves away. */
export interface ClearCurves {
  kind: "clear_curves";
}

/** Those who are in a duel: one beside the other, or all in one place. */
export interface Arrange {
  kind: "arrange";
  beside: boolean;
}

/** A parameter of the scene, as the scene declares it, and its value now. */
export interface Parameter {
  name: string;
  summary: string;
  unit: string;
  value: Value;
  minimum: number | null;
  maximum: number | null;
  whole: boolean;
  choices: string[];
}

/** A force or collider: its place, such as "forces.1", what people call it, and whether it acts. */
export interface Switch {
  name: string;
  label: string;
  on: boolean;
}

/** Where the camera stands until the user moves it [m], its vertical angle of view [degrees], and the tangent of */
export interface View {
  kind: "view";
  position: Vector;
  target: Vector;
  up: Vector;
  fov: number;
  wide: number;
}

/** What is looked at; the first message, and again when parameters were changed by somebody. */
export interface Welcome {
  kind: "welcome";
  name: string;
  summary: string;
  parameters: Parameter[];
  presets: string[];
  fps: number;
  grabs: boolean;
  frames: number | null;
  solver: string;
  dt: number;
  solvers: string[];
  switches: Switch[];
  wind: Vector | null;
}

/** How it runs, and whether changes of settings can be undone and redone. */
export interface Status {
  kind: "status";
  playing: boolean;
  speed: number;
  undo: boolean;
  redo: boolean;
}

/** The largest step with which the solver amplifies no motion now [s]; None = any, 0 = not known. */
export interface Advice {
  kind: "advice";
  solver: string;
  largest: number | null;
}

/** A sentence for the user; "" takes the last one away. */
export interface Note {
  kind: "note";
  level: "info" | "error";
  text: string;
}

/** The frames that there are; only caches and films have one. */
export interface Timeline {
  kind: "timeline";
  frames: number;
  loop: boolean;
  first: number;
  last: number;
  resumable: boolean;
  live: boolean;
  computing: number;
  computed: number;
}

/** Something that can be shown, by its name; for people: what it is, and its unit. */
export interface Choice {
  name: string;
  title: string;
  unit: string;
}

/** A solver of integral curves: colour (sRGB) and dashes, drawn and left out, and whether it is chosen. */
export interface CurveSolver {
  name: string;
  color: string;
  dash: [number, number];
  on: boolean;
}

/** Integral curves of the field. */
export interface Curves {
  solvers: CurveSolver[];
  dt: number;
  span: number;
  count: number;
  low: Vector;
  high: Vector;
}

/** What is measured and shown beside the scene itself; the same on all pages. */
export interface Instruments {
  kind: "instruments";
  lenses: Choice[];
  lens: string;
  vectors: Choice[];
  shown: string[];
  expressions: string[];
  names: string[];
  curves: Curves | null;
  duel: boolean;
  beside: boolean;
}

/** What a file that plays without a server holds beside its frames. */
export interface FilmHead {
  welcome: Welcome;
  view: View;
  timeline: Timeline;
}

/** An array in the body: where it begins [bytes], how many numbers it has, and of which type. */
export interface Block {
  offset: number;
  count: number;
  type: "i8" | "u8" | "u16" | "u32" | "f32";
}

/** Positions as four u16 for each: x, y, z from 0 to 65535 over a box [m], and 0. */
export interface Places {
  low: Vector;
  size: Vector;
  data: Block;
}

/** RGBA as four u8 for each item: the square root of linear light over `scale`, and alpha. */
export interface Colors {
  scale: number;
  data: Block;
}

/** Particles; see `frame.Points`. Item k is at row `rows[k]` of the places, or at row k. */
export interface PointsPart {
  kind: "points";
  places: Places | null;
  count: number;
  rows: Block | null;
  radius: number | Block;
  color: Color | Colors;
  glow: boolean;
  soft: boolean;
  flat: boolean;
  daylight: number;
}

/** Straight lines between rows of the places, two u32 for each; see `frame.Segments`. */
export interface SegmentsPart {
  kind: "segments";
  places: Places | null;
  pairs: Block;
  width: number | Block;
  color: Color | Colors;
  glow: boolean;
}

/** Polylines, one after another: u32 rows of the places, with 2^31 added where a polyline ends. */
export interface CurvesPart {
  kind: "curves";
  places: Places | null;
  rows: Block;
  width: number | Block;
  color: Color | Colors;
  glow: boolean;
}

/** A mesh; see `frame.Triangles`. */
export interface TrianglesPart {
  kind: "triangles";
  places: Places | null;
  faces: Block;
  color: Color | Colors;
  smooth: boolean;
  normals: Block | null;
  uv: Block | null;
  pattern: number;
  pattern_count: number;
  pattern_color: Vector;
}

/** Arrows from places along vectors [m], three f32 for each; see `frame.Arrows`. */
export interface ArrowsPart {
  kind: "arrows";
  places: Places;
  vectors: Block;
  width: number | Block;
  color: Color | Colors;
  glow: boolean;
}

/** A drawable: its part if it is new to the page, and what changes in every frame. */
export interface Item {
  name: string;
  version: number;
  part: Part | null;
  normals: Block | null;
}

/** A quantity that is plotted: on which plot, its name there, its unit, and whether on a logarithmic scale. */
export interface Column {
  plot: string;
  name: string;
  unit: string;
  log: boolean;
}

/** What was measured since the last frame that the page got. */
export interface TrackRows {
  name: string;
  generation: number;
  columns: Column[];
  data: Block;
}

/** What colours mean: sRGB from `low` to `high`, evenly. */
export interface Legend {
  title: string;
  unit: string;
  low: number;
  high: number;
  colors: string[];
  mark: number | null;
  meaning: string;
}

/** The numbers of the particle that is looked at, in SI units. */
export interface Inspected {
  row: number;
  id: string;
  position: Vector;
  velocity: Vector;
  force: Vector | null;
  mass: number | null;
  age: number | null;
  pinned: boolean;
  springs: number;
}

/** One of those in a duel. */
export interface Contender {
  name: string;
  color: string;
  error: number | null;
  energy: number | null;
  cost: number;
  ended: string;
}

/** How far a solver's newest integral curve ends from the field's own [m]; None if either ends early. */
export interface CurveEnd {
  name: string;
  error: number | null;
}

/** A frame. */
export interface FrameHead {
  number: number;
  time: number;
  count: number;
  cost: number;
  held: number;
  target: Vector;
  picked: number[];
  pinned: boolean;
  quantities: Record<string, number>;
  places: Places;
  items: Item[];
  tracks: TrackRows[];
  legend: Legend | null;
  inspected: Inspected | null;
  duel: Contender[];
  curves: CurveEnd[];
}

export type Inbound = Ack | Play | Step | Reset | Speed | Change | Choose | SetSolver | SetSwitch | SetWind | Undo | Redo | Grab | Drag | Release | Pick | PinPicked | JoinPicked | AddParticle | ShootBall | PushAt | Clear | Seek | Loop | Resume | Plot | Inspect | Dismiss | Lens | Vectors | Arrange | StartCurve | ChooseCurveSolver | SetCurveStep | ClearCurves;

export type Outbound = Welcome | View | Status | Note | Advice | Timeline | Instruments;

export type Part = PointsPart | SegmentsPart | CurvesPart | TrianglesPart | ArrowsPart;

export const FRAME = 1;
