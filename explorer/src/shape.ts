/** The structure's shape with supports, loads and actuators, in the plane or turned in space. */

import type { EquilibriumSet, Spot } from "./set";
import type { Part } from "./data";
import { h, number, s, withUnit } from "./words";

export interface Portrait { spot: Spot; colour: string; dash: string; main: boolean; name: string }

type Point = number[];
const RADIUS = 0.022;
const HEAD = 0.028;
const SAMPLES = 80;
/** Pixels of letters. */
const LETTERS = 13;

export class ShapePanel {
  readonly element: HTMLElement;
  private readonly svg: SVGElement;
  private azimuth = (28 * Math.PI) / 180;
  private elevation = (22 * Math.PI) / 180;
  private zoom = 1;
  private portraits: Portrait[] = [];
  private readonly offsets: number[] = [];
  private box: [Point, Point] | null = null;

  constructor(readonly set: EquilibriumSet) {
    this.svg = s("svg", { class: "shape", role: "img", preserveAspectRatio: "xMidYMid meet" });
    this.element = h("div", { class: "shape-panel" }, this.svg);
    let at = 0;
    for (const part of set.words.layout) { this.offsets.push(at); at += this.length(part); }
    if (this.space === 3) this.makeTurnable();
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  private get space(): number { return this.set.words.space; }
  private get size(): number { return this.set.words.size; }

  private length(part: Part): number {
    const n = this.space;
    if (part.what === "support") return 2 * n;
    if (part.what === "forces") return 2 * part.points * n;
    if (part.what === "couples") return part.points * (n + 1);
    return part.points * n;
  }

  private makeTurnable(): void {
    let from: [number, number] | null = null;
    this.svg.setAttribute("tabindex", "0");
    this.svg.addEventListener("pointerdown", (e: any) => { from = [e.clientX, e.clientY]; this.svg.setPointerCapture(e.pointerId); });
    this.svg.addEventListener("pointermove", (e: any) => {
      if (!from) return;
      this.turn((e.clientX - from[0]) * 0.01, (e.clientY - from[1]) * 0.01);
      from = [e.clientX, e.clientY];
    });
    for (const name of ["pointerup", "pointercancel"]) this.svg.addEventListener(name, () => { from = null; });
    this.svg.addEventListener("keydown", (e: any) => {
      const turn = ({ ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] } as Record<string, number[]>)[e.key];
      if (turn) { this.turn(turn[0], turn[1]); e.preventDefault(); e.stopPropagation(); }
    });
  }

  turn(right: number, down: number): void {
    this.azimuth -= right;
    this.elevation = Math.max(-1.5, Math.min(1.5, this.elevation + down));
    this.draw();
  }

  zoomBy(factor: number): void { this.zoom *= factor; this.draw(); }

  show(portraits: Portrait[]): void { this.portraits = portraits; this.draw(); }

  /** Points of a part of a picture, flat or in space. */
  private points(picture: Float64Array, at: number, count: number): Point[] {
    const n = this.space;
    return Array.from({ length: count }, (_, i) => Array.from({ length: n }, (_, c) => picture[at + i * n + c]));
  }

  /** To the right, upward, and towards the viewer. */
  private flat = (v: Point): Point => {
    if (this.space === 2) return [v[0], v[1], 0];
    const [x, y, z] = this.set.words.upward === "z" ? [v[0], v[2], -v[1]] : v;
    const [sa, ca, se, ce] = [Math.sin(this.azimuth), Math.cos(this.azimuth), Math.sin(this.elevation), Math.cos(this.elevation)];
    return [ca * x - sa * z, ce * y - se * (sa * x + ca * z), se * y + ce * (sa * x + ca * z)];
  };

  /** Corners of what shapes of the whole set cover; a turned structure keeps its scale. */
  private extent(): [Point, Point] {
    if (this.box) return this.box;
    let low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const stable = [...Array(this.set.vertices).keys()].filter((v) => this.set.index[v] === 0);
    const chosen = stable.length ? stable : [...Array(this.set.vertices).keys()];
    const line = this.set.words.layout[0];
    for (let i = 0; i < chosen.length; i += Math.max(1, Math.floor(chosen.length / SAMPLES)))
      for (const point of this.points(this.set.picture(this.set.atState(chosen[i])), 0, line.points)) {
        low = low.map((x, c) => Math.min(x, point[c] ?? 0)); high = high.map((x, c) => Math.max(x, point[c] ?? 0));
      }
    return (this.box = [low, high]);
  }

