/** Colours that colour-blind readers tell apart; whatever they say, a second mark says, too. */

export const INDEX_COLOURS = ["#1f5f99", "#e8902a", "#f3d65c", "#dcdcdc"];
export const ROUTE_COLOUR = "#d1004b";
/** Colours and dashes of pinned states. */
export const PINS = [
  { colour: "#d1004b", dash: "" }, { colour: "#0b7a75", dash: "7 4" }, { colour: "#7b3fa0", dash: "2 3" },
  { colour: "#9a6700", dash: "9 3 2 3" }, { colour: "#3b6ea5", dash: "4 2" }, { colour: "#5c5c5c", dash: "1 2 4 2" },
];

export function indexColour(index: number): string { return INDEX_COLOURS[Math.min(index, INDEX_COLOURS.length - 1)]; }
export function indexName(index: number): string { return index === 0 ? "stable" : `index ${index}`; }

/** Stops of the scale cividis, from dark blue to yellow. */
const STOPS = [[0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]];

/** Red, green and blue, 0 to 1, for a share of the scale. */
export function scaleColour(share: number): [number, number, number] {
  const at = Math.min(1, Math.max(0, share)) * (STOPS.length - 1), k = Math.min(STOPS.length - 2, Math.floor(at)), t = at - k;
  return [0, 1, 2].map((c) => ((1 - t) * STOPS[k][c] + t * STOPS[k + 1][c]) / 255) as [number, number, number];
}

export function scaleGradient(): string {
  return `linear-gradient(to right, ${STOPS.map((c) => `rgb(${c.join(" ")})`).join(", ")})`;
}

export function rgb(hex: string): [number, number, number] {
  return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255) as [number, number, number];
}
