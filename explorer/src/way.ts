/** Way-points that a person draws: judged coarsely here, exported for Python to certify. */

import type { EquilibriumSet, End, Landing, Spot } from "./set";
import { number } from "./words";

export interface Leg { from: Spot; to: Spot; end: End; target: number[]; track: Spot[]; margin: number; landing: Landing | null }

const TRACK = 40;

export class Way {
  legs: Leg[] = [];
  constructor(readonly set: EquilibriumSet, readonly start: Spot) {}

  get end(): Spot { return this.legs.length ? this.legs[this.legs.length - 1].to : this.start; }
  get blocked(): Leg | null { return this.legs.find((leg) => leg.end !== "arrived") ?? null; }

  /** Lead the way straight to other parameters. */
  add(target: number[]): Leg {
    const leg = leadLeg(this.set, this.end, target);
    this.legs.push(leg);
    return leg;
  }

  remove(): void { this.legs.pop(); }

  /** What can be said from interpolated states alone. */
  verdict(): string {
    if (!this.legs.length) return "Choose way-points on the surface, or type their values.";
    const margin = Math.min(...this.legs.map((leg) => leg.margin)), at = this.blocked;
    if (!at) return `Stable on the way as far as this page can tell; smallest margin about ${number(margin, 3)}.`;
    const p = this.set.parameters(at.to).map((x, a) => `${this.set.words.parameters[a].name} = ${number(x, 3)}`).join(", ");
    const why = at.end === "fold" ? "meets a fold, where the structure would snap" : at.end === "branch point" ? "meets a branch point" : at.end === "constraint" ? "meets a constraint" : at.end === "box" ? "leaves the box of the set" : "cannot be followed";
    return `Leg ${this.legs.indexOf(at) + 1} ${why}, near ${p}.`;
  }

  /** A study file with this way as a route; its goal is the state that the page expects. */
  study(): string {
    const { set } = this, names = set.words.parameters.map((each) => each.name);
    const point = (p: number[]) => `{ ${p.map((x, a) => `${key(names[a])} = ${float(x)}`).join(", ")} }`;
    const targets = this.legs.map((leg) => leg.target), goal = this.blocked ? null : this.end;
    const last = targets[targets.length - 1];
    const lines = [
      "# Written by the explorer. The page judges from interpolated states only: run this study to certify the route.",
      set.words.study.trimEnd(), "", "[[route]]", 'name = "drawn"',
      `start = ${choose(set, this.start, set.parameters(this.start), point)}`,
      goal ? `goal = ${choose(set, goal, last, point)}` : `goal = { at = ${point(last)}${extreme(set, last)} }`,
      `via = [${targets.map(point).join(", ")}]`, "",
      "# The same way without a set: what is lifted is every step between the way-points.",
      "[[verify]]", 'name = "check"',
      `start = ${choose(set, this.start, set.parameters(this.start), point)}`, `steps = [${targets.map(point).join(", ")}]`, "",
    ];
    return lines.join("\n");
  }
}

function leadLeg(set: EquilibriumSet, from: Spot, target: number[]): Leg {
  const start = set.parameters(from), walk = set.walk(from, target), track = [from];
  for (let k = 1; k <= TRACK; k++) {
    const t = (k / TRACK) * walk.share;
    track.push(k === TRACK ? walk.spot : set.walk(track[track.length - 1], start.map((x, a) => x + t * (target[a] - x))).spot);
  }
  const margin = set.named("stability_margin");
  return { from, to: walk.spot, end: walk.end, target, track, margin: Math.min(...track.map((spot) => set.scalar(margin, spot))), landing: set.landing(walk) };
}

/** Selection of a state over a point, as study files write it: extreme in a descriptor, or near a value. */
function choose(set: EquilibriumSet, spot: Spot, p: number[], point: (p: number[]) => string): string {
  const stable = set.over(p).filter((each) => set.indexOf(each) === 0), at = point(p);
  if (stable.length < 2) return `{ at = ${at} }`;
  const order = heights(set);
  for (const scalar of order) {
    const values = stable.map((each) => set.scalar(scalar, each)), mine = set.scalar(scalar, spot);
    const gap = 1e-3 * (Math.max(...values) - Math.min(...values) || 1), name = JSON.stringify(set.words.scalars[scalar].name);
    if (values.filter((x) => x > mine + gap).length === 0) return `{ at = ${at}, highest = ${name} }`;
    if (values.filter((x) => x < mine - gap).length === 0) return `{ at = ${at}, lowest = ${name} }`;
  }
  const name = JSON.stringify(set.words.scalars[order[0]].name);
  return `{ at = ${at}, near = { ${name} = ${float(set.scalar(order[0], spot))} } }`;
}

function extreme(set: EquilibriumSet, p: number[]): string {
  const stable = set.over(p).filter((each) => set.indexOf(each) === 0);
  return stable.length < 2 ? "" : `, highest = ${JSON.stringify(set.words.scalars[heights(set)[0]].name)}`;
}

/** Scalars by which states can be told apart, the height of the structure first. */
function heights(set: EquilibriumSet): number[] {
  const first = set.named(set.words.elevation);
  const rest = set.words.scalars.map((_, k) => k).filter((k) => k !== first && set.words.scalars[k].name !== "stability_margin");
  return first >= 0 ? [first, ...rest] : rest;
}

function key(name: string): string { return /^[A-Za-z0-9_-]+$/.test(name) ? name : JSON.stringify(name); }
function float(x: number): string { const text = String(Number(x.toPrecision(7))); return /[.e]/.test(text) ? text : `${text}.0`; }
