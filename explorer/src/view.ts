/** The set in space: two parameters and a height; over one parameter a diagram in the plane. */

import {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DoubleSide, DirectionalLight, Mesh, Scene, ShaderMaterial, Vector2, Vector3,
  WebGLRenderer, type Object3D,
} from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { indexColour, rgb, ROUTE_COLOUR, scaleColour } from "./colours";
import { Eye, SIDES, TALL } from "./eye";
import type { EquilibriumSet, Spot } from "./set";
import type { Overlay } from "./overlays";
import { FRAGMENT, VERTEX } from "./shaders";
import { inOrder, LINE_KINDS, sheetOf, spotOf, type LineKind, type Sheet } from "./sheet";
import { firstHit, normals } from "./triangles";
import { h, label, number, ticks } from "./words";

export interface Theme { ink: string; faint: string; paper: string }
export interface Mark { spot: Spot; text: string; colour: string; title: string; kind: string }

export class View {
  readonly renderer: WebGLRenderer;
  readonly element: HTMLElement;
  height: number;
  colour: number = -1;
  level: number | null = null;
  sheet!: Sheet;
  private readonly scene = new Scene();
  readonly eye: Eye;
  private readonly overlay: HTMLElement;
  private parts: Object3D[] = [];
  private overlays: Object3D[] = [];
  private positions = new Float32Array(0);
  private wide = 0;
  private tall = 0;
  private low = 0;
  private high = 1;
  private marks: { mark: Mark; element: HTMLElement }[] = [];
  private labels: HTMLElement[] = [];
  private ticks: [number, number][] = [];
  private asked = false;
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
    this.eye = new Eye(canvas, set.d === 1, () => this.request());
    const sun = new DirectionalLight(0xffffff, 1);
    this.scene.add(new AmbientLight(0xffffff, 1), sun);
    if (set.d === 3) { const { lower, upper } = set.words.parameters[2]; this.level = (lower + upper) / 2; }
    this.rebuild();
  }

  setTheme(theme: Theme): void { this.theme = theme; this.rebuild(); }

  /** Where a state is drawn. */
  position(spot: Spot): [number, number, number] {
    return this.point(this.set.parameters(spot), this.set.straight(this.height, spot));
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
    let [low, high] = this.set.range(scalar);
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
      const index = Math.min(2, this.set.cellIndex[cell[t]]);
      groups.set(index, [...(groups.get(index) ?? []), simplices[2 * t], simplices[2 * t + 1]]);
    }
    for (const [index, ends] of groups) this.segments(ends, index ? 2 : 3.2, index > 1 ? this.theme.faint : indexColour(index), index && 0.03 / index);
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
    if (dash > 0) ends = inOrder(ends);
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

  /** Replace the routes, barriers and drawn ways. */
  setOverlays(lines: Overlay[]): void {
    for (const part of this.overlays) { this.scene.remove(part); (part as Mesh).geometry.dispose(); }
    this.overlays = lines.map(({ spots, width, colour, dash }) => {
      const out: number[] = [];
      for (let k = 1; k < spots.length; k++) {
        const [from, to] = [spots[k - 1], spots[k]];
        if (from && to) out.push(...this.position(from), ...this.position(to));
      }
      const line = this.polyline(Float32Array.from(out), width, colour ?? ROUTE_COLOUR, dash ?? 0);
      line.renderOrder = 2;
      return line;
    });
    for (const part of this.overlays) this.scene.add(part);
    this.request();
  }

  setMarks(marks: Mark[]): void {
    for (const { element } of this.marks) element.remove();
    const beside = (spot: Spot) => this.level !== null && Math.abs(this.set.parameters(spot)[2] - this.level) > 1e-6 * this.set.scale[2];
    this.marks = marks.map((mark) => {
      const element = h("span", { class: `mark ${mark.kind}${beside(mark.spot) ? " beside" : ""}`, title: mark.title, style: `--mark: ${mark.colour}` }, mark.text);
      this.overlay.append(element);
      return { mark, element };
    });
    this.request();
  }

  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height || (width === this.wide && height === this.tall)) return;
    [this.wide, this.tall] = [width, height];
    this.renderer.setSize(width, height);
    this.eye.resize(width, height);
    for (const part of [...this.parts, ...this.overlays]) {
      const material = (part as LineSegments2).material as LineMaterial;
      if (material.isLineMaterial) material.resolution.set(width * this.dots, height * this.dots);
    }
    this.request();
  }

  request(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { if (this.asked) this.draw(); });
  }

  /** Draw now. */
  draw(): void {
    this.asked = false;
    this.eye.camera.updateMatrixWorld();
    this.renderer.render(this.scene, this.eye.camera);
    this.placeLabels();
    for (const { mark, element } of this.marks) place(element, this.eye.project(this.position(mark.spot)));
    this.onFrame();
  }

  private placeLabels(): void {
    for (const each of this.labels) each.remove();
    this.labels = [];
    this.ticks = [];
    const set = this.set, [x, z] = [SIDES[0] / 2, set.d === 1 ? 0 : SIDES[1] / 2];
    const eye = this.eye.camera.position, front = eye.z >= 0 ? z : -z, right = eye.x >= 0 ? x : -x;
    const above = set.d > 1 && eye.y > 3.5 * Math.hypot(eye.x, eye.z);
    const [one, two] = set.words.parameters;
    this.axis(one.name, one.unit, one.lower, one.upper, (t) => [(t - 0.5) * SIDES[0], 0, front]);
    if (two) this.axis(two.name, two.unit, two.lower, two.upper, (t) => [right, 0, (0.5 - t) * SIDES[1]]);
    if (above) return;
    const scalar = set.words.scalars[this.height];
    const edges = set.d === 1 ? [[-x, 0]] : [[-x, -z], [x, -z], [x, z], [-x, z]];
    const [cx, cz] = edges.reduce((best, each) => this.eye.project([each[0], 0, each[1]])[0] < this.eye.project([best[0], 0, best[1]])[0] ? each : best);
    this.axis(scalar.symbol, scalar.unit, this.low, this.high, (t) => [cx, t * TALL, cz]);
  }

  /** Ticks and name of an axis, on the side of its edge that is away from the middle of the box. */
  private axis(name: string, unit: string, low: number, high: number, at: (share: number) => [number, number, number]): void {
    const start = this.eye.project(at(0)), end = this.eye.project(at(1)), long = Math.hypot(end[0] - start[0], end[1] - start[1]);
    if (long < 60) return;
    const middle = this.eye.project([0, TALL / 2, 0]), half = this.eye.project(at(0.5));
    let away = [(end[1] - start[1]) / long, (start[0] - end[0]) / long];
    if (away[0] * (half[0] - middle[0]) + away[1] * (half[1] - middle[1]) < 0) away = [-away[0], -away[1]];
    for (const tick of ticks(low, high, Math.max(2, Math.min(6, Math.floor(long / 55))))) {
      const [px, py] = this.eye.project(at((tick - low) / (high - low)));
      this.addLabel(number(tick), [px + 17 * away[0], py + 13 * away[1]], "tick");
    }
    const upright = Math.abs(end[1] - start[1]) > 2 * Math.abs(end[0] - start[0]), words = label(name, unit);
    const far = upright ? 48 : 36 + 3 * words.length * Math.abs(away[0]);
    this.addLabel(words, [half[0] + far * away[0], half[1] + far * away[1]], upright ? "axis upright" : "axis");
  }

  private addLabel(text: string, at: [number, number], kind: string): void {
    if (kind === "tick") {
      // ticks of two axes meet at corners
      if (this.ticks.some(([x, y]) => Math.abs(x - at[0]) < 6 + 4 * text.length && Math.abs(y - at[1]) < 14)) return;
      this.ticks.push(at);
    }
    const element = h("span", { class: `label ${kind}`, "aria-hidden": "true" }, text), half = kind === "axis" ? 4 * text.length : 10;
    // names stay inside narrow pictures
    place(element, [Math.max(half, Math.min(this.wide - half, at[0])), at[1]]);
    this.overlay.append(element);
    this.labels.push(element);
  }

  /** Where the set is seen from, as text for the address. */
  get cameraText(): string { return this.eye.text; }
  set cameraText(text: string) { this.resize(); this.eye.text = text; }

  // --- picking ----------------------------------------------------------------------------------

  /** State under a pixel of the element; null where there is none. */
  pick(x: number, y: number): Spot | null {
    return this.sheet.corners === 2 ? this.pickSegment(x, y) : this.pickTriangle(x, y);
  }

  private pickTriangle(x: number, y: number): Spot | null {
    const [from, way] = this.eye.ray(x, y);
    const hit = firstHit(this.positions, this.sheet.simplices, from, way);
    return hit && spotOf(this.set, this.sheet, hit.triangle, hit.weights);
  }

  private pickSegment(x: number, y: number): Spot | null {
    const { simplices } = this.sheet;
    let best: Spot | null = null, least = 18;
    for (let t = 0; t < simplices.length / 2; t++) {
      const [a, b] = [0, 1].map((k) => this.eye.project(Array.from(this.positions.subarray(3 * simplices[2 * t + k], 3 * simplices[2 * t + k] + 3)) as [number, number, number]));
      const long = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2;
      const share = Math.min(1, Math.max(0, ((x - a[0]) * (b[0] - a[0]) + (y - a[1]) * (b[1] - a[1])) / (long || 1)));
      const gap = Math.hypot(a[0] + share * (b[0] - a[0]) - x, a[1] + share * (b[1] - a[1]) - y);
      if (gap < least) { least = gap; best = spotOf(this.set, this.sheet, t, [1 - share, share]); }
    }
    return best;
  }

  /** Change of the first parameters that moves a state on its sheet by some pixels, at most. */
  stepFor(spot: Spot, dx: number, dy: number): number[] {
    const set = this.set, axes = Math.min(2, set.d), here = this.eye.project(this.position(spot)), p = set.parameters(spot);
    const columns: { axis: number; move: number[] }[] = [];
    for (let axis = 0; axis < axes; axis++) {
      const { lower, upper } = set.words.parameters[axis];
      for (const sign of [1, -1]) {
        const size = sign * 2e-3 * (upper - lower), end = set.walk(spot, p.map((v, a) => (a === axis ? v + size : v)));
        if (end.share < 0.05) continue;
        const there = this.eye.project(this.position(end.spot)), scale = 1 / (size * end.share);
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
