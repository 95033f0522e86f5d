/** What is drawn on the set: routes with their jumps, barriers, and the way of a person. */

import type { EquilibriumSet, Spot } from "./set";
import type { Way } from "./way";

/** States in order, null between two lines. */
export interface Overlay { spots: (Spot | null)[]; width: number; colour?: string; dash?: number }

export function overlays(set: EquilibriumSet, way: Way | null): Overlay[] {
  const lines: Overlay[] = [];
  for (const route of set.words.routes) {
    const jumps = new Set(route.snaps), solid: (Spot | null)[] = [], leaps: (Spot | null)[] = [];
    for (let k = 0; k < route.count; k++) {
      solid.push(set.atState(route.first + k));
      if (jumps.has(k)) { solid.push(null); leaps.push(set.atState(route.first + k), set.atState(route.first + k + 1), null); }
    }
    lines.push({ spots: solid, width: 3.4 }, { spots: leaps, width: 2, dash: 0.03 });
  }
  for (const { near, far, count, facets } of set.words.barriers)
    for (const first of [near, far]) {
      const pairs = set.d === 3 ? facets.flatMap((f) => [f[0], f[1], null, f[1], f[2], null]) : [...Array(count).keys()];
      lines.push({ spots: pairs.map((k) => (k === null ? null : set.atState(first + k))), width: 2.2, colour: "#7b3fa0", dash: first === near ? 0 : 0.02 });
    }
  for (const leg of way?.legs ?? []) lines.push({ spots: leg.track, width: 3, colour: leg.end === "arrived" ? "#0b7a75" : "#b3261e", dash: 0.02 });
  return lines;
}
