// The camera and the canvas: an orthographic look at a ball of given radius about the origin, drawn when something
// has changed and not otherwise.
import {Matrix4, OrthographicCamera, Quaternion, Scene, Vector3, WebGLRenderer} from "three";

const flight_ms = 600;

/** Turn of a camera that looks against `towards` (the direction to the viewer) with `up` upwards. */
export function looking(towards, up) {
  const z = new Vector3(...towards).normalize();
  let y = new Vector3(...up);
  if (y.clone().cross(z).lengthSq() < 1e-6) y = Math.abs(z.y) < 0.9 ? new Vector3(0, 1, 0) : new Vector3(1, 0, 0);
  const x = y.clone().cross(z).normalize();
  return new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(x, z.clone().cross(x), z));
}

export class View {
  /** Throws where there is no WebGL 2. `on_draw` is called after each picture. */
  constructor(canvas, radius, uniforms, on_draw) {
    this.canvas = canvas;
    this.radius = radius;
    this.uniforms = uniforms;
    this.on_draw = on_draw;
    this.renderer = new WebGLRenderer({canvas, antialias: true, alpha: true, powerPreference: "high-performance"});
    this.renderer.setClearColor(0, 0);
    this.scene = new Scene();
    this.camera = new OrthographicCamera(-1, 1, 1, -1, 0, 1);
    this.turn_now = new Quaternion();
    this.target = new Vector3();
    this.half = radius;  // half of the smaller side of the picture, in the specimen's unit
    this.width = 0;  // in CSS pixels, when it was last seen on a screen
    this.height = 0;
    this.asked = false;
    this.flight = null;
    this.waiting = [];
    canvas.addEventListener("webglcontextrestored", () => this.changed());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  resize() {
    const {clientWidth, clientHeight} = this.canvas.parentElement;
    if (!clientWidth || !clientHeight || matchMedia("print").matches) return;
    this.width = clientWidth;
    this.height = clientHeight;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.draw();  // at once: the canvas is empty now
  }

  /** Ask for a picture. */
  changed() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      this.step(now);
      this.draw();
      if (!this.asked) for (const done of this.waiting.splice(0)) done();
    });
  }

  /** Resolves when nothing moves any more. */
  settled() {
    return new Promise((done) => {
      this.waiting.push(done);
      this.changed();
    });
  }

  step(now) {
    if (!this.flight) return;
    const {begin, from, to} = this.flight;
    const t = Math.min(1, Math.max(0, (now - begin) / flight_ms));
    const s = t * t * (3 - 2 * t);
    this.turn_now.slerpQuaternions(from.turn, to.turn, s);
    this.target.lerpVectors(from.target, to.target, s);
    this.half = from.half * (to.half / from.half) ** s;
    if (t < 1) this.changed();
    else this.flight = null;
  }

  /** Smoothly to another look; at once for those who asked their system for less motion. */
  fly({turn, target, half}) {
    const to = {turn, target, half};
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.flight = null;
      this.turn_now.copy(turn);
      this.target.copy(target);
      this.half = half;
    } else {
      this.flight = {begin: performance.now(), to,
                     from: {turn: this.turn_now.clone(), target: this.target.clone(), half: this.half}};
    }
    this.changed();
  }

  pixels_per_unit() {
    return Math.min(this.width, this.height) / (2 * this.half);
  }

  /** The direction to the viewer, at the end of a flight. */
  towards() { return new Vector3(0, 0, 1).applyQuaternion(this.flight?.to.turn ?? this.turn_now); }

  /** By angles about the picture's vertical and horizontal axis. */
  turn(about_vertical, about_horizontal, about_sight = 0) {
    this.flight = null;
    const axis = (x, y, z, angle) => new Quaternion().setFromAxisAngle(new Vector3(x, y, z), angle);
    this.turn_now.multiply(axis(0, 1, 0, -about_vertical)).multiply(axis(1, 0, 0, -about_horizontal))
        .multiply(axis(0, 0, 1, about_sight)).normalize();
    this.changed();
  }

  /** The specimen moves by so many pixels to the right and down. */
  pan(right, down) {
    this.flight = null;
    const step = new Vector3(-right, down, 0).divideScalar(this.pixels_per_unit()).applyQuaternion(this.turn_now);
    this.target.add(step).clampLength(0, 3 * this.radius);
    this.changed();
  }

  /** Larger by `factor`; what is at x, y (pixels from the picture's middle, down) stays there. */
  zoom(factor, x = 0, y = 0) {
    const half = Math.min(4 * this.radius, Math.max(this.radius / 500, this.half / factor));
    const moved = 1 - this.half / half;
    this.half = half;
    this.pan(x * moved, y * moved);
  }

  place_camera() {
    const {width: w, height: h} = this;
    const unit = this.half / Math.min(w, h);
    const away = 1.05 * this.radius + this.target.length();
    const camera = this.camera;
    camera.quaternion.copy(this.turn_now);
    camera.position.set(0, 0, away).applyQuaternion(this.turn_now).add(this.target);
    camera.right = w * unit;
    camera.left = -camera.right;
    camera.top = h * unit;
    camera.bottom = -camera.top;
    camera.far = 2 * away;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
    const middle = away - this.target.clone().negate().applyQuaternion(this.turn_now.clone().invert()).z;
    this.uniforms.depths.value.set(middle - 0.6 * this.radius, middle + this.radius);
  }

  draw() {
    if (!this.width) return;
    this.place_camera();
    this.renderer.render(this.scene, this.camera);
    this.on_draw?.();
  }
}
