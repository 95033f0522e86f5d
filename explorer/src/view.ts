/** The set in space: two parameters and a height; over one parameter a diagram in the plane. */

import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DoubleSide, DirectionalLight, Mesh, OrthographicCamera,
  PerspectiveCamera, Scene, ShaderMaterial, Vector2, Vector3, WebGLRenderer, type Object3D,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { indexColour, rgb, ROUTE_COLOUR, scaleColour } from "./colours";
import type { EquilibriumSet, Spot } from "./set";
import { LINE_KINDS, sheetOf, spotOf, type LineKind, type Sheet } from "./sheet";
import { h, label, number, ticks } from "./words";

export interface Theme { ink: string; faint: string; paper: string }
export interface Mark { spot: Spot; text: string; colour: string; title: string; kind: string }

const SIDES = [1.2, 1.3];
const TALL = 0.85;
/** Where the set is seen from: from the side, and from above as a map of the parameters. */
const ASIDE = new Vector3(-2.1, 1.6, -3), ABOVE = new Vector3(0.0005, 4, 0.005);
/** Shares of the picture that stay free for labels: at the sides and above, and below. */
const ROOM = 0.14, BELOW = 0.2;

const VERTEX = `
attribute vec3 tint; attribute vec2 grid; varying vec3 vTint; varying vec2 vGrid; varying vec3 vNormal; varying vec3 vEye;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  vTint = tint; vGrid = grid; vNormal = normalMatrix * normal; vEye = -eye.xyz;
  gl_Position = projectionMatrix * eye;
}`;
const FRAGMENT = `
uniform vec3 colour; uniform float own; uniform int hatch; uniform float dots;
varying vec3 vTint; varying vec2 vGrid; varying vec3 vNormal; varying vec3 vEye;
void main() {
  vec3 base = mix(colour, vTint, own);
  vec2 width = fwidth(vGrid) * 0.75, near = abs(fract(vGrid - 0.5) - 0.5);
  float line = 1.0 - min(smoothstep(0.0, width.x, near.x), smoothstep(0.0, width.y, near.y));
  base *= 1.0 - 0.16 * line;
  vec2 at = gl_FragCoord.xy / dots;
  float rising = step(6.2, mod(at.x + at.y, 8.0)), falling = step(6.2, mod(at.x - at.y, 8.0));
  if (hatch == 1) base *= 1.0 - 0.2 * rising;
  if (hatch == 2) base *= 1.0 - 0.2 * max(rising, falling);
  if (hatch > 2) base *= 1.0 - 0.22 * step(length(mod(at, 6.0) - 3.0), 1.2);
  float light = abs(dot(normalize(vNormal), normalize(normalize(vEye) + vec3(-0.25, 0.45, 0.1))));
  gl_FragColor = vec4(base * (0.5 + 0.55 * light), 1.0);
}`;

export class View {
  readonly renderer: WebGLRenderer;
  readonly element: HTMLElement;
  height: number;
  colour: number = -1;
  level: number | null = null;
  sheet!: Sheet;
  private readonly scene = new Scene();
  private readonly camera: PerspectiveCamera | OrthographicCamera;
  readonly controls: OrbitControls;
  private readonly overlay: HTMLElement;
  private parts: Object3D[] = [];
  private overlays: Object3D[] = [];
  private positions = new Float32Array(0);
  private low = 0;
  private high = 1;
  private marks: { mark: Mark; element: HTMLElement }[] = [];
  private labels: HTMLElement[] = [];
  private asked = false;
  private fitted = false;
  private readonly dots: number;
  onFrame: () => void = () => {};

