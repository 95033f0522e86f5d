/** Routes: play and scrub, with strips of margin and efforts in step. */

import type { Route } from "./data";
import type { EquilibriumSet, Spot } from "./set";
import { h, label, number, s } from "./words";

const SECONDS = 8;
const WIDTH = 300, TALL = 54;

export class Player {
  readonly element: HTMLElement;
  route: Route | null = null;
  at = 0;
  private readonly slider: HTMLInputElement;
  private readonly button: HTMLButtonElement;
  private readonly strips: HTMLElement;
  private readonly status: HTMLElement;
  private cursors: { line: SVGElement; text: HTMLElement; scalar: number }[] = [];
  private playing = 0;
  onMove: () => void = () => {};

  constructor(readonly set: EquilibriumSet) {
    const { routes } = set.words;
    this.button = h("button", { type: "button", click: () => this.toggle(), "aria-label": "Play the route" }, "▶ Play");
    this.slider = h("input", { type: "range", min: 0, max: 1000, value: 0, "aria-label": "Progress along the route", input: () => this.move(Number(this.slider.value) / 1000) });
    this.strips = h("div", { class: "strips" });
    this.status = h("p", { class: "verdict" });
    const choice = h("select", { "aria-label": "Route", change: () => this.choose(choice.selectedIndex) }, ...routes.map((each) => h("option", {}, each.name)));
    this.element = h("section", { class: "player", hidden: !routes.length }, h("h2", {}, "Route"),
      h("div", { class: "row" }, ...(routes.length > 1 ? [choice] : []), this.button, this.slider), this.status, this.strips);
    if (routes.length) this.choose(0);
  }

  choose(number_: number): void {
    this.route = this.set.words.routes[number_];
    const { status, why, margin, count, snaps, released } = this.route;
    const jumps = snaps.length ? ` It snaps ${snaps.length === 1 ? "once" : `${snaps.length} times`}, releasing ${released.map((x) => number(x, 3)).join(", ")}.` : "";
    this.status.textContent = status === "arrived" ? `Verified by equimorph${margin === null ? "" : `: smallest margin ${number(margin)}`}.${jumps}` : `Refused: ${why}.`;
    this.cursors = [];
    this.button.disabled = this.slider.disabled = !count;
    this.strips.replaceChildren(...(count ? this.scalars().map((scalar) => this.strip(scalar)) : []));
    this.at = 0;
    this.slider.value = "0";
  }

  private scalars(): number[] {
    return this.set.words.scalars.map((each, k) => ({ each, k })).filter(({ each }) => each.name === "stability_margin" || each.name === "lateral_margin" || each.name.startsWith("effort(")).map(({ k }) => k);
  }

  private strip(scalar: number): HTMLElement {
    const route = this.route!, { name, symbol, unit } = this.set.words.scalars[scalar];
    const values = route.at.map((_, k) => this.set.scalarAt(scalar, route.first + k));
    const low = Math.min(...values, name.includes("margin") ? 0 : Infinity), high = Math.max(...values), y = (x: number) => TALL - 4 - ((x - low) / (high - low || 1)) * (TALL - 8);
    let path = "";
    values.forEach((x, k) => { path += `${k && !route.snaps.includes(k - 1) ? "L" : "M"}${(route.at[k] * WIDTH).toFixed(1)} ${y(x).toFixed(1)}`; });
    const line = s("path", { class: "cursor" }), text = h("output");
    this.cursors.push({ line, text, scalar });
    const zero = low <= 0 && high >= 0 ? [s("path", { class: "zero", d: `M0 ${y(0)}H${WIDTH}` })] : [];
    const svg = s("svg", { viewBox: `0 0 ${WIDTH} ${TALL}`, preserveAspectRatio: "none", role: "img", "aria-label": `${symbol} along the route, from ${number(low)} to ${number(high)} ${unit}` },
      ...zero, ...route.snaps.map((k) => s("path", { class: "snap", d: `M${route.at[k] * WIDTH} 0V${TALL}` })), s("path", { class: "curve", d: path }), line);
    svg.addEventListener("pointerdown", (e: any) => { const r = svg.getBoundingClientRect(); this.move((e.clientX - r.left) / r.width); });
    return h("figure", {}, h("figcaption", {}, h("span", {}, label(name === "stability_margin" ? "stability margin" : symbol, unit)), text), svg as unknown as HTMLElement);
  }

  /** Nearest state of the list, and between two the nearer one. */
  get spot(): Spot | null {
    if (!this.route?.count) return null;
    return this.set.atState(this.route.first + this.step);
  }

  private get step(): number {
    const { at } = this.route!;
    let best = 0;
    for (let k = 1; k < at.length; k++) if (Math.abs(at[k] - this.at) <= Math.abs(at[best] - this.at)) best = k;
    return best;
  }

  move(at: number): void {
    this.at = Math.min(1, Math.max(0, at));
    this.slider.value = String(Math.round(1000 * this.at));
    this.slider.setAttribute("aria-valuetext", `${Math.round(100 * this.at)} percent`);
    const spot = this.spot;
    for (const { line, text, scalar } of this.cursors) {
      line.setAttribute("d", `M${(this.at * WIDTH).toFixed(1)} 0V${TALL}`);
      if (spot) text.textContent = number(this.set.scalar(scalar, spot));
    }
    this.onMove();
  }

  toggle(): void {
    if (this.playing) { cancelAnimationFrame(this.playing); this.playing = 0; }
    else if (this.route?.count) {
      if (this.at >= 1) this.at = 0;
      let last = performance.now();
      const go = (now: number) => {
        this.move(this.at + (now - last) / 1000 / SECONDS);
        last = now;
        this.playing = this.at < 1 ? requestAnimationFrame(go) : 0;
        this.name();
      };
      this.playing = requestAnimationFrame(go);
    }
    this.name();
  }

  private name(): void {
    this.button.textContent = this.playing ? "❚❚ Pause" : "▶ Play";
    this.button.setAttribute("aria-label", this.playing ? "Pause the route" : "Play the route");
  }
}
