/** The page: what is pinned, what is pointed at, and how clicks, drags and keys change that. */

import { Appearance } from "./appearance";
import { EnergyPanel } from "./energies";
import { indexName, PINS, ROUTE_COLOUR } from "./colours";
import { helpDialog, legend } from "./legend";
import type { End, EquilibriumSet, Landing, Spot } from "./set";
import { overlays } from "./overlays";
import { closest, equilibriaList, numbersTable, type Column } from "./panels";
import { Player } from "./player";
import { ShapePanel, type Portrait } from "./shape";
import { View, type Mark } from "./view";
import { Way } from "./way";
import { h, label, number, plain, withUnit } from "./words";

const LETTERS = "ABCDEF";
const NEAR = 18, CLICK = 5;
const ENDS: Record<End, string> = {
  arrived: "", fold: "Stopped at a fold: stability ends here.", "branch point": "Stopped at a branch point.", box: "Stopped at the edge of the box.",
  constraint: "Stopped at a constraint.", unresolved: "Stopped: the cells are too steep here.",
};

export class App {
  readonly view: View;
  readonly shape: ShapePanel;
  readonly player: Player;
  readonly energies: EnergyPanel;
  pins: { spot: Spot; letter: string }[] = [];
  current = -1;
  hover: Spot | null = null;
  landing: Landing | null = null;
  way: Way | null = null;
  private end: End = "arrived";
  private readonly numbers = h("div", { class: "numbers", tabindex: 0, role: "region", "aria-label": "Numbers" });
  private readonly list = h("div", { class: "list" });
  private readonly says = h("p", { class: "says", role: "status", "aria-live": "polite" });
  private readonly legend = h("div", { class: "legend" });
  private readonly wayPanel = h("section", { class: "way" });
  private readonly root = document.getElementById("explorer")!;
  private heightChoice!: HTMLSelectElement;
  private colourChoice!: HTMLSelectElement;
  private sliceSlider: HTMLInputElement | null = null;
  private sliceText = h("output");
  private goFields: HTMLInputElement[] = [];
  private above = false;
  private linkTimer = 0;
  private readonly appearance = new Appearance(() => this.view.setTheme(this.appearance.colours));

  constructor(readonly set: EquilibriumSet) {
    this.view = new View(set, this.appearance.colours);
    this.shape = new ShapePanel(set);
    this.player = new Player(set);
    this.energies = new EnergyPanel(set, this.shape, (p) => this.goToPoint(p), (spot) => this.stand(spot, "arrived", null));
    this.player.onMove = () => this.refresh();
    this.build();
    this.listen();
    new ResizeObserver(() => this.view.resize()).observe(this.view.element);
    this.readLink();
    if (!this.pins.length) this.pinFirst();
    this.drawOverlays();
    this.refresh();
  }

  // --- elements ---------------------------------------------------------------------------------

