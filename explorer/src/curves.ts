/**
 * Curved cells: through the exact states next to the middles of their edges.
 *
 * Shape functions are those of quadratic elements, wᵢ(2wᵢ − 1) of corners and 4wᵢwⱼ of middles; edges without a middle are straight.
 * A curved cell has other parameters at the same weights: the weights move until it has those of the straight cell, or, where
 * that fails close to a fold, stay what they are.
 */

import type { EquilibriumSet, Spot } from "./set";

/** Most steps towards the parameters, how far weights may move in one and in all, and when it is near enough, in shares of the box. */
const STEPS = 12, LONGEST = 0.25, FARTHEST = 1, NEAR = 1e-5;

export class Curves {
  private readonly middles = new Map<number, number>();

  constructor(private readonly set: EquilibriumSet) {
    const { bent } = set.arrays, count = bent.length / 2;
    for (let k = 0; k < count; k++) this.middles.set(bent[k] * set.states + bent[count + k], set.words.middles + k);
  }

  /** A state as a sum of states of the list, on the curved cell over the same parameters. */
  at(spot: Spot): Spot {
    if (spot.cell < 0) return spot;
    const middles = this.of(spot.corners);
    return middles.length ? this.sum(spot, middles, this.moved(spot, middles)) : spot;
  }

  /** Corners, by their places in the cell, with the states between them. */
  private of(corners: number[]): [number, number, number][] {
    const out: [number, number, number][] = [];
    for (let i = 0; i < corners.length; i++)
      for (let j = 0; j < i; j++) {
        const [a, b] = [Math.min(corners[i], corners[j]), Math.max(corners[i], corners[j])];
        const found = this.middles.get(a * this.set.states + b);
        if (found !== undefined) out.push([i, j, found]);
      }
    return out;
  }

  private sum(spot: Spot, middles: [number, number, number][], w: number[]): Spot {
    const weights = [...w];
    for (const [i, j] of middles) { const share = 2 * w[i] * w[j]; weights[i] -= share; weights[j] -= share; weights.push(2 * share); }
    return { cell: spot.cell, corners: [...spot.corners, ...middles.map(([, , state]) => state)], weights };
  }

  /** Slopes of the parameters by the weights, where those of a straight cell are its corners. */
  private slopes(places: number[][], bends: [number, number, number[]][], w: number[]): number[][] {
    const out = places.map((place) => [...place]);
    for (const [i, j, bend] of bends) bend.forEach((x, a) => { out[i][a] += w[j] * x; out[j][a] += w[i] * x; });
    return out;
  }

  private moved(spot: Spot, middles: [number, number, number][]): number[] {
    const { set } = this, wanted = set.parameters(spot), scale = set.words.parameters.map((each) => each.upper - each.lower);
    const places = set.placesOf(spot.cell);
    const bends = middles.map(([i, j, state]): [number, number, number[]] => [i, j, places[0].map((_, a) => 4 * set.place(state, a) - 2 * (places[i][a] + places[j][a]))]);
    let w = spot.weights, best = spot.weights, least = Infinity;
    for (let step = 0; step < STEPS; step++) {
      const gap = set.parameters(this.sum(spot, middles, w)).map((x, a) => wanted[a] - x), size = Math.max(...gap.map((x, a) => Math.abs(x) / scale[a]));
      if (size < least) { least = size; best = w; }
      if (size < NEAR) return w;
      const rate = set.rates(this.slopes(places, bends, w), gap);
      if (!rate) break;
      const short = Math.min(1, LONGEST / Math.max(...rate.map(Math.abs)));
      w = w.map((x, k) => x + short * rate[k]);
      if (w.some((x, k) => Math.abs(x - spot.weights[k]) > FARTHEST)) break;
    }
    return best === spot.weights || least > 10 * NEAR ? spot.weights : best;
  }
}
