/** The equilibrium set: states in its cells, what lies over a point, and walks along its sheets. */

import { Curves } from "./curves";
import type { Arrays, Scalar, Words } from "./data";

/** A point of a cell: its corners with their weights. Vertices count as cells of one corner. */
export interface Spot { cell: number; corners: number[]; weights: number[] }

/** Why a walk ended. */
export type End = "arrived" | "fold" | "branch point" | "box" | "constraint" | "unresolved";
export interface Walk { spot: Spot; end: End; share: number; facet: number[]; visited: number[] }

export interface Landing { status: string; released: number; spot: Spot | null; from: Spot }

const OUTSIDE = -1, BRANCH = -2;
/** Barycentric slack within which a point belongs to a cell. */
const SLACK = 1e-7;
/** Values, as shares of the range of a scalar, that cannot be told from zero. */
const ZERO = 3e-5;
const MANY_STEPS = 200000;

export class EquilibriumSet {
  readonly d: number;
  readonly count: number;
  readonly vertices: number;
  readonly places: Float32Array;
  readonly cells: Int32Array;
  readonly cellIndex: Uint8Array;
  readonly index: Uint8Array;
  readonly stratum: Int32Array;
  /** States in the list: vertices and what stands behind them. */
  readonly states: number;
  readonly modes: number;
  readonly numbers: number;
  /** Vertices of index one, by their rows in `saddle_cells`; empty where the page has no barriers. */
  readonly saddles: Map<number, number>;
  private neighbours: Int32Array | null = null;
  private facetKinds = new Map<string, "fold" | "branch point">();
  private readonly ranges: Record<number, [number, number]> = {};
  private curves: Curves | null = null;
  private bins: { start: Int32Array; cells: Int32Array; counts: number[] } | null = null;

  constructor(readonly words: Words, readonly arrays: Arrays) {
    this.d = words.parameters.length;
    this.places = arrays.places as Float32Array;
    this.states = this.places.length / this.d;
    this.vertices = words.vertices;
    this.cells = arrays.cells as Int32Array;
    this.count = this.cells.length / (this.d + 1);
    this.cellIndex = arrays.cell_index as Uint8Array;
    this.index = arrays.index as Uint8Array;
    this.stratum = arrays.stratum as Int32Array;
    this.modes = arrays.low.length;
    this.numbers = arrays.mean.length;
    this.saddles = new Map([...arrays.saddle_vertex].map((v, row) => [v, row]));
  }

  corner(cell: number, k: number): number { return this.cells[k * this.count + cell]; }
  corners(cell: number): number[] { return Array.from({ length: this.d + 1 }, (_, k) => this.corner(cell, k)); }
  place(state: number, axis: number): number { return this.places[axis * this.states + state]; }

  atState(state: number): Spot { return { cell: -1, corners: [state], weights: [1] }; }
  inCell(cell: number, weights: number[]): Spot { return { cell, corners: this.corners(cell), weights }; }

  private mean(spot: Spot, value: (state: number) => number): number {
    let sum = 0;
    for (let k = 0; k < spot.corners.length; k++) sum += spot.weights[k] * value(spot.corners[k]);
    return sum;
  }

  parameters(spot: Spot): number[] {
    return Array.from({ length: this.d }, (_, axis) => this.mean(spot, (v) => this.place(v, axis)));
  }

  scalarAt(number: number, state: number): number {
    const { low, step } = this.words.scalars[number];
    return low + step * this.arrays[`scalar${number}`][state];
  }
  /** Value of a scalar, no less or more than at any vertex: curves overshoot where a scalar has a kink. */
  scalar(number: number, spot: Spot): number {
    const x = this.straight(number, this.shown(spot)), [low, high] = spot.cell < 0 ? [x, x] : this.range(number);
    return Math.min(high, Math.max(low, x));
  }
  /** The same as it is written: zero where that cannot be told from zero. */
  rounded(number: number, spot: Spot): number { const x = this.scalar(number, spot), [low, high] = this.range(number); return Math.abs(x) < ZERO * (high - low) ? 0 : x; }

  /** Least and greatest value of a scalar at vertices. */
  range(scalar: number): [number, number] {
    let found = this.ranges[scalar];
    if (found) return found;
    found = [Infinity, -Infinity];
    for (let v = 0; v < this.vertices; v++) { const x = this.scalarAt(scalar, v); found[0] = Math.min(found[0], x); found[1] = Math.max(found[1], x); }
    return (this.ranges[scalar] = found);
  }