  private build(): void {
    const { words } = this.set;
    const box = words.parameters.map((p) => label(`${p.name} ∈ [${number(p.lower)}, ${number(p.upper)}]`, p.unit));
    const lead = [words.kind, ...box, ...words.constraints.map((each) => each.replace("<=", "≤").replace(">=", "≥"))].join(" · ");
    const scalars = words.scalars.map((each, k) => h("option", { value: k }, label(plain(each.name), each.unit)));
    this.heightChoice = h("select", { change: () => this.setHeight(Number(this.heightChoice.value)) }, ...scalars.map((each) => each.cloneNode(true)));
    this.heightChoice.value = String(this.view.height);
    this.colourChoice = h("select", { change: () => this.setColour(Number(this.colourChoice.value)) }, h("option", { value: -1 }, "index"), ...(this.set.d === 1 ? [] : scalars));
    const tools = h("div", { class: "tools" }, h("label", {}, "Height ", this.heightChoice), h("label", {}, "Colour ", this.colourChoice));
    if (this.set.d > 1) tools.append(h("button", { type: "button", click: () => this.lookAbove(!this.above) }, "From above / side"));
    if (this.set.d === 3) tools.append(this.slicer());
    const viewBox = h("div", { class: "view-box", tabindex: 0, role: "application", "aria-roledescription": "equilibrium set", "aria-label": `Equilibrium set over ${words.parameters.map((p) => p.name).join(" and ")}. Arrow keys walk on the sheet; question mark lists all keys.` }, this.view.element);
    const help = helpDialog();
    this.root.append(
      h("header", {}, h("div", {}, h("h1", {}, words.title), h("p", { class: "lead" }, lead)),
        h("div", { class: "row" }, h("button", { type: "button", click: () => this.switchAppearance() }, "Light / dark"), h("button", { type: "button", "aria-haspopup": "dialog", click: () => help.showModal() }, "Help"))),
      ...(words.clean ? [] : [h("p", { class: "verdict" }, `The audit of this set is not clean: ${words.audit}.`)]),
      h("div", { class: "stage" },
        h("section", { class: "left", "aria-label": "Set" }, tools, viewBox, this.legend),
        h("section", { class: "right", "aria-label": "Shape" }, this.shape.element, this.says)),
      h("div", { class: "below" },
        h("section", {}, h("h2", {}, "Numbers"), this.numbers),
        h("section", {}, h("h2", {}, "Equilibria here"), this.list, this.goTo()),
        h("div", { class: "routes" }, this.energies.element, this.player.element, this.wayPanel)),
      h("footer", {}, h("p", { class: "hint" }, `States between vertices are interpolated; pictures are within ${number(Math.max(words.fidelity, 1e-4), 1)} of the structure's size at vertices. Only equimorph, in Python, certifies a route. Nothing is loaded from the network.`)),
      help);
    this.drawLegend();
    this.drawWay();
  }

  private slicer(): HTMLElement {
    const { name, unit, lower, upper } = this.set.words.parameters[2];
    this.sliceSlider = h("input", { type: "range", min: lower, max: upper, step: (upper - lower) / 200, value: this.view.level!, "aria-label": label(name, unit), input: () => this.setLevel(Number(this.sliceSlider!.value)) });
    this.sliceText.textContent = number(this.view.level!);
    return h("label", { class: "slice" }, `${label(name, unit)} `, this.sliceSlider, this.sliceText);
  }

  private goTo(): HTMLElement {
    const inputs = this.set.words.parameters.map((p) => h("input", { type: "number", step: "any", min: p.lower, max: p.upper, "aria-label": label(p.name, p.unit) }));
    this.goFields = inputs;
    const form = h("form", { class: "row go", submit: (event: Event) => { event.preventDefault(); this.goToPoint(inputs.map((each) => Number(each.value))); } },
      ...inputs.flatMap((input, a) => [h("label", {}, `${this.set.words.parameters[a].name} `, input)]), h("button", { type: "submit" }, "Go there"));
    return form;
  }

  /** The fields of "Go there" show where the present pin stands. */
  private showPlace(): void {
    if (!this.spot) return;
    this.set.parameters(this.spot).forEach((x, a) => { this.goFields[a].value = String(Number(x.toPrecision(4))); });
  }

  private drawLegend(): void { this.legend.replaceChildren(...legend(this.set, this.view)); }

  // --- changes ----------------------------------------------------------------------------------

  setHeight(scalar: number): void { this.view.height = scalar; this.heightChoice.value = String(scalar); this.view.rebuild(); this.drawOverlays(); this.refresh(); }
  setColour(scalar: number): void { this.view.colour = scalar; this.colourChoice.value = String(scalar); this.view.rebuild(); this.drawLegend(); this.refresh(); }
  lookAbove(above: boolean): void { this.above = above; this.view.eye.look(above); }

  setLevel(level: number): void {
    const { lower, upper } = this.set.words.parameters[2];
    this.view.level = Math.min(upper, Math.max(lower, level));
    if (this.sliceSlider) this.sliceSlider.value = String(this.view.level);
    this.sliceText.textContent = number(this.view.level);
    this.view.rebuild();
    this.drawLegend();
    this.refresh();
  }

