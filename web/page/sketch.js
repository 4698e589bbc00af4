// The sketch of load cell and IMU: two sets of axes in parallel perspective, the IMU's turned and placed as the rig file says.

const NS = "http://www.w3.org/2000/svg";
const AXES = ["x", "y", "z"];

/** Product of two rotation matrices, as lists of rows. */
const times = (a, b) => a.map((row) => b[0].map((_, k) => row.reduce((sum, x, n) => sum + x * b[n][k], 0)));

export const IDENTITY = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

/** A turn by a right angle about an axis of the load cell, applied to an orientation. */
export function turned(rotation, axis) {
  const [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
  const turn = IDENTITY.map((row) => [...row]);
  turn[a][a] = turn[b][b] = 0;
  turn[a][b] = -1;
  turn[b][a] = 1;
  return times(turn, rotation);
}

/** The quaternion w, x, y, z of a rotation matrix; w is not negative. */
export function quaternion(m) {
  const trace = m[0][0] + m[1][1] + m[2][2];
  // The largest of the four is divided by: no root of a number near zero.
  const squares = [trace, m[0][0], m[1][1], m[2][2]];
  const largest = squares.indexOf(Math.max(...squares));
  let q;
  if (largest === 0) {
    q = [1 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]];
  } else {
    const i = largest - 1;
    const [j, k] = [(i + 1) % 3, (i + 2) % 3];
    q = [m[k][j] - m[j][k], 0, 0, 0];
    q[1 + i] = 1 + m[i][i] - m[j][j] - m[k][k];
    q[1 + j] = m[j][i] + m[i][j];
    q[1 + k] = m[k][i] + m[i][k];
  }
  const sign = q[0] < 0 ? -1 : 1;
  const length = sign * Math.hypot(...q);
  return q.map((value) => value / length + 0);
}

/** Which way each axis of the IMU points, in words: "x along +y of the load cell". */
export function words(rotation) {
  return AXES.map((name, k) => {
    const column = rotation.map((row) => row[k]);
    const along = column.findIndex((x) => Math.abs(x) > 0.9);
    return along < 0 ? `${name} between axes` : `${name} along ${column[along] < 0 ? "−" : "+"}${AXES[along]}`;
  }).join(", ");
}

/** A point of the load cell's axes on the paper: x to the lower left, y to the right, z up. */
const project = ([x, y, z]) => [y - 0.5 * x, -z + 0.35 * x];

function element(name, attributes, text) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

function axes(svg, [cx, cy], rotation, length, name, nameY) {
  for (const [k, axis] of AXES.entries()) {
    const [dx, dy] = project(rotation.map((row) => row[k])).map((value) => value * length);
    svg.append(element("line", { x1: cx, y1: cy, x2: cx + dx, y2: cy + dy, class: `axis s${k}`, "marker-end": `url(#tip${k})` }));
    const far = 1.2 + 6 / Math.max(length, 1);
    svg.append(element("text", { x: cx + dx * far, y: cy + dy * far + 4, class: "mid" }, axis));
  }
  // Below all that an axis and its name can reach.
  svg.append(element("text", { x: cx, y: nameY, class: "mid name" }, name));
}

/** Draws the sketch into an SVG element. `position_m` is the IMU's origin in the axes of the load cell; null: there is none. */
export function draw(svg, rotation, position_m) {
  svg.replaceChildren();
  const defs = element("defs", {});
  for (const k of [0, 1, 2]) {
    const tip = element("marker", { id: `tip${k}`, viewBox: "0 0 8 8", refX: 5, refY: 4, markerWidth: 6, markerHeight: 6, orient: "auto" });
    tip.append(element("path", { d: "M0 0 8 4 0 8z", class: `tip s${k}` }));
    defs.append(tip);
  }
  svg.append(defs, element("ellipse", { cx: 110, cy: 150, rx: 46, ry: 17, class: "cell" }));
  svg.append(element("path", { d: "M64 150v16a46 17 0 0 0 92 0v-16", class: "cell" }));
  axes(svg, [110, 150], IDENTITY, 62, "load cell, S", 208);
  if (position_m === null) return;
  const reach = Math.hypot(...position_m);
  // Direction as it is, distance to taste: a sketch, not a drawing.
  const [px, py] = reach > 0 ? project(position_m.map((p) => p / reach)) : [0, 0];
  const centre = [265 + px * 22, 118 + py * 22];
  svg.append(element("rect", { x: centre[0] - 12, y: centre[1] - 9, width: 24, height: 18, rx: 3, class: "imu" }));
  svg.append(element("path", { d: `M110 150L${centre[0]} ${centre[1]}`, class: "lever" }));
  axes(svg, centre, rotation, 44, "IMU", centre[1] + 71);
}
