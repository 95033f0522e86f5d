/** What colours and lines mean, and what keys do. */

import { INDEX_COLOURS, indexColour, indexName, scaleGradient } from "./colours";
import type { EquilibriumSet } from "./set";
import type { View } from "./view";
import { h, label, number, plain } from "./words";

/** Entries for what is drawn of a set. */
export function legend(set: EquilibriumSet, view: View): HTMLElement[] {
  const present = [...new Set(set.cellIndex)].sort((a, b) => a - b);
  const item = (swatch: HTMLElement, text: string) => h("span", { class: "entry" }, swatch, text);
  const entries: HTMLElement[] = [];
  const most = set.d === 1 ? 2 : INDEX_COLOURS.length - 1;
  const named = (index: number) => (index === most && present.some((each) => each > most) ? `index ${most} and more` : indexName(index));
  const mark = (index: number) => (set.d === 1 ? h("span", { class: `stroke branch${index}`, style: `--index: ${indexColour(index)}` })
    : h("span", { class: `swatch hatch${index}`, style: `--index: ${indexColour(index)}` }));
  if (view.colour < 0) for (const index of new Set(present.map((each) => Math.min(most, each)))) entries.push(item(mark(index), named(index)));
  else {
    const [low, high] = view.colourRange(), { name, unit } = set.words.scalars[view.colour];
    entries.push(h("span", { class: "entry scale" }, number(low, 3), h("span", { class: "bar", style: `background: ${scaleGradient()}` }), `${number(high, 3)} ${label(plain(name), unit)}; hatched: unstable`));
  }
  const lines: [boolean, string, string][] = [
    [view.sheet.lines.stability.length > 0 && set.d > 1, "stability", "edge of stability"], [view.sheet.lines.fold.length > 0 && set.d > 1, "fold", "other folds"],
    [view.sheet.lines.crossing.length > 0, "crossing", "branch points"], [view.sheet.lines.constraint.length > 0, "constraint", "constraint"],
    [set.words.routes.some((each) => each.count), "route", "route"], [set.words.barriers.length > 0, "barrier", `barriers${set.words.rule ? ` (${set.words.rule})` : ""}`],
  ];
  for (const [is, kind, text] of lines) if (is) entries.push(item(h("span", { class: `stroke ${kind}` }), text));
  return entries;
}

/** How the page is used. */
export function helpDialog(): HTMLDialogElement {
  const keys: [string, string][] = [
    ["← → ↑ ↓", "walk on the sheet in the first and second parameter, over stable cells only"], ["Page ↑ ↓", "the same in the third parameter"], ["Shift + arrows", "turn the set"], ["+ −", "nearer, farther"],
    ["N", "next equilibrium over the same parameters"], ["S", "follow the snap from a fold to where it lands"], ["Enter", "pin the present state once more, to compare"], ["Delete", "remove the pin"],
    ["W", "begin a way here, or lead it to the present state"], ["Space", "play or pause the route"], ["V", "from above or from the side"],
  ];
  const dialog = h("dialog", { "aria-label": "Help" }, h("h2", {}, "Help"),
    h("p", {}, "Point at the set to see the shape of a state; click to pin it. Drag the ring of the present pin: it walks on the sheet and stops where stability ends. Drag anything else to turn the set."),
    h("dl", {}, ...keys.flatMap(([key, what]) => [h("dt", {}, h("kbd", {}, key)), h("dd", {}, what)])),
    h("button", { type: "button", click: () => dialog.close() }, "Close"));
  return dialog;
}