  private pinFirst(): void {
    const route = this.set.words.routes.find((each) => each.count);
    const first = route ? this.set.locate(this.set.atState(route.first), 0) : null;
    const middle = this.set.words.parameters.map((p) => (p.lower + p.upper) / 2);
    const found = first ? [first] : this.set.over(this.view.level === null ? middle : [...middle.slice(0, 2), this.view.level]);
    const anywhere = () => { const cell = this.set.cellIndex.findIndex((index) => index === 0); const n = this.set.d + 1; return this.set.inCell(Math.max(0, cell), Array(n).fill(1 / n)); };
    this.pin(found.find((each) => this.set.indexOf(each) === 0) ?? found[0] ?? anywhere());
  }

  /** Pin a state; beyond six the oldest goes. */
  pin(spot: Spot): void {
    if (this.pins.length === LETTERS.length) this.pins.shift();
    const letter = [...LETTERS].find((each) => this.pins.every((pin) => pin.letter !== each))!;
    this.pins.push({ spot, letter });
    this.current = this.pins.length - 1;
    this.stand(spot, "arrived", null);
  }

  unpin(number_: number): void {
    this.pins.splice(number_, 1);
    this.current = this.pins.length - 1;
    this.end = "arrived";
    this.landing = null;
    this.refresh();
  }

  get spot(): Spot | null { return this.pins[this.current]?.spot ?? null; }

  /** The present pin stands elsewhere. */
  private stand(spot: Spot, end: End, landing: Landing | null): void {
    this.pins[this.current].spot = spot;
    this.end = end;
    this.landing = landing;
    if (this.set.d === 3) {
      const level = this.set.parameters(spot)[2];
      if (Math.abs(level - this.view.level!) > 1e-9) { this.setLevel(level); return; }
    }
    this.refresh();
  }

  /** Walk the present pin towards other parameters, over stable cells. */
  walkTo(target: number[]): End {
    const from = this.spot;
    if (!from) return "unresolved";
    if (this.set.indexOf(from) !== 0) { this.tell("Unstable states cannot be held: choose a stable one to walk."); return "unresolved"; }
    const inside = target.map((x, a) => Math.min(this.set.words.parameters[a].upper, Math.max(this.set.words.parameters[a].lower, x)));
    const walk = this.set.walk(from, inside);
    this.stand(walk.spot, walk.end, this.set.landing(walk));
    return walk.end;
  }

  private step(axis: number, sign: number, fine: number): void {
    if (!this.spot || axis >= this.set.d) return;
    const p = this.set.parameters(this.spot), { lower, upper } = this.set.words.parameters[axis];
    p[axis] += sign * fine * (upper - lower);
    this.walkTo(p);
  }

  followSnap(): void {
    if (this.landing?.spot) this.stand(this.landing.spot, "arrived", null);
  }

  goToPoint(p: number[]): void {
    const bad = this.set.words.parameters.find(({ lower, upper }, a) => !(p[a] >= lower && p[a] <= upper));
    if (bad) { this.tell(`${bad.name} must lie between ${number(bad.lower)} and ${number(bad.upper)}.`); return; }
    const found = this.set.over(p);
    if (!found.length) { this.tell("No equilibria of the set over this point."); return; }
    const like = this.spot ? closest(this.set, found, this.spot) : 0;
    const chosen = found[like];
    if (this.pins.length) this.stand(chosen, "arrived", null); else this.pin(chosen);
  }

  private next(): void {
    if (!this.spot) return;
    const found = this.set.over(this.set.parameters(this.spot));
    if (found.length) this.stand(found[(closest(this.set, found, this.spot) + 1) % found.length], "arrived", null);
  }

  // --- ways -------------------------------------------------------------------------------------

  beginWay(): void {
    if (!this.spot || this.set.indexOf(this.spot) !== 0) { this.tell("A way begins at a stable state: choose one."); return; }
    this.way = new Way(this.set, this.spot);
    this.drawWay();
    this.refresh();
  }

  leadWay(target: number[]): void {
    if (!this.way || this.way.blocked) return;
    this.way.add(target);
    this.drawWay();
    this.drawOverlays();
    this.refresh();
  }

