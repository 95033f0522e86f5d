/** Over the parameters of a state: which minima its saddles join, at which energies, and sliders that change the parameters. */

import { indexColour } from "./colours";
import { closest } from "./panels";
import type { EquilibriumSet, Spot } from "./set";
import type { ShapePanel } from "./shape";
import { h, label, number, s, ticks, withUnit } from "./words";

/** Two groups of minima that become one at the energy of a saddle. */
export interface Join { energy: number; one: number[]; other: number[] }
/** Minima by energy; of each the least barrier and what a snap over it releases, if that is known. */
export interface Landscape { minima: Spot[]; energies: number[]; joins: Join[]; barriers: ({ height: number; released: number } | null)[] }

const WIDE = 420, TALL = 240, LEFT = 62, RIGHT = 8, TOP = 12, FOOT = 62, STEPS = 400;
const HEADROOM = 0.12, SHAPE = 0.86;

/** The disconnectivity graph over a point of the parameters. */
export function landscape(set: EquilibriumSet, p: number[]): Landscape {
  const states = set.over(p), scalar = set.named("energy"), energy = states.map((each) => set.scalar(scalar, each));
  const ends = states.map((each) => (set.indexOf(each) === 1 ? sides(set, each, p, states) : null));
  const below = (state: number): number[] => {
    if (state < 0) return [];
    const own = ends[state];
    if (!own) return set.indexOf(states[state]) === 0 ? [state] : [];
    return [...new Set(own.flatMap((end) => (end >= 0 && energy[end] < energy[state] ? below(end) : [])))];
  };
  const stable = states.map((_, k) => k).filter((k) => set.indexOf(states[k]) === 0), place = new Map(stable.map((k, i) => [k, i]));
  const group = stable.map((_, i) => [i]), joins: Join[] = [], barriers: Landscape["barriers"] = stable.map(() => null);
  states.forEach((_, saddle) => {
    const [one, other] = (ends[saddle] ?? []).map((end) => (end >= 0 && energy[end] < energy[saddle] ? below(end) : []).map((k) => place.get(k)!));
    for (const a of one ?? []) for (const b of other ?? []) {
      if (a === b) continue;
      for (const [from, to] of [[a, b], [b, a]]) barriers[from] ??= { height: energy[saddle] - energy[stable[from]], released: energy[saddle] - energy[stable[to]] };
      if (group[a] === group[b]) continue;
      joins.push({ energy: energy[saddle], one: group[a], other: group[b] });
      const joined = [...group[a], ...group[b]];
      for (const k of joined) group[k] = joined;
    }
  });
  return { minima: stable.map((k) => states[k]), energies: stable.map((k) => energy[k]), joins, barriers };
}

/** States on both sides of a saddle, as below the nearest corner of its cell from which both are known; -1 where none is. */
function sides(set: EquilibriumSet, saddle: Spot, p: number[], states: Spot[]): number[] | null {
  const { saddle_cells } = set.arrays, count = set.saddles.size;
  const corners = saddle.corners.map((v, k) => ({ v, w: saddle.weights[k] })).sort((a, b) => b.w - a.w);
  for (const { v } of corners) {
    const row = set.saddles.get(v);
    if (row === undefined) continue;
    const found = [0, 1].map((side) => follow(set, saddle_cells[side * count + row], v, p, states));
    if (!found.includes(null)) return found as number[];
  }
  return null;
}

/** State over a point on the sheet of a cell that lies over a vertex; -1 for no cell, null if the sheet does not reach there. */
function follow(set: EquilibriumSet, cell: number, vertex: number, p: number[], states: Spot[]): number | null {
  if (cell < 0) return -1;
  const start = set.weights(cell, p.map((_, a) => set.place(vertex, a)));
  if (!start) return null;
  const { spot, end } = set.walk(set.inCell(cell, start), p);
  return end === "arrived" ? closest(set, states, spot) : null;
}

/** Leaves from left to right, so that bars do not cross lines. */
function order({ minima, joins }: Landscape): number[] {
  let rows = minima.map((_, k) => [k]);
  for (const { one, other } of joins) {
    const parts = rows.filter((row) => one.includes(row[0]) || other.includes(row[0])).sort((a, b) => Math.min(...a) - Math.min(...b));
    rows = [...rows.filter((row) => !parts.includes(row)), parts.flat()];
  }
  return rows.flat();
}

export class EnergyPanel {
  readonly element: HTMLElement;
  private readonly graph = s("svg", { class: "tree", role: "img", viewBox: `0 0 ${WIDE} ${TALL}` });
  private readonly words = h("p", { class: "hint", "aria-live": "polite" });
  private readonly sliders: HTMLInputElement[] = [];
  private readonly values: HTMLElement[] = [];
  private p: number[] = [];

  constructor(readonly set: EquilibriumSet, readonly shape: ShapePanel, readonly go: (p: number[]) => void, readonly jump: (spot: Spot) => void) {
    const rows = set.words.parameters.map(({ name, unit, lower, upper }, a) => {
      this.sliders.push(h("input", { type: "range", min: lower, max: upper, step: (upper - lower) / STEPS, "aria-label": `Energies at ${label(name, unit)}`, input: () => this.move(a) }));
      this.values.push(h("output"));
      return h("label", { class: "slice" }, `${label(name, unit)} `, this.sliders[a], this.values[a]);
    });
    this.element = h("section", { class: "energies", hidden: !set.saddles.size, "aria-label": "Energies" }, h("h2", {}, "Energies at which states join"), ...rows, this.graph, this.words);
  }