  constructor(readonly set: EquilibriumSet, private theme: Theme) {
    this.height = Math.max(0, set.named(set.words.elevation));
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true });
    const canvas = this.renderer.domElement;
    this.dots = slow(this.renderer) ? 1 : Math.min(2, window.devicePixelRatio);
    this.renderer.setPixelRatio(this.dots);
    canvas.setAttribute("aria-hidden", "true");
    this.overlay = h("div", { class: "overlay" });
    this.element = h("div", { class: "view" }, canvas, this.overlay);
    this.camera = set.d === 1 ? new OrthographicCamera() : new PerspectiveCamera(30, 1, 0.05, 50);
    this.camera.position.copy(set.d === 1 ? new Vector3(0, TALL / 2, 5) : ASIDE);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, set.d === 1 ? TALL / 2 : 0.36, 0);
    this.controls.enableDamping = false;
    if (set.d === 1) this.controls.enableRotate = false;
    this.controls.update();
    this.controls.addEventListener("change", () => this.request());
    const sun = new DirectionalLight(0xffffff, 1);
    this.scene.add(new AmbientLight(0xffffff, 1), sun);
    if (set.d === 3) { const { lower, upper } = set.words.parameters[2]; this.level = (lower + upper) / 2; }
    this.rebuild();
  }

  setTheme(theme: Theme): void { this.theme = theme; this.rebuild(); }

  /** Where a state is drawn. */
  position(spot: Spot): [number, number, number] {
    return this.point(this.set.parameters(spot), this.set.scalar(this.height, spot));
  }

  private point(p: number[], value: number): [number, number, number] {
    const share = (a: number) => (p[a] - this.set.words.parameters[a].lower) / (this.set.words.parameters[a].upper - this.set.words.parameters[a].lower);
    const y = (TALL * (value - this.low)) / (this.high - this.low || 1);
    return [(share(0) - 0.5) * SIDES[0], y, this.set.d === 1 ? 0 : (0.5 - share(1)) * SIDES[1]];
  }

  // --- drawing ----------------------------------------------------------------------------------

  /** Draw anew what depends on the height, the colour or the slice. */
  rebuild(): void {
    for (const part of this.parts) { this.scene.remove(part); (part as Mesh).geometry.dispose(); }
    this.parts = [];
    const set = this.set;
    this.sheet = sheetOf(set, this.level);
    [this.low, this.high] = this.range(this.height);
    const { a, b, share } = this.sheet, count = a.length;
    const value = (number: number, i: number) => (1 - share[i]) * set.scalarAt(number, a[i]) + share[i] * set.scalarAt(number, b[i]);
    const axis = (k: number, i: number) => (1 - share[i]) * set.place(a[i], k) + share[i] * set.place(b[i], k);
    this.positions = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) this.positions.set(this.point([axis(0, i), set.d > 1 ? axis(1, i) : 0], value(this.height, i)), 3 * i);
    if (this.sheet.corners === 3) this.addSurface(value, axis);
    else this.addDiagram();
    for (const kind of LINE_KINDS) this.addLines(kind);
    this.addFrame();
    this.request();
  }

  private range(scalar: number): [number, number] {
    let low = Infinity, high = -Infinity;
    for (let v = 0; v < this.set.vertices; v++) { const x = this.set.scalarAt(scalar, v); low = Math.min(low, x); high = Math.max(high, x); }
    if (high - low < 1e-12 * Math.max(1, Math.abs(low))) { low -= 0.5; high += 0.5; }
    return [low, high];
  }

  /** Least and greatest value of the scale of colours: the middle 96 percent, which outliers do not stretch. */
  colourRange(): [number, number] {
    const values = Float64Array.from({ length: this.set.vertices }, (_, v) => this.set.scalarAt(this.colour, v)).sort();
    const at = (share: number) => values[Math.floor(share * (values.length - 1))];
    return [at(0.02), at(0.98)];
  }

  private addSurface(value: (s: number, i: number) => number, axis: (k: number, i: number) => number): void {
    const { simplices, cell, a } = this.sheet, count = a.length, set = this.set;
    const tint = new Float32Array(3 * count), grid = new Float32Array(2 * count);
    const [least, most] = this.colour >= 0 ? this.colourRange() : [0, 1];
    const steps = [0, 1].map((k) => { const t = ticks(set.words.parameters[k].lower, set.words.parameters[k].upper, 10); return t[1] - t[0]; });
    for (let i = 0; i < count; i++) {
      if (this.colour >= 0) tint.set(scaleColour((value(this.colour, i) - least) / (most - least || 1)), 3 * i);
      grid.set([axis(0, i) / steps[0], axis(1, i) / steps[1]], 2 * i);
    }
    const groups = new Map<number, number[]>();
    for (let t = 0; t < cell.length; t++) {
      const index = Math.min(3, set.cellIndex[cell[t]]);
      let group = groups.get(index);
      if (!group) groups.set(index, (group = []));
      group.push(simplices[3 * t], simplices[3 * t + 1], simplices[3 * t + 2]);
    }
    const position = new BufferAttribute(this.positions, 3);
    const normal = new BufferAttribute(normals(this.positions, simplices, (i) => set.cellIndex[cell[i]] % 2 === 1), 3);
    for (const [index, corners] of groups) {
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", position);
      geometry.setAttribute("normal", normal);
      geometry.setAttribute("tint", new BufferAttribute(tint, 3));
      geometry.setAttribute("grid", new BufferAttribute(grid, 2));
      geometry.setIndex(new BufferAttribute(Uint32Array.from(corners), 1));
      const material = new ShaderMaterial({
        vertexShader: VERTEX, fragmentShader: FRAGMENT, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: 1.5, polygonOffsetUnits: 2,
        uniforms: { colour: { value: new Vector3(...rgb(indexColour(index))) }, own: { value: this.colour >= 0 ? 1 : 0 }, hatch: { value: index }, dots: { value: this.dots } },
      });
      this.add(new Mesh(geometry, material));
    }
  }

  /** Segments over one parameter: stable ones full and bold, the others dashed. */
  private addDiagram(): void {
    const { simplices, cell } = this.sheet, groups = new Map<number, number[]>();
    for (let t = 0; t < cell.length; t++) {
      const index = Math.min(3, this.set.cellIndex[cell[t]]);
      groups.set(index, [...(groups.get(index) ?? []), simplices[2 * t], simplices[2 * t + 1]]);
    }
    for (const [index, ends] of groups) {
      const dark = index > 1 ? this.theme.faint : indexColour(index);
      this.segments(ends, index === 0 ? 3.2 : 2, index === 0 ? indexColour(0) : dark, index ? 0.03 / index : 0);
    }
  }

  private addLines(kind: LineKind): void {
    if (this.sheet.corners === 2) return;
    const look: Record<LineKind, [number, string, number]> = {
      stability: [2.6, this.theme.ink, 0], fold: [1.2, this.theme.ink, 0], crossing: [1.8, this.theme.ink, 0.025],
      constraint: [1.6, "#8a5a00", 0.012], box: [0.8, this.theme.faint, 0],
    };
    const [width, colour, dash] = look[kind];
    this.segments(this.sheet.lines[kind], width, colour, dash);
  }

  private segments(ends: ArrayLike<number>, width: number, colour: string, dash: number): void {
    const places = new Float32Array(3 * ends.length);
    for (let i = 0; i < ends.length; i++) for (let c = 0; c < 3; c++) places[3 * i + c] = this.positions[3 * ends[i] + c];
    this.add(this.polyline(places, width, colour, dash));
  }

  private polyline(places: Float32Array, width: number, colour: string, dash: number): LineSegments2 {
    const geometry = new LineSegmentsGeometry();
    geometry.setPositions(places);
    const material = new LineMaterial({ color: new Color(colour), linewidth: width * this.dots, dashed: dash > 0, dashSize: dash, gapSize: 0.6 * dash });
    const size = this.renderer.getSize(new Vector2()).multiplyScalar(this.dots);
    material.resolution.copy(size);
    const lines = new LineSegments2(geometry, material);
    if (dash > 0) lines.computeLineDistances();
    return lines;
  }

  private add(part: Object3D): void { this.parts.push(part); this.scene.add(part); }

  /** Edges of the box of parameters and heights. */
  private addFrame(): void {
    const [x, z] = [SIDES[0] / 2, this.set.d === 1 ? 0 : SIDES[1] / 2], out: number[] = [];
    const corners = this.set.d === 1 ? [[-x, 0], [x, 0]] : [[-x, -z], [x, -z], [x, z], [-x, z]];
    corners.forEach(([cx, cz], i) => {
      const [nx, nz] = corners[(i + 1) % corners.length];
      for (const y of [0, TALL]) out.push(cx, y, cz, nx, y, nz);
      out.push(cx, 0, cz, cx, TALL, cz);
    });
    this.add(this.polyline(Float32Array.from(out), 0.6, this.theme.faint, 0));
  }

  /** Replace the routes, barriers and drawn ways: polylines of states in order, null between two. */
  setOverlays(lines: { spots: (Spot | null)[]; width: number; colour?: string; dash?: number }[]): void {
    for (const part of this.overlays) { this.scene.remove(part); (part as Mesh).geometry.dispose(); }
    this.overlays = lines.map(({ spots, width, colour, dash }) => {
      const out: number[] = [];
      for (let k = 1; k < spots.length; k++) {
        const [from, to] = [spots[k - 1], spots[k]];
        if (from && to) out.push(...this.lifted(from), ...this.lifted(to));
      }
      const line = this.polyline(Float32Array.from(out), width, colour ?? ROUTE_COLOUR, dash ?? 0);
      line.renderOrder = 2;
      return line;
    });
    for (const part of this.overlays) this.scene.add(part);
    this.request();
  }

  /** Over the middle of a slice, routes at other values of the third parameter are drawn as they are. */
  private lifted(spot: Spot): [number, number, number] { return this.position(spot); }

  setMarks(marks: Mark[]): void {
    for (const { element } of this.marks) element.remove();
    this.marks = marks.map((mark) => {
      const element = h("span", { class: `mark ${mark.kind}`, title: mark.title, style: `--mark: ${mark.colour}` }, mark.text);
      this.overlay.append(element);
      return { mark, element };
    });
    this.request();
  }

  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    if (this.camera instanceof OrthographicCamera) {
      const half = Math.max(0.56, (0.76 * height) / width), across = (half * width) / height;
      Object.assign(this.camera, { left: -across, right: across, top: half, bottom: -half });
    } else {
      this.camera.aspect = width / height;
      // the whole box stays in sight in narrow windows
      this.camera.fov = width >= height ? 30 : 2 * (180 / Math.PI) * Math.atan(Math.tan((15 * Math.PI) / 180) * (height / width));
    }
    this.camera.updateProjectionMatrix();
    for (const part of [...this.parts, ...this.overlays]) {
      const material = (part as LineSegments2).material as LineMaterial;
      if (material.isLineMaterial) material.resolution.set(width * this.dots, height * this.dots);
    }
    if (!this.fitted) { this.fitted = true; this.fit(); }
    this.request();
  }

  request(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.draw());
  }

  /** Draw now. */
  draw(): void {
    this.asked = false;
    this.camera.updateMatrixWorld();
    this.renderer.render(this.scene, this.camera);
    this.placeLabels();
    for (const { mark, element } of this.marks) place(element, this.project(this.position(mark.spot)));
    this.onFrame();
  }

  /** Pixels of a drawn place. */
  project(at: [number, number, number]): [number, number] {
    const v = new Vector3(...at).project(this.camera), { clientWidth, clientHeight } = this.element;
    return [((v.x + 1) / 2) * clientWidth, ((1 - v.y) / 2) * clientHeight];
  }

  private placeLabels(): void {
    for (const each of this.labels) each.remove();
    this.labels = [];
    const set = this.set, [x, z] = [SIDES[0] / 2, set.d === 1 ? 0 : SIDES[1] / 2];
    const eye = this.camera.position, front = eye.z >= 0 ? z : -z, right = eye.x >= 0 ? x : -x;
    const above = set.d > 1 && eye.y > 3.5 * Math.hypot(eye.x, eye.z);
    const [one, two] = set.words.parameters;
    this.axis(one.name, one.unit, one.lower, one.upper, (t) => [(t - 0.5) * SIDES[0], 0, front]);
    if (two) this.axis(two.name, two.unit, two.lower, two.upper, (t) => [right, 0, (0.5 - t) * SIDES[1]]);
    if (above) return;
    const scalar = set.words.scalars[this.height];
    const edges = set.d === 1 ? [[-x, 0]] : [[-x, -z], [x, -z], [x, z], [-x, z]];
    const [cx, cz] = edges.reduce((best, each) => this.project([each[0], 0, each[1]])[0] < this.project([best[0], 0, best[1]])[0] ? each : best);
    this.axis(scalar.symbol, scalar.unit, this.low, this.high, (t) => [cx, t * TALL, cz]);
  }

  /** Ticks and name of an axis, on the side of its edge that is away from the middle of the box. */
  private axis(name: string, unit: string, low: number, high: number, at: (share: number) => [number, number, number]): void {
    const start = this.project(at(0)), end = this.project(at(1)), long = Math.hypot(end[0] - start[0], end[1] - start[1]);
    if (long < 60) return;
    const middle = this.project([0, TALL / 2, 0]), half = this.project(at(0.5));
    let away = [(end[1] - start[1]) / long, (start[0] - end[0]) / long];
    if (away[0] * (half[0] - middle[0]) + away[1] * (half[1] - middle[1]) < 0) away = [-away[0], -away[1]];
    for (const tick of ticks(low, high, Math.max(2, Math.min(6, Math.floor(long / 55))))) {
      const [px, py] = this.project(at((tick - low) / (high - low)));
      this.addLabel(number(tick), [px + 17 * away[0], py + 13 * away[1]], "tick");
    }
    const upright = Math.abs(end[1] - start[1]) > 2 * Math.abs(end[0] - start[0]), words = label(name, unit);
    const far = upright ? 48 : 36 + 3 * words.length * Math.abs(away[0]);
    this.addLabel(words, [half[0] + far * away[0], half[1] + far * away[1]], upright ? "axis upright" : "axis");
  }

  private addLabel(text: string, at: [number, number], kind: string): void {
    const element = h("span", { class: `label ${kind}`, "aria-hidden": "true" }, text), half = kind === "axis" ? 4 * text.length : 10;
    // names stay inside narrow pictures
    place(element, [Math.max(half, Math.min(this.element.clientWidth - half, at[0])), at[1]]);
    this.overlay.append(element);
    this.labels.push(element);
  }

  /** Look from above (a map of the parameters) or from the side. */
  look(above: boolean): void {
    this.camera.position.copy(above ? ABOVE : ASIDE);
    this.controls.target.set(0, TALL / 2, 0);
    this.controls.update();
    this.fit();
    this.request();
  }

  /** Move the camera so that the box fills the picture, with room for labels. */
  private fit(): void {
    if (!(this.camera instanceof PerspectiveCamera)) return;
    const [x, z] = [SIDES[0] / 2, SIDES[1] / 2];
    for (let pass = 0; pass < 6; pass++) {
      this.camera.updateMatrixWorld();
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => new Vector3(k & 1 ? x : -x, k & 2 ? TALL : 0, k & 4 ? z : -z).project(this.camera));
      const [left, right] = [Math.min(...corners.map((c) => c.x)), Math.max(...corners.map((c) => c.x))];
      const [low, high] = [Math.min(...corners.map((c) => c.y)), Math.max(...corners.map((c) => c.y))];
      const scale = Math.max((right - left) / (2 - 2 * ROOM), (high - low) / (2 - ROOM - BELOW));
      const away = this.camera.position.clone().sub(this.controls.target), tall = away.length() * Math.tan((this.camera.fov * Math.PI) / 360);
      const shift = new Vector3(((left + right) / 2) * tall * this.camera.aspect, ((low + high + ROOM - BELOW) / 2) * tall, 0).applyQuaternion(this.camera.quaternion);
      this.controls.target.add(shift);
      this.camera.position.copy(this.controls.target).add(away.multiplyScalar(scale));
      this.controls.update();
    }
  }

  turn(right: number, up: number): void {
    const at = this.camera.position.clone().sub(this.controls.target), r = at.length();
    const polar = Math.min(Math.PI - 0.05, Math.max(0.02, Math.acos(at.y / r) - up)), azimuth = Math.atan2(at.x, at.z) + right;
    at.set(r * Math.sin(polar) * Math.sin(azimuth), r * Math.cos(polar), r * Math.sin(polar) * Math.cos(azimuth));
    this.camera.position.copy(at.add(this.controls.target));
    this.controls.update();
    this.request();
  }

  zoom(factor: number): void {
    if (this.camera instanceof OrthographicCamera) { this.camera.zoom *= factor; this.camera.updateProjectionMatrix(); }
    else this.camera.position.sub(this.controls.target).divideScalar(factor).add(this.controls.target);
    this.controls.update();
    this.request();
  }

  get cameraText(): string {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray(), this.camera.zoom].map((x) => Number(x.toFixed(3))).join(",");
  }
  set cameraText(text: string) {
    const [x, y, z, tx, ty, tz, zoom] = text.split(",").map(Number);
    if (![x, y, z, tx, ty, tz, zoom].every(Number.isFinite)) return;
    this.resize();
    this.camera.position.set(x, y, z);
    this.controls.target.set(tx, ty, tz);
    this.camera.zoom = zoom;
    this.camera.updateProjectionMatrix();
    this.controls.update();
  }

  // --- picking ----------------------------------------------------------------------------------

  /** State under a pixel of the element; null where there is none. */
  pick(x: number, y: number): Spot | null {
    return this.sheet.corners === 2 ? this.pickSegment(x, y) : this.pickTriangle(x, y);
  }

  private pickTriangle(x: number, y: number): Spot | null {
    const { clientWidth, clientHeight } = this.element;
    const near = new Vector3((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight, -1).unproject(this.camera);
    const far = new Vector3((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight, 1).unproject(this.camera);
    const hit = firstHit(this.positions, this.sheet.simplices, near.toArray(), far.sub(near).toArray());
    return hit && spotOf(this.set, this.sheet, hit.triangle, hit.weights);
  }

  private pickSegment(x: number, y: number): Spot | null {
    const { simplices } = this.sheet;
    let best: Spot | null = null, least = 18;
    for (let t = 0; t < simplices.length / 2; t++) {
      const [a, b] = [0, 1].map((k) => this.project(Array.from(this.positions.subarray(3 * simplices[2 * t + k], 3 * simplices[2 * t + k] + 3)) as [number, number, number]));
      const long = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2;
      const share = Math.min(1, Math.max(0, ((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / (long || 1)));
      const gap = Math.hypot(a[0] + share * (b[0] - a[0]) - x, a[1] + share * (b[1] - a[1]) - y);
      if (gap < least) { least = gap; best = spotOf(this.set, this.sheet, t, [1 - share, share]); }
    }
    return best;
  }

  /** Change of the first parameters that moves a state on its sheet by some pixels, at most. */
  stepFor(spot: Spot, dx: number, dy: number): number[] {
    const set = this.set, axes = Math.min(2, set.d), here = this.project(this.position(spot)), p = set.parameters(spot);
    const columns: { axis: number; move: number[] }[] = [];
    for (let axis = 0; axis < axes; axis++) {
      const { lower, upper } = set.words.parameters[axis];
      for (const sign of [1, -1]) {
        const size = sign * 2e-3 * (upper - lower), end = set.walk(spot, p.map((v, a) => (a === axis ? v + size : v)));
        if (end.share < 0.05) continue;
        const there = this.project(this.position(end.spot)), scale = 1 / (size * end.share);
        columns.push({ axis, move: [(there[0] - here[0]) * scale, (there[1] - here[1]) * scale] });
        break;
      }
    }
    const out = p.map(() => 0), width = (axis: number) => set.words.parameters[axis].upper - set.words.parameters[axis].lower;
    // least squares in shares of the box, damped where the sheet is seen edge-on
    const rows = columns.map(({ axis, move }) => move.map((m) => m * width(axis)));
    const damp = 25;
    if (rows.length === 1) {
      const [m] = rows;
      out[columns[0].axis] = (width(columns[0].axis) * (m[0] * dx + m[1] * dy)) / (m[0] ** 2 + m[1] ** 2 + damp);
    } else if (rows.length === 2) {
      const [m, n] = rows, aa = m[0] ** 2 + m[1] ** 2 + damp, bb = n[0] ** 2 + n[1] ** 2 + damp, ab = m[0] * n[0] + m[1] * n[1];
      const f = m[0] * dx + m[1] * dy, g = n[0] * dx + n[1] * dy, det = aa * bb - ab * ab;
      out[columns[0].axis] = (width(columns[0].axis) * (f * bb - g * ab)) / det;
      out[columns[1].axis] = (width(columns[1].axis) * (g * aa - f * ab)) / det;
    }
    return out;
  }
}

/** Whether a program draws instead of a graphics processor. */
function slow(renderer: WebGLRenderer): boolean {
  const gl = renderer.getContext(), info = gl.getExtension("WEBGL_debug_renderer_info");
  return /swiftshader|llvmpipe|software/i.test(info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "");
}

function place(element: HTMLElement, [x, y]: [number, number]): void { element.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`; }

/** Normals at points: of the triangles around them, by their areas; over the parameters sheets turn over with their index. */
function normals(x: Float32Array, t: Int32Array, odd: (triangle: number) => boolean): Float32Array {
  const out = new Float32Array(x.length);
  for (let i = 0; i < t.length; i += 3) {
    const [a, b, c] = [3 * t[i], 3 * t[i + 1], 3 * t[i + 2]];
    const [ux, uy, uz] = [x[b] - x[a], x[b + 1] - x[a + 1], x[b + 2] - x[a + 2]], [vx, vy, vz] = [x[c] - x[a], x[c + 1] - x[a + 1], x[c + 2] - x[a + 2]];
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const side = n[1] < 0 === odd(i / 3) ? 1 : -1;
    for (const k of [a, b, c]) for (let j = 0; j < 3; j++) out[k + j] += side * n[j];
  }
  return out;
}

/** Nearest triangle on a ray, with the weights of its corners. */
function firstHit(x: Float32Array, t: Int32Array, o: number[], d: number[]): { triangle: number; weights: number[] } | null {
  let best = Infinity, found: { triangle: number; weights: number[] } | null = null;
  const [ox, oy, oz] = o, [dx, dy, dz] = d;
  for (let i = 0; i < t.length; i += 3) {
    const a = 3 * t[i], b = 3 * t[i + 1], c = 3 * t[i + 2];
    const ux = x[b] - x[a], uy = x[b + 1] - x[a + 1], uz = x[b + 2] - x[a + 2], vx = x[c] - x[a], vy = x[c + 1] - x[a + 1], vz = x[c + 2] - x[a + 2];
    const px = dy * vz - dz * vy, py = dz * vx - dx * vz, pz = dx * vy - dy * vx, det = ux * px + uy * py + uz * pz;
    if (det === 0) continue;
    const sx = ox - x[a], sy = oy - x[a + 1], sz = oz - x[a + 2], u = (sx * px + sy * py + sz * pz) / det;
    if (u < 0 || u > 1) continue;
    const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux, v = (dx * qx + dy * qy + dz * qz) / det;
    if (v < 0 || u + v > 1) continue;
    const along = (vx * qx + vy * qy + vz * qz) / det;
    if (along > 0 && along < best) { best = along; found = { triangle: i / 3, weights: [1 - u - v, u, v] }; }
  }
  return found;
}