  private drawWay(): void {
    const { words } = this.set, way = this.way;
    const button = (text: string, click: () => void, disabled = false) => h("button", { type: "button", click, disabled }, text);
    const title = h("h2", {}, "Draw a way");
    if (!way) {
      this.wayPanel.replaceChildren(title, h("p", { class: "hint" }, "Begin at the present pin, then click way-points on the surface."), h("div", { class: "row" }, button("Begin here", () => this.beginWay())));
      return;
    }
    const inputs = words.parameters.map((p, a) => h("input", { type: "number", step: "any", min: p.lower, max: p.upper, value: Number(this.set.parameters(way.end)[a].toPrecision(4)), "aria-label": `Way-point ${label(p.name, p.unit)}` }));
    const form = h("form", { class: "row go", submit: (e: Event) => { e.preventDefault(); this.leadWay(inputs.map((each) => Number(each.value))); } },
      ...inputs.flatMap((input, a) => [h("label", {}, `${words.parameters[a].name} `, input)]), h("button", { type: "submit" }, "Add"));
    const legs = way.legs.map((leg) => h("li", {}, `${leg.target.map((x, a) => `${words.parameters[a].name} ${number(x, 3)}`).join(", ")}: ${leg.end === "arrived" ? `margin ≥ about ${number(leg.margin, 3)}` : leg.end}`));
    this.wayPanel.replaceChildren(title, h("p", { class: `verdict coarse ${way.blocked ? "refused" : ""}` }, h("strong", {}, "Coarse: "), way.verdict()), h("ol", { class: "legs" }, ...legs), form,
      h("div", { class: "row" }, button("Remove the last", () => { way.remove(); this.drawWay(); this.drawOverlays(); this.refresh(); }, !way.legs.length),
        button("Export study", () => this.exportWay(), !way.legs.length || !words.study), button("End", () => { this.way = null; this.drawWay(); this.drawOverlays(); this.refresh(); })),
      h("p", { class: "hint" }, words.study ? "Only equimorph certifies: run the exported study, equimorph run drawn.toml." : `No study can be exported: ${words.no_study}`));
  }

  exportWay(): void {
    const link = h("a", { download: "drawn.toml", href: URL.createObjectURL(new Blob([this.way!.study()], { type: "text/plain" })) });
    link.click();
  }

  private drawOverlays(): void { this.view.setOverlays(overlays(this.set, this.way)); }

  // --- what is shown ----------------------------------------------------------------------------

  /** Bring everything in step with what is chosen. */
  refresh(): void {
    const marks: Mark[] = [], portraits: Portrait[] = [], columns: Column[] = [];
    this.pins.forEach(({ spot, letter }, k) => {
      const { colour, dash } = PINS[LETTERS.indexOf(letter)];
      marks.push({ spot, text: letter, colour, title: `Pin ${letter}`, kind: k === this.current ? "pin current" : "pin" });
      portraits.push({ spot, colour, dash, main: k === this.current && !this.hover, name: `pin ${letter}` });
      columns.push({ name: letter, colour, spot, exact: spot.corners.length === 1 });
    });
    const ghost = (spot: Spot, name: string, colour: string, text: string, exact = false) => {
      marks.push({ spot, text, colour, title: name, kind: "ghost" });
      portraits.push({ spot, colour, dash: "3 3", main: name === "pointer", name });
      columns.push({ name, colour, spot, exact });
    };
    if (this.landing?.spot) ghost(this.landing.spot, "landing", "#b3261e", "✶");
    const route = this.player.at > 0 ? this.player.spot : null;
    if (route) ghost(route, "route", ROUTE_COLOUR, "●", true);
    if (this.hover) ghost(this.hover, "pointer", "#444444", "○");
    (this.way ? [this.way.start, ...this.way.legs.map((leg) => leg.to)] : []).forEach((spot, k) => marks.push({ spot, text: String(k), colour: "#0b7a75", title: `Way-point ${k}`, kind: "way" }));
    this.view.setMarks(marks);
    const shown = this.spot ?? route;
    if (shown && !this.hover) this.energies.show(shown);
    this.shape.show(portraits);
    this.numbers.replaceChildren(numbersTable(this.set, columns, (k) => this.unpin(k)));
    if (this.spot && !this.hover) {
      this.showPlace();
      const snap = this.landing?.spot ? [h("button", { type: "button", click: () => this.followSnap() }, "Follow the snap")] : [];
      this.list.replaceChildren(equilibriaList(this.set, this.spot, this.view.height, (spot) => this.stand(spot, "arrived", null)), ...snap);
    }
    if (!this.hover) this.tell(this.describe());
    this.link();
  }

