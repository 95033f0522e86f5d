/** The numbers of the states that are shown, and the list of all equilibria over one point. */

import { indexColour, indexName } from "./colours";
import type { EquilibriumSet, Spot } from "./set";
import { h, number, plain, withUnit } from "./words";

export interface Column { name: string; colour: string; spot: Spot; exact: boolean }

/** Table with one column for each state; headings of columns are letters. */
export function numbersTable(set: EquilibriumSet, columns: Column[], remove: (column: number) => void): HTMLElement {
  if (!columns.length) return h("p", { class: "hint" }, "Point at the set to see a state here; click to pin it.");
  const rows: HTMLElement[] = [];
  const row = (name: string, unit: string, values: string[]) =>
    rows.push(h("tr", {}, h("th", { scope: "row" }, name, ...(unit && unit !== "1" ? [" ", h("span", { class: "unit" }, `(${unit})`)] : [])), ...values.map((value) => h("td", {}, value))));
  set.words.parameters.forEach(({ name, unit }, a) => row(name, unit, columns.map(({ spot }) => number(set.parameters(spot)[a]))));
  for (const { name, unit, value } of set.words.fixed) row(name, unit, columns.map(() => number(value)));
  row("index", "", columns.map(({ spot }) => { const index = set.indexOf(spot); return index === 0 ? "0, stable" : `${index}, unstable`; }));
  set.words.scalars.forEach(({ name, symbol, unit }, k) => {
    const words = plain(name);
    row(words === symbol || name === words ? words : symbol, unit, columns.map(({ spot }) => number(set.rounded(k, spot))));
  });
  row("source", "", columns.map(({ exact }) => (exact ? "computed" : "interpolated")));
  const heads = columns.map(({ name, colour }, k) =>
    h("th", { scope: "col" }, h("span", { class: "letter", style: `--mark: ${colour}` }, name), ...(name.length === 1
      ? [h("button", { type: "button", class: "small", "aria-label": `Remove ${name}`, click: () => remove(k) }, "×")] : [])));
  return h("table", {}, h("caption", { class: "unseen" }, "Numbers of the states shown"),
    h("thead", {}, h("tr", {}, h("td"), ...heads)), h("tbody", {}, ...rows));
}

/** Buttons that jump to every equilibrium over the parameters of a state. */
export function equilibriaList(set: EquilibriumSet, here: Spot, height: number, jump: (spot: Spot) => void): HTMLElement {
  const found = set.over(set.parameters(here)), { symbol, unit } = set.words.scalars[height];
  const nearest = closest(set, found, here);
  const stable = found.filter((each) => set.indexOf(each) === 0).length;
  const items = found.map((spot, k) => {
    const index = set.indexOf(spot);
    return h("li", {}, h("button", { type: "button", "aria-pressed": k === nearest ? "true" : "false", click: () => jump(spot) },
      h("span", { class: `swatch hatch${Math.min(3, index)}`, style: `--index: ${indexColour(index)}` }),
      `${indexName(index)}: ${symbol} = ${withUnit(number(set.rounded(height, spot), 3), unit)}`));
  });
  return h("div", {}, h("p", {}, `${found.length} over these parameters, ${stable} stable, by energy:`), h("ol", { class: "equilibria" }, ...items));
}

/** Which of some spots looks most like a state. */
export function closest(set: EquilibriumSet, found: Spot[], here: Spot): number {
  let best = -1, least = Infinity;
  found.forEach((each, k) => {
    const gap = set.unlike(each, here) + (here.cell >= 0 && set.indexOf(each) !== set.indexOf(here) ? 1e-3 * set.words.size : 0);
    if (gap < least) { least = gap; best = k; }
  });
  return best;
}