  /** The same on the straight cell, as the sheet is drawn. */
  straight(number: number, spot: Spot): number { return this.mean(spot, (v) => this.scalarAt(number, v)); }
  named(name: string): number { return this.words.scalars.findIndex((each: Scalar) => each.name === name); }

  indexOf(spot: Spot): number { return spot.cell >= 0 ? this.cellIndex[spot.cell] : this.index[spot.corners[0]]; }
  stratumOf(spot: Spot): number { return spot.cell >= 0 ? this.stratum[spot.cell] : -1; }

  /** The state as it is shown, with its numbers: on the curved cell. */
  shown(spot: Spot): Spot { return (this.curves ??= new Curves(this)).at(spot); }

  /** Coefficients of the picture of a state. */
  coefficients(spot: Spot): Float64Array {
    const { low, step, coefficients } = this.arrays;
    const out = new Float64Array(this.modes);
    for (let k = 0; k < this.modes; k++)
      out[k] = low[k] + step[k] * this.mean(spot, (v) => coefficients[k * this.states + v]);
    return out;
  }

  /** All numbers of the picture of a state; see `equimorph.explorer.pictures`. */
  picture(spot: Spot): Float64Array {
    const { mean, modes } = this.arrays, c = this.coefficients(this.shown(spot));
    const out = Float64Array.from(mean);
    for (let j = 0; j < this.numbers; j++)
      for (let k = 0; k < this.modes; k++) out[j] += c[k] * modes[j * this.modes + k];
    return out;
  }

  /** How far apart two states look: largest difference of their coefficients. */
  unlike(a: Spot, b: Spot): number {
    const one = this.coefficients(a), other = this.coefficients(b);
    let most = 0;
    for (let k = 0; k < this.modes; k++) most = Math.max(most, Math.abs(one[k] - other[k]));
    return most;
  }

  // --- cells over points ------------------------------------------------------------------------

  /** Weights of a point of the parameters in a cell; null where the cell stands upright. */
  weights(cell: number, p: number[]): number[] | null {
    const places = this.placesOf(cell), rates = this.rates(places, p.map((x, a) => x - places[0][a]));
    if (rates) rates[0] += 1;
    return rates;
  }

  placesOf(cell: number): number[][] { return this.corners(cell).map((v) => Array.from({ length: this.d }, (_, a) => this.place(v, a))); }

  get scale(): number[] { return this.words.parameters.map((each) => each.upper - each.lower); }

  private cellsNear(p: number[]): Int32Array {
    const bins = (this.bins ??= this.makeBins());
    let bin = 0;
    for (let a = 0; a < this.d; a++) {
      const { lower, upper } = this.words.parameters[a], n = bins.counts[a];
      bin = bin * n + Math.min(n - 1, Math.max(0, Math.floor(((p[a] - lower) / (upper - lower)) * n)));
    }
    return bins.cells.subarray(bins.start[bin], bins.start[bin + 1]);
  }

  private makeBins() {
    const each = Math.max(4, Math.min(128, Math.round((this.count / 8) ** (1 / this.d))));
    const counts = Array.from({ length: this.d }, () => each);
    const total = counts.reduce((x, y) => x * y, 1), start = new Int32Array(total + 1);
    const visit = (use: (bin: number, cell: number) => void) => {
      for (let cell = 0; cell < this.count; cell++) {
        const low: number[] = [], high: number[] = [];
        for (let a = 0; a < this.d; a++) {
          const { lower, upper } = this.words.parameters[a];
          let from = Infinity, to = -Infinity;
          for (let k = 0; k <= this.d; k++) {
            const x = ((this.place(this.corner(cell, k), a) - lower) / (upper - lower)) * each;
            from = Math.min(from, x); to = Math.max(to, x);
          }
          low.push(Math.min(each - 1, Math.max(0, Math.floor(from - 1e-6))));
          high.push(Math.min(each - 1, Math.max(0, Math.floor(to + 1e-6))));
        }
        const go = (a: number, bin: number) => {
          if (a === this.d) use(bin, cell);
          else for (let i = low[a]; i <= high[a]; i++) go(a + 1, bin * each + i);
        };
        go(0, 0);
      }
    };
    visit((bin) => { start[bin + 1]++; });
    for (let bin = 0; bin < total; bin++) start[bin + 1] += start[bin];
    const cells = new Int32Array(start[total]), next = start.slice();
    visit((bin, cell) => { cells[next[bin]++] = cell; });
    return { start, cells, counts };
  }