  private describe(): string {
    if (!this.spot) return "No state is chosen.";
    const { set, spot } = this, p = set.parameters(spot).map((x, a) => `${set.words.parameters[a].name} ${number(x)}`).join(", ");
    const words = [`${this.pins[this.current].letter}: ${indexName(set.indexOf(spot))} at ${p}.`, ENDS[this.end]];
    const unit = set.words.scalars[set.named("energy")].unit, { landing } = this;
    if (landing?.spot) words.push(`A snap lands on the red state and releases about ${withUnit(number(landing.released, 3), unit)}.`);
    else if (landing) words.push(landing.status === "held" ? "Nothing moves from here." : `A snap leads out of the set (${landing.status}).`);
    return words.filter(Boolean).join(" ");
  }

  private tell(text: string): void { if (this.says.textContent !== text) this.says.textContent = text; }

  // --- pointers and keys ------------------------------------------------------------------------

  private listen(): void {
    const box = this.view.element.parentElement!;
    let down: [number, number] | null = null, walking = false, moved = false, last: [number, number] = [0, 0], waiting = 0;
    const at = (e: PointerEvent): [number, number] => { const r = this.view.element.getBoundingClientRect(); return [e.clientX - r.left, e.clientY - r.top]; };
    box.addEventListener("pointerdown", (e) => {
      down = last = at(e);
      moved = false;
      const spot = this.spot, here = spot && this.view.eye.project(this.view.position(spot));
      walking = !!here && Math.hypot(here[0] - down[0], here[1] - down[1]) < NEAR;
      this.view.eye.controls.enabled = !walking;
      if (walking) box.setPointerCapture(e.pointerId);
    }, true);
    box.addEventListener("pointermove", (e) => {
      const now = at(e);
      if (down && Math.hypot(now[0] - down[0], now[1] - down[1]) > CLICK) moved = true;
      if (walking && moved && this.spot) {
        const here = this.view.eye.project(this.view.position(this.spot)), step = this.view.stepFor(this.spot, now[0] - here[0], now[1] - here[1]);
        this.walkTo(this.set.parameters(this.spot).map((x, a) => x + step[a]));
      } else if (!down && e.pointerType !== "touch") {
        last = now;
        if (!waiting) waiting = requestAnimationFrame(() => { waiting = 0; this.pointAt(this.view.pick(...last)); });
      }
    });
    const up = (e: PointerEvent) => {
      if (down && !moved) this.click(this.view.pick(...at(e)), walking);
      down = null;
      walking = false;
      this.view.eye.controls.enabled = true;
    };
    box.addEventListener("pointerup", up);
    box.addEventListener("pointercancel", () => { down = null; walking = false; this.view.eye.controls.enabled = true; });
    box.addEventListener("pointerleave", () => { if (!down) this.pointAt(null); });
    box.addEventListener("keydown", (e) => { if (e.target === box && this.key(e)) e.preventDefault(); });
    window.addEventListener("hashchange", () => { this.readLink(); this.refresh(); });
  }

  private pointAt(spot: Spot | null): void {
    if (!spot && !this.hover) return;
    this.hover = spot;
    this.refresh();
  }

  private click(spot: Spot | null, onPin: boolean): void {
    this.hover = null;
    if (this.way && spot) this.leadWay(this.set.parameters(spot));
    else if (spot && !onPin) this.pin(spot);
    else this.refresh();
  }