  private move(axis: number): void {
    const p = [...this.p];
    p[axis] = Number(this.sliders[axis].value);
    this.go(p);
  }

  /** Draw the graph over the parameters of a state, which is marked. */
  show(spot: Spot): void {
    if (!this.set.saddles.size) return;
    this.p = this.set.parameters(spot);
    this.p.forEach((x, a) => { this.sliders[a].value = String(x); this.values[a].textContent = number(x); });
    const found = landscape(this.set, this.p), here = this.set.indexOf(spot) === 0 ? closest(this.set, found.minima, spot) : -1;
    this.graph.replaceChildren(...this.draw(found, here));
    const unit = this.set.words.scalars[this.set.named("energy")].unit, known = found.barriers[here];
    this.words.textContent = here < 0 ? `${found.minima.length} stable over these parameters.`
      : known ? `The ringed state leaves its basin with about ${withUnit(number(known.height, 3), unit)}; a snap over that saddle releases ${withUnit(number(known.released, 3), unit)}.`
        : "No saddle of the set leads from the ringed state to another one.";
    this.graph.setAttribute("aria-label", `${found.minima.length} stable states, joined at ${found.joins.map((each) => number(each.energy, 4)).join(", ") || "no energy"}. ${this.words.textContent}`);
  }

  private draw(found: Landscape, here: number): SVGElement[] {
    const { minima, energies, joins } = found;
    if (!minima.length) return [];
    const low = Math.min(...energies), top = Math.max(...joins.map((each) => each.energy), ...energies), span = top - low || 1e-9 * Math.max(1, Math.abs(top));
    const [least, most] = [low - HEADROOM * span, top + HEADROOM * span], step = (WIDE - LEFT - RIGHT) / minima.length;
    const y = (energy: number) => TOP + ((most - energy) / (most - least)) * (TALL - TOP - FOOT);
    const leaves = order(found), x = minima.map((_, k) => LEFT + (leaves.indexOf(k) + 0.5) * step);
    const parts = [...this.axis(least, most, y)], at = [...x], level = [...energies], line = (d: string) => s("path", { class: "branch", d });
    for (const { energy, one, other } of joins) {
      const [a, b] = [at[one[0]], at[other[0]]];
      parts.push(line(`M${a} ${y(level[one[0]])}V${y(energy)}H${b}V${y(level[other[0]])}`));
      for (const k of [...one, ...other]) { at[k] = (a + b) / 2; level[k] = energy; }
      parts.push(s("circle", { class: "state", cx: (a + b) / 2, cy: y(energy), r: 4.5, fill: indexColour(1) }));
    }
    for (const root of new Set(at)) parts.unshift(line(`M${root} ${y(level[at.indexOf(root)])}V${TOP}`));
    minima.forEach((spot, k) => {
      if (k === here) parts.push(s("circle", { class: "ring", cx: x[k], cy: y(energies[k]), r: 8.5 }));
      parts.push(s("circle", { class: "state leaf", cx: x[k], cy: y(energies[k]), r: 5, fill: indexColour(0), click: () => this.jump(spot) }));
    });
    return [...parts, ...this.shapes(minima, x, step)];
  }

  private axis(least: number, most: number, y: (energy: number) => number): SVGElement[] {
    const text = (words: string, attributes: Record<string, string | number>) => { const out = s("text", attributes); out.textContent = words; return out; };
    const marks = ticks(least, most, 4).flatMap((energy) => [s("path", { class: "tick", d: `M${LEFT - 5} ${y(energy)}H${LEFT}` }), text(number(energy), { class: "tick-text", x: LEFT - 8, y: y(energy) + 4, "text-anchor": "end" })]);
    const middle = (TOP + TALL - FOOT) / 2, unit = this.set.words.scalars[this.set.named("energy")].unit;
    return [s("path", { class: "tick", d: `M${LEFT} ${TOP}V${TALL - FOOT}` }), ...marks, text(label("energy", unit), { class: "tick-text", x: 0, y: 0, "text-anchor": "middle", transform: `translate(11 ${middle}) rotate(-90)` })];
  }

  /** Shapes of the leaves below them, all at one scale. */
  private shapes(minima: Spot[], x: number[], step: number): SVGElement[] {
    const lines = minima.map((each) => this.shape.outline(each)), all = lines.flat(), range = (c: number) => [Math.min(...all.map((q) => q[c])), Math.max(...all.map((q) => q[c]))];
    const [[left, right], [bottom, top]] = [range(0), range(1)], scale = Math.min((SHAPE * step) / (right - left || 1), (SHAPE * FOOT) / (top - bottom || 1));
    return lines.map((line, k) => s("path", { class: "outline", d: line.map((q, i) => `${i ? "L" : "M"}${(x[k] + scale * (q[0] - (left + right) / 2)).toFixed(1)} ${(TALL - FOOT / 2 - scale * (q[1] - (bottom + top) / 2)).toFixed(1)}`).join("") }));
  }
}
