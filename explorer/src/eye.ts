/** Where the set is seen from: the camera, what turns and moves it, and where places are in the picture. */

import { OrthographicCamera, PerspectiveCamera, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

/** Sides of the box in which the set is drawn: the parameters, and the height. */
export const SIDES = [1.2, 1.3], TALL = 0.85;
/** Where the set is seen from: from the side, and from above as a map of the parameters. */
const ASIDE = new Vector3(-2.1, 1.6, -3), ABOVE = new Vector3(0.0005, 4, 0.005);
/** Shares of the picture that stay free for labels: at the sides and above, and below. */
const ROOM = 0.14, BELOW = 0.2;

export class Eye {
  readonly camera: PerspectiveCamera | OrthographicCamera;
  readonly controls: OrbitControls;
  private width = 0;
  private height = 0;

  /** `flat`: a diagram in the plane, which is moved but not turned. `changed`: called after every change. */
  constructor(canvas: HTMLCanvasElement, flat: boolean, private readonly changed: () => void) {
    this.camera = flat ? new OrthographicCamera() : new PerspectiveCamera(30, 1, 0.05, 50);
    this.camera.position.copy(flat ? new Vector3(0, TALL / 2, 5) : ASIDE);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.target.set(0, flat ? TALL / 2 : 0.36, 0);
    this.controls.enableDamping = false;
    this.controls.enableRotate = !flat;
    this.controls.update();
    this.controls.addEventListener("change", changed);
  }

  resize(width: number, height: number): void {
    const first = !this.width;
    this.width = width;
    this.height = height;
    if (this.camera instanceof OrthographicCamera) {
      const half = Math.max(0.56, (0.76 * height) / width), across = (half * width) / height;
      Object.assign(this.camera, { left: -across, right: across, top: half, bottom: -half });
    } else {
      this.camera.aspect = width / height;
      // the whole box stays in sight in narrow windows
      this.camera.fov = width >= height ? 30 : 2 * (180 / Math.PI) * Math.atan(Math.tan((15 * Math.PI) / 180) * (height / width));
    }
    this.camera.updateProjectionMatrix();
    if (first) this.fit();
  }

  /** Pixels of a drawn place. */
  project(at: [number, number, number]): [number, number] {
    const v = new Vector3(...at).project(this.camera);
    return [((v.x + 1) / 2) * this.width, ((1 - v.y) / 2) * this.height];
  }

  /** The line of sight through a pixel: its nearest point, and the way from there to the farthest. */
  ray(x: number, y: number): [number[], number[]] {
    const at = (depth: number) => new Vector3((2 * x) / this.width - 1, 1 - (2 * y) / this.height, depth).unproject(this.camera);
    const near = at(-1);
    return [near.toArray(), at(1).sub(near).toArray()];
  }

  /** Look from above (a map of the parameters) or from the side. */
  look(above: boolean): void {
    this.camera.position.copy(above ? ABOVE : ASIDE);
    this.controls.target.set(0, TALL / 2, 0);
    this.controls.update();
    this.fit();
    this.changed();
  }

  /** Move the camera so that the box fills the picture, with room for labels. */
  private fit(): void {
    if (!(this.camera instanceof PerspectiveCamera)) return;
    const [x, z] = [SIDES[0] / 2, SIDES[1] / 2];
    for (let pass = 0; pass < 6; pass++) {
      this.camera.updateMatrixWorld();
      const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => new Vector3(k & 1 ? x : -x, k & 2 ? TALL : 0, k & 4 ? z : -z).project(this.camera));
      const [left, right] = [Math.min(...corners.map((c) => c.x)), Math.max(...corners.map((c) => c.x))];
      const [low, high] = [Math.min(...corners.map((c) => c.y)), Math.max(...corners.map((c) => c.y))];
      const scale = Math.max((right - left) / (2 - 2 * ROOM), (high - low) / (2 - ROOM - BELOW));
      const away = this.camera.position.clone().sub(this.controls.target), tall = away.length() * Math.tan((this.camera.fov * Math.PI) / 360);
      const shift = new Vector3(((left + right) / 2) * tall * this.camera.aspect, ((low + high + ROOM - BELOW) / 2) * tall, 0).applyQuaternion(this.camera.quaternion);
      this.controls.target.add(shift);
      this.camera.position.copy(this.controls.target).add(away.multiplyScalar(scale));
      this.controls.update();
    }
  }

  turn(right: number, up: number): void {
    const at = this.camera.position.clone().sub(this.controls.target), r = at.length();
    const polar = Math.min(Math.PI - 0.05, Math.max(0.02, Math.acos(at.y / r) - up)), azimuth = Math.atan2(at.x, at.z) + right;
    at.set(r * Math.sin(polar) * Math.sin(azimuth), r * Math.cos(polar), r * Math.sin(polar) * Math.cos(azimuth));
    this.camera.position.copy(at.add(this.controls.target));
    this.controls.update();
    this.changed();
  }

  zoom(factor: number): void {
    if (this.camera instanceof OrthographicCamera) { this.camera.zoom *= factor; this.camera.updateProjectionMatrix(); }
    else this.camera.position.sub(this.controls.target).divideScalar(factor).add(this.controls.target);
    this.controls.update();
    this.changed();
  }

  get text(): string {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray(), this.camera.zoom].map((x) => Number(x.toFixed(3))).join(",");
  }
  set text(text: string) {
    const [x, y, z, tx, ty, tz, zoom] = text.split(",").map(Number);
    if (![x, y, z, tx, ty, tz, zoom].every(Number.isFinite)) return;
    this.camera.position.set(x, y, z);
    this.controls.target.set(tx, ty, tz);
    this.camera.zoom = zoom;
    this.camera.updateProjectionMatrix();
    this.controls.update();
  }
}
