// Vectors, and a camera that looks at a point from an azimuth and an elevation.

const plus = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

// Nothing nearer to the eye is drawn, m.
const NEAR = 0.05;
// Focal length in heights of the picture: 30° from bottom to top.
const FOCAL = 1.87;

class Camera {
  constructor() {
    Object.assign(this, { target: [0, 0, 1], azimuth: 0, elevation: 0, distance: 5, width: 1, height: 1 });
  }
  resize(width, height) {
    this.width = width;
    this.height = height;
  }
  // Makes the axes of the picture ready: `out` towards the eye, `right` and `up` in the picture.
  aim() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    this.out = [ce * ca, ce * sa, se];
    this.right = [-sa, ca, 0];
    this.up = [-se * ca, -se * sa, ce];
    this.focal = FOCAL * this.height;
  }
  // Right, up and away from the eye, m.
  seen(p) {
    const d = plus(p, this.target, -1);
    return [dot(d, this.right), dot(d, this.up), this.distance - dot(d, this.out)];
  }
  // From what is seen to pixels; `scale` is pixels per metre there.
  pixel([x, y, depth]) {
    const scale = this.focal / depth;
    return { x: 0.5 * this.width + scale * x, y: 0.5 * this.height - scale * y, depth, scale };
  }
  // A point in pixels, or null if it is behind the eye or unknown.
  project(p) {
    const seen = this.seen(p);
    return seen[2] > NEAR ? this.pixel(seen) : null;
  }
  // A polygon or line in pixels, cut off where it comes behind the eye.
  outline(corners, closed) {
    const seen = corners.map((p) => this.seen(p)), cut = [];
    seen.forEach((a, k) => {
      if (a[2] > NEAR) cut.push(this.pixel(a));
      if (k + 1 === seen.length && !closed) return;
      const b = seen[(k + 1) % seen.length];
      if ((a[2] > NEAR) !== (b[2] > NEAR)) {
        const part = (NEAR - a[2]) / (b[2] - a[2]);
        cut.push(this.pixel([a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), NEAR]));
      }
    });
    return cut;
  }
  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = clamp(this.elevation + elevation, -0.5 * Math.PI, 0.5 * Math.PI);
  }
  // Moves what is looked at by pixels.
  shift(dx, dy) {
    const scale = this.distance / this.focal;
    this.target = plus(plus(this.target, this.right, -dx * scale), this.up, dy * scale);
  }
  zoom(factor, least, most) {
    this.distance = clamp(this.distance * factor, least, most);
  }
}