  /** Whether a key means something. */
  private key(e: KeyboardEvent): boolean {
    const arrows: Record<string, [number, number]> = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowDown: [1, -1], ArrowUp: [1, 1], PageDown: [2, -1], PageUp: [2, 1] };
    const arrow = arrows[e.key];
    if (e.ctrlKey || e.metaKey) return false;
    if (arrow && e.shiftKey) this.view.eye.turn(arrow[0] === 0 ? -0.1 * arrow[1] : 0, arrow[0] === 1 ? 0.1 * arrow[1] : 0);
    else if (arrow) this.step(arrow[0], arrow[1], e.altKey ? 0.001 : 0.01);
    else {
      const actions: Record<string, () => void> = {
        "+": () => this.view.eye.zoom(1.15), "=": () => this.view.eye.zoom(1.15), "-": () => this.view.eye.zoom(1 / 1.15), n: () => this.next(), s: () => this.followSnap(),
        Enter: () => { if (this.spot) this.pin(this.spot); }, Delete: () => { if (this.current >= 0) this.unpin(this.current); }, " ": () => this.player.toggle(),
        w: () => { if (!this.way) this.beginWay(); else if (this.spot) this.leadWay(this.set.parameters(this.spot)); },
        v: () => this.lookAbove(!this.above), "?": () => this.root.querySelector("dialog")!.showModal(),
      };
      const action = actions[e.key.length === 1 ? e.key.toLowerCase() : e.key];
      action?.();
      return !!action;
    }
    return true;
  }

  // --- appearance and links ---------------------------------------------------------------------

  private switchAppearance(): void { this.appearance.change(); this.view.setTheme(this.appearance.colours); this.link(); }

  /** A state in the address: parameters, and its place among the equilibria over them. */
  private stateText(spot: Spot): string {
    const p = this.set.parameters(spot), found = this.set.over(p);
    return [...p.map((x) => Number(x.toPrecision(7))), closest(this.set, found, spot)].join(",");
  }

  get linkText(): string {
    const link = new URLSearchParams(), { set, view } = this;
    link.set("pins", this.pins.map(({ spot }) => this.stateText(spot)).join(";"));
    link.set("height", set.words.scalars[view.height].name);
    if (view.colour >= 0) link.set("colour", set.words.scalars[view.colour].name);
    if (view.level !== null) link.set("slice", String(Number(view.level.toPrecision(6))));
    if (this.player.at > 0) link.set("route", `${this.set.words.routes.indexOf(this.player.route!)},${this.player.at.toFixed(3)}`);
    link.set("camera", view.cameraText);
    if (this.appearance.chosen) link.set("theme", this.appearance.chosen);
    return link.toString();
  }

  private link(): void {
    clearTimeout(this.linkTimer);
    this.linkTimer = window.setTimeout(() => history.replaceState(null, "", `#${this.linkText}`), 300);
  }

  private readLink(): void {
    const link = new URLSearchParams(location.hash.slice(1)), { set } = this, n = set.d;
    const scalar = (name: string | null) => (name === null ? -1 : set.named(name));
    if (scalar(link.get("height")) >= 0) this.setHeight(scalar(link.get("height")));
    if (scalar(link.get("colour")) >= 0 && n > 1) this.setColour(scalar(link.get("colour")));
    if (link.get("slice") && n === 3 && Number.isFinite(Number(link.get("slice")))) this.setLevel(Number(link.get("slice")));
    const pins = (link.get("pins") ?? "").split(";").map((text) => text.split(",").map(Number)).filter((each) => each.length === n + 1 && each.every(Number.isFinite));
    const spots = pins.map((each) => set.over(each.slice(0, n))[each[n]]).filter(Boolean);
    if (spots.length) { this.pins = []; for (const spot of spots.slice(0, LETTERS.length)) this.pin(spot); }
    if (link.get("camera")) this.view.cameraText = link.get("camera")!;
    const [number_, at] = (link.get("route") ?? "").split(",").map(Number);
    if (set.words.routes[number_]?.count && at > 0) { this.player.choose(number_); this.player.move(at); }
  }
}