  /**
   * All equilibria over a point, by energy; those of neighbouring cells on a common side once.
   *
   * A cell that lies overturned between two of its sheet, as next to cusps, counts minus one time: it takes the state most like its own away.
   */
  over(p: number[]): Spot[] {
    const { overturned } = this.arrays, alike = (a: Spot, b: Spot) => this.cellIndex[a.cell] === this.cellIndex[b.cell], energy = this.named("energy");
    let upright = this.covering(p).sort((a, b) => overturned[a.cell] - overturned[b.cell]);
    for (const each of upright.filter((spot) => overturned[spot.cell])) {
      const others = upright.filter((other) => !overturned[other.cell] && alike(other, each)), gaps = others.map((other) => this.unlike(this.shown(other), this.shown(each)));
      const nearest = others[gaps.indexOf(Math.min(...gaps))];
      if (nearest) upright = upright.filter((spot) => spot !== each && spot !== nearest);
    }
    return upright.sort((a, b) => this.scalar(energy, a) - this.scalar(energy, b));
  }

  /** States of all cells over a point. */
  private covering(p: number[]): Spot[] {
    const found: Spot[] = [], { overturned } = this.arrays, same = 2e-3 * this.words.size;
    for (const cell of this.cellsNear(p)) {
      const w = this.weights(cell, p);
      if (!w || Math.min(...w) < -SLACK) continue;
      const spot = this.inCell(cell, w);
      const edge = Math.min(...w) < 1e-4;
      if (edge && found.some((each) => this.cellIndex[each.cell] === this.cellIndex[cell] && overturned[each.cell] === overturned[cell] && this.unlike(each, spot) < same)) continue;
      found.push(spot);
    }
    return found;
  }

  // --- neighbours and walks ---------------------------------------------------------------------

  private key(facet: number[]): string { return [...facet].sort((a, b) => a - b).join(","); }

  /** Cell across the facet opposite to a corner; negative where there is none, or several. */
  neighbour(cell: number, k: number): number {
    return (this.neighbours ??= this.makeNeighbours())[k * this.count + cell];
  }

  private makeNeighbours(): Int32Array {
    const out = new Int32Array(this.cells.length).fill(OUTSIDE), d = this.d, n = this.states;
    const seen = new Map<number, number>();
    const facet = new Array<number>(d);
    for (let cell = 0; cell < this.count; cell++)
      for (let k = 0; k <= d; k++) {
        for (let j = 0, i = 0; j <= d; j++) if (j !== k) facet[i++] = this.corner(cell, j);
        facet.sort((a, b) => a - b);
        let key = 0;
        for (const v of facet) key = key * n + v;
        const me = k * this.count + cell, other = seen.get(key);
        if (other === undefined) seen.set(key, me);
        else if (out[other] === OUTSIDE) { out[other] = cell; out[me] = other % this.count; }
        else { const third = this.slotOf(out[other], facet); out[other] = out[me] = BRANCH; if (third >= 0) out[third] = BRANCH; }
      }
    for (const [name, kind] of [["folds", "fold"], ["crossings", "branch point"]] as const) {
      const facets = this.arrays[name], rows = facets.length / d;
      for (let row = 0; row < rows; row++)
        this.facetKinds.set(this.key(Array.from({ length: d }, (_, k) => facets[k * rows + row])), kind);
    }
    return out;
  }

  private slotOf(cell: number, facet: number[]): number {
    if (cell < 0) return -1;
    for (let k = 0; k <= this.d; k++) if (!facet.includes(this.corner(cell, k))) return k * this.count + cell;
    return -1;
  }

  /** A spot in a cell for a state of the list, by its place and its looks. */
  locate(spot: Spot, index?: number): Spot | null {
    if (spot.cell >= 0) return spot;
    let best: Spot | null = null, least = Infinity;
    for (const each of this.over(this.parameters(spot))) {
      if (index !== undefined && this.indexOf(each) !== index) continue;
      const gap = this.unlike(each, spot);
      if (gap < least) { least = gap; best = each; }
    }
    return best;
  }

