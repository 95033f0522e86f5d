/** What of the set is drawn: all of it, or its slice where the third parameter has one value. */

import type { EquilibriumSet, Spot } from "./set";

/**
 * Points between two states each, and simplices of them with the cells that they lie in.
 *
 * Point i is (1 - share) of state a and share of state b. Corners of a simplex stand side by side.
 */
export interface Sheet {
  corners: number;
  a: Int32Array; b: Int32Array; share: Float32Array;
  simplices: Int32Array; cell: Int32Array;
  lines: Record<LineKind, Int32Array>;
}

export type LineKind = "stability" | "fold" | "crossing" | "constraint" | "box";
export const LINE_KINDS: LineKind[] = ["box", "constraint", "crossing", "fold", "stability"];

type Piece = number[];

/** Sheet to draw; `level` is the value of the third parameter, if there is one. */
export function sheetOf(set: EquilibriumSet, level: number | null): Sheet {
  const facets = classified(set);
  if (set.d < 3) {
    const count = set.states, a = Int32Array.from({ length: count }, (_, i) => i);
    const simplices = new Int32Array(set.cells.length), n = set.d + 1;
    for (let cell = 0; cell < set.count; cell++)
      for (let k = 0; k < n; k++) simplices[cell * n + k] = set.corner(cell, k);
    const cell = Int32Array.from({ length: set.count }, (_, i) => i);
    return { corners: n, a, b: a, share: new Float32Array(count), simplices, cell, lines: flat(facets) };
  }
  return slice(set, level!, facets);
}

function flat(facets: Record<LineKind, Piece[]>): Record<LineKind, Int32Array> {
  return Object.fromEntries(LINE_KINDS.map((kind) => [kind, Int32Array.from(facets[kind].flat())])) as Record<LineKind, Int32Array>;
}

const known = new WeakMap<EquilibriumSet, Record<LineKind, Piece[]>>();

/** Facets on folds, crossings, constraints and the box. */
function classified(set: EquilibriumSet): Record<LineKind, Piece[]> {
  const before = known.get(set);
  if (before) return before;
  const found: Record<LineKind, Piece[]> = { stability: [], fold: [], crossing: [], constraint: [], box: [] };
  for (let cell = 0; cell < set.count; cell++)
    for (let k = 0; k <= set.d; k++) {
      const beyond = set.neighbour(cell, k);
      const inner = beyond >= 0 && set.cellIndex[beyond] === set.cellIndex[cell];
      const facet = () => set.corners(cell).filter((_, j) => j !== k);
      if (inner) continue;
      if (beyond >= 0) {
        if (beyond > cell) found[Math.min(set.cellIndex[beyond], set.cellIndex[cell]) === 0 ? "stability" : "fold"].push(facet());
        continue;
      }
      const kind = set.facetKind(facet());
      if (kind) found[kind === "fold" ? "fold" : "crossing"].push(facet());
      else found[set.onBox(facet()) ? "box" : "constraint"].push(facet());
    }
  known.set(set, found);
  return found;
}

/** Triangles and lines where tetrahedra and facets cross one level of the third parameter. */
function slice(set: EquilibriumSet, level: number, facets: Record<LineKind, Piece[]>): Sheet {
  const { lower, upper } = set.words.parameters[2];
  // a level through vertices is moved a little, so that every edge crosses it in its inside or not
  const height = level + 1e-7 * (upper - lower) * (level >= upper ? -1 : 1);
  const numbers = new Map<number, number>();
  const a: number[] = [], b: number[] = [], share: number[] = [], simplices: number[] = [], cells: number[] = [];
  const above = (v: number) => set.place(v, 2) > height;
  const point = (v: number, w: number): number => {
    const [from, to] = v < w ? [v, w] : [w, v], key = from * set.states + to;
    let number = numbers.get(key);
    if (number === undefined) {
      number = a.length;
      numbers.set(key, number);
      const low = set.place(from, 2), high = set.place(to, 2);
      a.push(from); b.push(to); share.push((height - low) / (high - low));
    }
    return number;
  };
  for (let cell = 0; cell < set.count; cell++) {
    const v = set.corners(cell), up = v.filter(above), down = v.filter((each) => !above(each));
    if (!up.length || !down.length) continue;
    if (up.length === 2) {
      const [p, q, r, s] = [point(up[0], down[0]), point(up[0], down[1]), point(up[1], down[1]), point(up[1], down[0])];
      simplices.push(p, q, r, p, r, s); cells.push(cell, cell);
    } else {
      const [one, many] = up.length === 1 ? [up[0], down] : [down[0], up];
      simplices.push(...many.map((each) => point(one, each))); cells.push(cell);
    }
  }
  const lines = Object.fromEntries(LINE_KINDS.map((kind) => {
    const out: number[] = [];
    for (const facet of facets[kind]) {
      const up = facet.filter(above), down = facet.filter((each) => !above(each));
      if (!up.length || !down.length) continue;
      const [one, many] = up.length === 1 ? [up[0], down] : [down[0], up];
      out.push(...many.map((each) => point(one, each)));
    }
    return [kind, Int32Array.from(out)];
  })) as Record<LineKind, Int32Array>;
  return { corners: 3, a: Int32Array.from(a), b: Int32Array.from(b), share: Float32Array.from(share),
    simplices: Int32Array.from(simplices), cell: Int32Array.from(cells), lines };
}

/** Pairs of ends in an order, and turned, such that each begins where the one before ends as far as possible. */
export function inOrder(ends: ArrayLike<number>): Int32Array {
  const out = new Int32Array(ends.length), used = new Uint8Array(ends.length / 2), at = new Map<number, number[]>();
  for (let i = 0; i < ends.length; i++) { const own = at.get(ends[i]); if (own) own.push(i); else at.set(ends[i], [i]); }
  let count = 0;
  const follow = (start: number) => {
    for (let here = start, i: number | undefined; (i = at.get(here)!.find((each) => !used[each >> 1])) !== undefined; here = ends[i ^ 1]) { used[i >> 1] = 1; out[count++] = here; out[count++] = ends[i ^ 1]; }
  };
  for (const [point, own] of at) if (own.length !== 2) for (const _ of own) follow(point);
  for (const point of at.keys()) follow(point);
  return out;
}

/** State at weights of the corners of a drawn simplex. */
export function spotOf(set: EquilibriumSet, sheet: Sheet, simplex: number, weights: number[]): Spot {
  const cell = sheet.cell[simplex], corners = set.corners(cell), out = corners.map(() => 0);
  weights.forEach((w, k) => {
    const i = sheet.simplices[simplex * sheet.corners + k];
    out[corners.indexOf(sheet.a[i])] += w * (1 - sheet.share[i]);
    out[corners.indexOf(sheet.b[i])] += w * sheet.share[i];
  });
  return { cell, corners, weights: out };
}