  private draw(): void {
    const [low, high] = this.extent(), size = this.size, room = 0.17 * size;
    const corners = this.space === 2 ? [low, high] : [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1 ? high[0] : low[0], k & 2 ? high[1] : low[1], k & 4 ? high[2] : low[2]]);
    const seen = corners.map(this.flat), xs = seen.map((p) => p[0]), ys = seen.map((p) => p[1]);
    let [left, right, bottom, top] = [Math.min(...xs) - room, Math.max(...xs) + room, Math.min(...ys) - room, Math.max(...ys) + room];
    const [cx, cy, w, g] = [(left + right) / 2, (bottom + top) / 2, (right - left) / this.zoom, (top - bottom) / this.zoom];
    [left, right, bottom, top] = [cx - w / 2, cx + w / 2, cy - g / 2, cy + g / 2];
    this.svg.setAttribute("viewBox", `${left} ${-top} ${right - left} ${top - bottom}`);
    const parts: SVGElement[] = [...this.obstacles(left, right, bottom, top)];
    const order = [...this.portraits.filter((each) => !each.main), ...this.portraits.filter((each) => each.main)];
    for (const each of order) parts.push(this.portrait(each));
    parts.push(...this.scaleBar(left, bottom, right - left, top - bottom));
    this.svg.replaceChildren(...parts);
    this.svg.setAttribute("aria-label", this.portraits.length ? `Shape of ${this.portraits.map((each) => each.name).join(", ")}` : "No state chosen");
  }

  private portrait({ spot, colour, dash, main }: Portrait): SVGElement {
    const picture = this.set.picture(spot), group = s("g", { class: main ? "main" : "other", style: `--line: ${colour}` });
    const lines: SVGElement[] = [], around: SVGElement[] = [];
    const { layout } = this.set.words;
    const ribbon = layout.findIndex((part) => part.what === "ribbon");
    layout.forEach((part, k) => {
      const at = this.offsets[k];
      if (part.what === "line") lines.push(...this.line(picture, part, dash, ribbon < 0 ? -1 : this.offsets[ribbon], main));
      else if (part.what === "support") around.push(...this.support(part, ...(this.points(picture, at, 2) as [Point, Point]), main));
      else if (part.what === "actuator") around.push(this.actuator(part, this.points(picture, at, part.points)));
      else if (!main) return;
      else if (part.what === "forces") lines.push(...this.forces(picture, at, part));
      else if (part.what === "couples") lines.push(...this.couples(picture, at, part));
    });
    group.append(...around, ...lines);
    return group;
  }

  /** Points along the line of a state, to the right and upward. */
  outline(spot: Spot): Point[] { return this.points(this.set.picture(spot), 0, this.set.words.layout[0].points).map(this.flat); }

  private path(points: Point[]): string { return points.map((p, i) => `${i ? "L" : "M"}${p[0].toFixed(5)} ${(-p[1]).toFixed(5)}`).join(""); }

  private line(picture: Float64Array, part: Part, dash: string, ribbon: number, main: boolean): SVGElement[] {
    const points = this.points(picture, 0, part.points);
    if (ribbon >= 0) return this.ribbon(points, this.points(picture, ribbon, part.points), main);
    const seen = points.map(this.flat);
    if (this.space === 2) return [s("path", { class: "line", d: this.path(seen), "stroke-dasharray": dash })];
    // what is nearer comes later, with a rim of paper that parts it from what is behind
    const pieces = seen.slice(1).map((q, i) => ({ p: seen[i], q, depth: (seen[i][2] + q[2]) / 2 })).sort((a, b) => a.depth - b.depth);
    const depths = pieces.map((each) => each.depth), [near, far] = [Math.max(...depths), Math.min(...depths)];
    return pieces.flatMap(({ p, q, depth }) => {
      const d = this.path([p, q]), share = near > far ? (depth - far) / (near - far) : 1;
      return [s("path", { class: "rim", d }), s("path", { class: "line", d, "stroke-dasharray": dash, style: `stroke-width: ${(1.6 + 1.6 * share).toFixed(2)}px` })];
    });
  }

  private ribbon(points: Point[], across: Point[], main: boolean): SVGElement[] {
    const [one, other] = [1, -1].map((sign) => points.map((p, i) => this.flat(p.map((x, c) => x + sign * across[i][c]))));
    const quads = one.slice(1).map((_, i) => {
      const ring = [one[i], one[i + 1], other[i + 1], other[i]];
      const turn = (ring[1][0] - ring[0][0]) * (ring[3][1] - ring[0][1]) - (ring[1][1] - ring[0][1]) * (ring[3][0] - ring[0][0]);
      const wide = Math.hypot(ring[3][0] - ring[0][0], ring[3][1] - ring[0][1]) * Math.hypot(ring[1][0] - ring[0][0], ring[1][1] - ring[0][1]);
      return { ring, light: wide ? turn / wide : 0, depth: ring.reduce((sum, p) => sum + p[2], 0) };
    });
    return quads.sort((a, b) => a.depth - b.depth).map(({ ring, light }) =>
      s("path", { class: `quad ${light < 0 ? "back" : ""}`, d: `${this.path(ring)}Z`, style: `--light: ${(55 + 45 * Math.abs(light)).toFixed(0)}%${main ? "" : "; opacity: 0.5"}` }));
  }

  private support(part: Part, place: Point, direction: Point, main: boolean): SVGElement[] {
    const symbol = this.set.words.symbols[part.kind];
    if (!symbol) return [];
    const at = this.flat(place), way = this.flat(direction), long = Math.hypot(way[0], way[1]);
    let along = symbol.upright || long < 1e-9 ? [1, 0] : [way[0] / long, way[1] / long];
    const middle = this.extent()[0].map((x, c) => (x + this.extent()[1][c]) / 2), inward = this.flat(middle).map((x, c) => x - at[c]);
    if (symbol.away && along[0] * inward[0] + along[1] * inward[1] > 0) along = [-along[0], -along[1]];
    let across = [-along[1], along[0]];
    if (part.kind === "roller" && across[0] * inward[0] + across[1] * inward[1] < 0) across = [along[1], -along[0]];
    const r = RADIUS * this.size;
    return symbol.strokes.map(({ outline, filled }) => {
      const points = outline.map(([x, y]) => [at[0] + r * (x * along[0] + y * across[0]), at[1] + r * (x * along[1] + y * across[1])]);
      return s("path", { class: `support ${filled ? "filled" : ""} ${main ? "" : "pale"}`, d: this.path(points) + (filled ? "Z" : "") });
    });
  }

  private actuator(part: Part, points: Point[]): SVGElement {
    const seen = points.map(this.flat);
    const inner = part.kind === "length" ? [0.3, 0.7].map((t) => seen[0].map((x, c) => x + t * (seen[seen.length - 1][c] - x))) : seen;
    return s("path", { class: `actuator ${part.kind}`, d: this.path(inner) });
  }

  private forces(picture: Float64Array, at: number, part: Part): SVGElement[] {
    const places = this.points(picture, at, part.points), vectors = this.points(picture, at + part.points * this.space, part.points);
    const tails: Point[] = [], out: SVGElement[] = [];
    places.forEach((place, i) => {
      const tip = this.flat(place), way = this.flat(vectors[i]), long = Math.hypot(way[0], way[1]);
      if (long < 0.006 * this.size) return;
      const unit = [way[0] / long, way[1] / long], gap = 0.012 * this.size;
      const head = [tip[0] - gap * unit[0], tip[1] - gap * unit[1]], tail = [head[0] - way[0], head[1] - way[1]];
      tails.push(tail);
      out.push(...this.arrow(tail, head, unit, Math.min(HEAD * this.size, 0.6 * long)));
    });
    if (part.distributed && tails.length > 1) out.push(s("path", { class: "load", d: this.path(tails) }));
    return out;
  }

  private arrow(tail: Point, head: Point, unit: Point, size: number): SVGElement[] {
    const base = [head[0] - size * unit[0], head[1] - size * unit[1]], side = [-unit[1] * 0.38 * size, unit[0] * 0.38 * size];
    return [
      s("path", { class: "load", d: this.path([tail, base]) }),
      s("path", { class: "head", d: `${this.path([head, [base[0] + side[0], base[1] + side[1]], [base[0] - side[0], base[1] - side[1]]])}Z` }),
    ];
  }

  private couples(picture: Float64Array, at: number, part: Part): SVGElement[] {
    const places = this.points(picture, at, part.points), first = at + part.points * this.space;
    return places.flatMap((place, i) => {
      const moment = picture[first + i], r = 0.06 * this.size, centre = this.flat(place);
      if (Math.abs(moment) < 0.02 * r) return [];
      const sign = Math.sign(moment), span = 0.35 + 1.15 * Math.min(1, Math.abs(moment) / r);
      const angles = Array.from({ length: 24 }, (_, k) => sign * Math.PI * (0.5 * span * ((2 * k) / 23 - 1)));
      const arc = angles.map((t) => [centre[0] + r * Math.cos(t), centre[1] + r * Math.sin(t)]), end = angles[23] + sign * Math.PI / 2;
      const tip = arc[23], unit = [Math.cos(end), Math.sin(end)], size = 0.8 * HEAD * this.size;
      return [s("path", { class: "load", d: this.path(arc) }), ...this.arrow(tip, [tip[0] + size * unit[0], tip[1] + size * unit[1]], unit, size)];
    });
  }

  private obstacles(left: number, right: number, bottom: number, top: number): SVGElement[] {
    if (this.space === 3) return [];
    return this.set.words.obstacles.map((each) => {
      if (each.centre) {
        const [x, y] = each.centre, r = each.radius!, ring = `M${x - r} ${-y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
        return s("path", { class: "obstacle", "fill-rule": "evenodd", d: each.inside ? `M${left} ${-top}H${right}V${-bottom}H${left}Z${ring}` : ring });
      }
      const [x, y] = each.point!, [a, b] = each.normal!, far = 4 * (right - left + top - bottom);
      const ring = [[x - far * b, y + far * a], [x + far * b, y - far * a], [x + far * b - far * a, y - far * a - far * b], [x - far * b - far * a, y + far * a - far * b]];
      return s("path", { class: "obstacle", d: `${this.path(ring)}Z` });
    });
  }

  private scaleBar(left: number, bottom: number, width: number, tall: number): SVGElement[] {
    const { clientWidth, clientHeight } = this.svg, size = LETTERS * (clientWidth ? Math.max(width / clientWidth, tall / clientHeight) : width / 400);
    const rough = 0.2 * width, power = 10 ** Math.floor(Math.log10(rough)), long = power * [5, 2, 1].find((each) => each * power <= rough)!;
    const [x, y] = [left + 0.04 * width, bottom + 0.05 * width], text = s("text", { class: "scale-text", x: x + long / 2, y: -y - 0.4 * size, "font-size": size });
    text.textContent = withUnit(number(long), this.set.words.unit);
    const parts = [s("path", { class: "scale-bar", d: this.path([[x, y], [x + long, y]]) }), text];
    if (this.space === 3) {
      const foot = [left + 0.1 * width, bottom + 0.16 * width];
      "xyz".split("").forEach((name, c) => {
        const arm = this.flat([0, 1, 2].map((k) => (k === c ? 0.06 * width : 0))), tip = [foot[0] + arm[0], foot[1] + arm[1]];
        const word = s("text", { class: "scale-text", x: foot[0] + 1.35 * arm[0], y: -(foot[1] + 1.35 * arm[1]) + 0.3 * size, "font-size": size });
        word.textContent = name;
        parts.push(s("path", { class: "scale-bar", d: this.path([foot, tip]) }), word);
      });
    }
    return parts;
  }
}
