/** Shaders of the sheets: their colour with the grid lines of the parameters, hatched by index, lit from the eye. */

export const VERTEX = `
attribute vec3 tint; attribute vec2 grid; varying vec3 vTint; varying vec2 vGrid; varying vec3 vNormal; varying vec3 vEye;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  vTint = tint; vGrid = grid; vNormal = normalMatrix * normal; vEye = -eye.xyz;
  gl_Position = projectionMatrix * eye;
}`;
export const FRAGMENT = `
uniform vec3 colour; uniform float own; uniform int hatch; uniform float dots;
varying vec3 vTint; varying vec2 vGrid; varying vec3 vNormal; varying vec3 vEye;
void main() {
  vec3 base = mix(colour, vTint, own);
  vec2 width = fwidth(vGrid) * 0.75, near = abs(fract(vGrid - 0.5) - 0.5);
  float line = 1.0 - min(smoothstep(0.0, width.x, near.x), smoothstep(0.0, width.y, near.y));
  base *= 1.0 - 0.16 * line;
  vec2 at = gl_FragCoord.xy / dots;
  float rising = step(6.2, mod(at.x + at.y, 8.0)), falling = step(6.2, mod(at.x - at.y, 8.0));
  if (hatch == 1) base *= 1.0 - 0.2 * rising;
  if (hatch == 2) base *= 1.0 - 0.2 * max(rising, falling);
  if (hatch > 2) base *= 1.0 - 0.22 * step(length(mod(at, 6.0) - 3.0), 1.2);
  float light = abs(dot(normalize(vNormal), normalize(normalize(vEye) + vec3(-0.25, 0.45, 0.1))));
  gl_FragColor = vec4(base * (0.5 + 0.55 * light), 1.0);
}`;
