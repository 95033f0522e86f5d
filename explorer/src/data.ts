/** What the page carries: words as JSON, and large arrays in one compressed text. */

export interface Parameter { name: string; unit: string; role: string; lower: number; upper: number; scale: number }
export interface Scalar { name: string; unit: string; symbol: string; low: number; step: number }
export interface Part { what: string; points: number; kind: string; distributed: boolean }
export interface Route {
  name: string; status: string; why: string; first: number; count: number; at: number[];
  corners: number[]; snaps: number[]; released: number[]; margin: number | null;
}
export interface Run { source: number; target: number; status: string }
export interface Barrier { kind: string; near: number; far: number; count: number; facets: number[][] }
export interface Stroke { outline: [number, number][]; filled: boolean }
export interface SupportSymbol { upright: boolean; away: boolean; strokes: Stroke[] }
export interface Obstacle { centre?: number[]; radius?: number; inside?: boolean; point?: number[]; normal?: number[] }

export interface Words {
  title: string; kind: string; audit: string; clean: boolean; unit: string; upward: string;
  space: 2 | 3; size: number; vertices: number; middles: number; parameters: Parameter[];
  fixed: { name: string; unit: string; value: number }[]; constraints: string[];
  obstacles: Obstacle[]; scalars: Scalar[]; elevation: string; layout: Part[]; fidelity: number;
  routes: Route[]; runs: Run[]; barriers: Barrier[]; rule: string;
  symbols: Record<string, SupportSymbol>; study: string; no_study: string;
  directory: { name: string; kind: string; rows: number; columns: number }[];
}

type Numbers = Uint8Array | Uint16Array | Int32Array | Float32Array;
/** Arrays by name, column after column. */
export type Arrays = Record<string, Numbers>;

const BYTES: Record<string, number> = { u8: 1, u16: 2, i32: 4, f32: 4 };

/** Read the words. */
export function readWords(): Words {
  return JSON.parse(document.getElementById("words")!.textContent!) as Words;
}

/** Unpack the arrays; see `equimorph.explorer.packing`. */
export async function readArrays(words: Words): Promise<Arrays> {
  const text = atob(document.getElementById("arrays")!.textContent!), packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const arrays: Arrays = {};
  let at = 0;
  for (const { name, kind, rows, columns } of words.directory) {
    const count = rows * columns, width = BYTES[kind];
    arrays[name] = unpack(bytes.subarray(at, at + count * width), kind, rows, columns);
    at += count * width;
  }
  return arrays;
}

function unpack(planes: Uint8Array, kind: string, rows: number, columns: number): Numbers {
  const count = rows * columns, width = BYTES[kind];
  const bytes = new Uint8Array(count * width);
  for (let plane = 0; plane < width; plane++)
    for (let i = 0; i < count; i++) bytes[i * width + plane] = planes[plane * count + i];
  if (kind === "f32") return new Float32Array(bytes.buffer);
  const numbers = kind === "u8" ? bytes : kind === "u16" ? new Uint16Array(bytes.buffer) : new Int32Array(bytes.buffer);
  // sums wrap around like the differences did
  for (let column = 0; column < columns; column++)
    for (let row = 1; row < rows; row++) numbers[column * rows + row] += numbers[column * rows + row - 1];
  return numbers;
}