  /** Walk along the sheet straight to other parameters; the index never changes on the way. */
  walk(from: Spot, to: number[]): Walk {
    let { cell } = from;
    let weights = [...from.weights];
    const start = this.parameters(from), visited = [cell];
    let share = 0, back = -1;
    const finish = (end: End, facet: number[] = []): Walk =>
      ({ spot: this.inCell(cell, weights), end, share, facet, visited });
    for (let step = 0; step < MANY_STEPS; step++) {
      const rate = this.rates(this.placesOf(cell), to.map((x, a) => x - start[a]));
      if (!rate) return finish("unresolved");
      let next = 1 - share, out = -1;
      for (let k = 0; k <= this.d; k++) {
        if (k === back || rate[k] >= 0) continue;
        const t = Math.max(0, weights[k]) / -rate[k];
        if (t < next) { next = t; out = k; }
      }
      share += next;
      weights = weights.map((w, k) => w + next * rate[k]);
      if (out < 0) return finish("arrived");
      weights[out] = 0;
      const facet = this.corners(cell).filter((_, k) => k !== out);
      const beyond = this.neighbour(cell, out), kind = this.facetKinds.get(this.key(facet));
      if (kind) return finish(kind, facet);
      if (beyond === BRANCH) return finish("branch point", facet);
      if (beyond < 0) return finish(this.onBox(facet) ? "box" : "constraint", facet);
      if (this.cellIndex[beyond] !== this.cellIndex[cell]) return finish("fold", facet);
      const known = new Map(this.corners(cell).map((v, k) => [v, weights[k]]));
      const corners = this.corners(beyond);
      back = corners.findIndex((v) => !known.has(v));
      cell = beyond;
      weights = corners.map((v) => known.get(v) ?? 0);
      visited.push(cell);
    }
    return finish("unresolved");
  }

  /** Change of the weights of corners in some places along a direction of the parameters; null where these stand upright. */
  rates(corners: number[][], direction: number[]): number[] | null {
    const [first, ...others] = corners, rest = solve(direction.map((x, a) => [...others.map((each) => each[a] - first[a]), x]), this.scale);
    return rest && [-rest.reduce((x, y) => x + y, 0), ...rest];
  }

  onBox(facet: number[]): boolean {
    return this.words.parameters.some(({ lower, upper }, a) => [lower, upper].some((bound) =>
      facet.every((v) => Math.abs(this.place(v, a) - bound) < 1e-6 * (upper - lower))));
  }

  /** What a facet lies on: see `End`; empty inside a sheet. Over three parameters, too. */
  facetKind(facet: number[]): string {
    this.neighbours ??= this.makeNeighbours();
    return this.facetKinds.get(this.key(facet)) ?? "";
  }

  /** Where the structure lands from a stop at a fold: read from the nearest snap that was followed. */
  landing(walk: Walk): Landing | null {
    if (walk.end !== "fold" || this.indexOf(walk.spot) !== 0) return null;
    const { snap_vertex, snap_run, snap_landing, snap_released, along, along_run } = this.arrays;
    const stratum = this.stratumOf(walk.spot), p = this.parameters(walk.spot);
    const on = new Set<number>();
    for (let i = 0; i < along.length; i++) if (walk.facet.includes(along[i])) on.add(along_run[i]);
    let best = -1, least = Infinity;
    for (let i = 0; i < snap_vertex.length; i++) {
      if (this.words.runs[snap_run[i]].source !== stratum || (on.size && !on.has(snap_run[i]))) continue;
      const gap = p.reduce((sum, x, a) => sum + ((x - this.place(snap_vertex[i], a)) / this.scale[a]) ** 2, 0);
      if (gap < least) { least = gap; best = i; }
    }
    if (best < 0) return null;
    const run = this.words.runs[snap_run[best]];
    const like = snap_landing[best] >= 0 ? this.atState(snap_landing[best]) : null;
    if (!like) return { status: run.status, released: snap_released[best], spot: null, from: walk.spot };
    let spot: Spot | null = null, nearest = Infinity;
    for (const each of this.over(p)) {
      if (this.indexOf(each) !== 0 || (run.target >= 0 && this.stratumOf(each) !== run.target)) continue;
      if (this.unlike(each, walk.spot) < 5e-3 * this.words.size) continue;
      const gap = this.unlike(each, like);
      if (gap < nearest) { nearest = gap; spot = each; }
    }
    const energy = this.named("energy");
    const released = spot ? this.scalar(energy, walk.spot) - this.scalar(energy, spot) : snap_released[best];
    return { status: run.status, released, spot, from: walk.spot };
  }
}

/** Solve d linear equations, rows with the right side last; null if they are singular. */
function solve(rows: number[][], scale: number[]): number[] | null {
  const n = rows.length, m = rows.map((row, a) => row.map((x) => x / scale[a]));
  for (let i = 0; i < n; i++) {
    let pivot = i;
    for (let r = i + 1; r < n; r++) if (Math.abs(m[r][i]) > Math.abs(m[pivot][i])) pivot = r;
    if (Math.abs(m[pivot][i]) < 1e-13) return null;
    [m[i], m[pivot]] = [m[pivot], m[i]];
    for (let r = 0; r < n; r++) {
      if (r === i) continue;
      const factor = m[r][i] / m[i][i];
      for (let c = i; c <= n; c++) m[r][c] -= factor * m[i][c];
    }
  }
  return m.map((row, i) => row[n] / row[i]);
}
