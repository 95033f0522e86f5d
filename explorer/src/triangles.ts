/** Triangles in space: their normals, and the first one on a ray. */

/** Normals at points: of the triangles around them, by their areas; over the parameters sheets turn over with their index. */
export function normals(x: Float32Array, t: Int32Array, odd: (triangle: number) => boolean): Float32Array {
  const out = new Float32Array(x.length);
  for (let i = 0; i < t.length; i += 3) {
    const [a, b, c] = [3 * t[i], 3 * t[i + 1], 3 * t[i + 2]];
    const [ux, uy, uz] = [x[b] - x[a], x[b + 1] - x[a + 1], x[b + 2] - x[a + 2]], [vx, vy, vz] = [x[c] - x[a], x[c + 1] - x[a + 1], x[c + 2] - x[a + 2]];
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const side = n[1] < 0 === odd(i / 3) ? 1 : -1;
    for (const k of [a, b, c]) for (let j = 0; j < 3; j++) out[k + j] += side * n[j];
  }
  return out;
}

/** Nearest triangle on a ray, with the weights of its corners. */
export function firstHit(x: Float32Array, t: Int32Array, o: number[], d: number[]): { triangle: number; weights: number[] } | null {
  let best = Infinity, found: { triangle: number; weights: number[] } | null = null;
  const [ox, oy, oz] = o, [dx, dy, dz] = d;
  for (let i = 0; i < t.length; i += 3) {
    const a = 3 * t[i], b = 3 * t[i + 1], c = 3 * t[i + 2];
    const ux = x[b] - x[a], uy = x[b + 1] - x[a + 1], uz = x[b + 2] - x[a + 2], vx = x[c] - x[a], vy = x[c + 1] - x[a + 1], vz = x[c + 2] - x[a + 2];
    const px = dy * vz - dz * vy, py = dz * vx - dx * vz, pz = dx * vy - dy * vx, det = ux * px + uy * py + uz * pz;
    if (det === 0) continue;
    const sx = ox - x[a], sy = oy - x[a + 1], sz = oz - x[a + 2], u = (sx * px + sy * py + sz * pz) / det;
    if (u < 0 || u > 1) continue;
    const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux, v = (dx * qx + dy * qy + dz * qz) / det;
    if (v < 0 || u + v > 1) continue;
    const along = (vx * qx + vy * qy + vz * qz) / det;
    if (along > 0 && along < best) { best = along; found = { triangle: i / 3, weights: [1 - u - v, u, v] }; }
  }
  return found;
}
