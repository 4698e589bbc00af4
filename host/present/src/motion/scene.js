// What is drawn: floor, plates, shadow, figure, markers, centre of mass, forces.

const canvas = document.getElementById("scene"), paint = canvas.getContext("2d");
const camera = new Camera();

// Colours from the style sheet, by name, and shades of the figure's.
let colour = {};
function readColours() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  const names = ["paper", "soft", "floor", "line", "x", "y", "z", "truth"];
  colour = Object.fromEntries(names.map((name) => [name, read(name)]));
  const sides = ["middle", "left", "right"].map((side) => [side, read(`bone-${side}`)]);
  const shades = (hex) => [mixed(hex, 0.45, 0), hex, mixed(hex, 0.62, 255)];
  colour.shades = Object.fromEntries(sides.map(([side, hex]) => [side, shades(hex)]));
}

// A colour `#rrggbb` mixed with a grey: so much of the colour itself.
function mixed(hex, share, grey) {
  const parts = [1, 3, 5].map((k) => Math.round(share * parseInt(hex.slice(k, k + 2), 16) + (1 - share) * grey));
  return `rgb(${parts})`;
}

// Where anything is in the whole motion.
const bounds = (() => {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const take = (value, axis) => {
    if (value < low[axis]) low[axis] = value;
    if (value > high[axis]) high[axis] = value;
  };
  body.channels.forEach((values, k) => values.forEach((value) => take(value, k % 3)));
  const own = { low: [...low], high: [...high] };
  DATA.plates.flat().filter(isKnown).forEach((corner) => corner.forEach(take));
  const or = (v, other) => (Number.isFinite(v) ? v : other);
  const finite = (box) => ({ low: box.low.map((v) => or(v, 0)), high: box.high.map((v, k) => or(v, k === 2 ? 2 : 1)) });
  return { ...finite({ low, high }), own: finite(own) };
})();

// The floor is where the plates are, without any where the figure's lowest point comes.
const floor = (() => {
  const heights = DATA.plates.flat().map((corner) => corner[2]).filter(Number.isFinite);
  return heights.length ? heights.reduce((a, b) => a + b) / heights.length : Math.min(bounds.own.low[2], 0);
})();

// 1, 2 or 5 times a power of ten, not below.
function roundUp(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((m) => m * decade).find((v) => v >= value * (1 - 1e-9));
}

// Force that an arrow of one metre represents, N.
const newtonPerMetre = (() => {
  let most = 0;
  for (const force of forces)
    for (let k = 0; k < DATA.frames; k++) {
      const size = Math.hypot(...force.measured.at(0, k));
      if (size > most) most = size;
    }
  return most > 0 ? roundUp(most / 1.3) : 1;
})();

// A bone's length where it is first known gives its thickness.
const bones = DATA.bones.map(([name, from, to, side, radius]) => {
  let length = NaN;
  for (let k = 0; k < DATA.frames && !Number.isFinite(length); k++) length = distance(points.at(from, k), points.at(to, k));
  return { name, from, to, side, radius: radius > 0 ? radius : Math.min(length / 8 || 0.03, 0.06) };
});

const grid = (() => {
  const span = Math.max(bounds.high[0] - bounds.low[0], bounds.high[1] - bounds.low[1]);
  const step = Math.max(0.5, roundUp((span + 2) / 40));
  const from = [0, 1].map((k) => Math.floor((bounds.low[k] - 0.6) / step) * step);
  const to = [0, 1].map((k) => Math.ceil((bounds.high[k] + 0.6) / step) * step);
  return { step, from, to };
})();

function trace(line, closed, on = paint) {
  line.forEach((p, k) => (k ? on.lineTo(p.x, p.y) : on.moveTo(p.x, p.y)));
  if (closed) on.closePath();
}

function drawFloor() {
  const { from, to, step } = grid;
  paint.fillStyle = colour.floor;
  paint.beginPath();
  const corners = [[from[0], from[1]], [to[0], from[1]], [to[0], to[1]], [from[0], to[1]]].map(([x, y]) => [x, y, floor]);
  trace(camera.outline(corners, true), true);
  paint.fill();
  paint.strokeStyle = colour.line;
  paint.lineWidth = 1;
  paint.beginPath();
  for (let x = from[0]; x <= to[0] + 1e-6; x += step) trace(camera.outline([[x, from[1], floor], [x, to[1], floor]], false));
  for (let y = from[1]; y <= to[1] + 1e-6; y += step) trace(camera.outline([[from[0], y, floor], [to[0], y, floor]], false));
  paint.stroke();
}

function drawPlates() {
  paint.lineWidth = 1.5;
  paint.strokeStyle = colour.soft;
  for (const plate of DATA.plates.filter((corners) => corners.every(isKnown))) {
    paint.beginPath();
    trace(camera.outline(plate, true), true);
    paint.globalAlpha = 0.22;
    paint.fillStyle = colour.soft;
    paint.fill();
    paint.globalAlpha = 0.9;
    paint.stroke();
    paint.globalAlpha = 1;
  }
}

// One stroke for all, so that nothing is darkened twice.
function drawShadow(frame) {
  if (camera.elevation < 0 || !bones.length) return;
  paint.save();
  paint.lineCap = "round";
  paint.strokeStyle = "#000000";
  paint.globalAlpha = 0.12;
  paint.lineWidth = (2 * camera.focal * bones.reduce((sum, bone) => sum + bone.radius, 0)) / bones.length / camera.distance;
  paint.beginPath();
  for (const bone of bones) {
    const ends = [bone.from, bone.to].map((point) => points.at(point, frame));
    if (ends.every(isKnown)) trace(camera.outline(ends.map(([x, y]) => [x, y, floor]), false));
  }
  paint.stroke();
  paint.restore();
}

// A limb with round ends, lit from the upper left.
function drawLimb(a, b, ra, rb, [dark, plain, light]) {
  const [dx, dy] = [b.x - a.x, b.y - a.y];
  const angle = Math.hypot(dx, dy) > 1e-3 ? Math.atan2(dy, dx) : 0;
  let [nx, ny] = [-Math.sin(angle), Math.cos(angle)];
  if (0.55 * nx + 0.83 * ny > 0) [nx, ny] = [-nx, -ny];
  const r = Math.max(ra, rb);
  const across = paint.createLinearGradient(a.x + r * nx, a.y + r * ny, a.x - r * nx, a.y - r * ny);
  across.addColorStop(0, plain);
  across.addColorStop(0.3, light);
  across.addColorStop(0.6, plain);
  across.addColorStop(1, dark);
  paint.beginPath();
  paint.arc(a.x, a.y, ra, angle + 0.5 * Math.PI, angle + 1.5 * Math.PI);
  paint.arc(b.x, b.y, rb, angle - 0.5 * Math.PI, angle + 0.5 * Math.PI);
  paint.closePath();
  paint.fillStyle = across;
  paint.fill();
  paint.lineWidth = 1;
  paint.strokeStyle = dark;
  paint.stroke();
}

function limbs(frame, parts, places) {
  for (const bone of bones) {
    const ends = [bone.from, bone.to].map((point) => points.at(point, frame));
    if (!ends.every(isKnown)) continue;
    const [a, b] = ends.map((end) => camera.project(end));
    if (!a || !b) continue;
    const [ra, rb] = [a.scale * bone.radius, 0.78 * b.scale * bone.radius];
    places.push({ name: bone.name, a, b, r: Math.max(ra, rb) });
    parts.push({ depth: 0.5 * (a.depth + b.depth), draw: () => drawLimb(a, b, ra, rb, colour.shades[bone.side]) });
  }
}

function dots(frame, parts, places) {
  for (let k = 0; k < markers.count; k++) {
    const p = markers.at(k, frame), a = isKnown(p) && camera.project(p);
    if (!a) continue;
    const r = clamp(0.009 * a.scale, 1.6, 7);
    if (DATA.marker_names[k]) places.push({ name: DATA.marker_names[k], a, b: a, r });
    parts.push({
      depth: a.depth - 0.02,
      draw: () => {
        paint.beginPath();
        paint.arc(a.x, a.y, r, 0, 2 * Math.PI);
        paint.fillStyle = colour.z;
        paint.fill();
        paint.lineWidth = 1;
        paint.strokeStyle = colour.paper;
        paint.stroke();
      },
    });
  }
}

// A shaft in pieces, each with its own depth, and a head. Once more, in one piece, for what shines through the body.
function arrow(from, vector, radius, hue, nearer, parts, through) {
  const size = Math.hypot(...vector);
  if (!(size > 0.01)) return;
  const head = Math.min(0.12, 0.45 * size), neck = plus(from, vector, 1 - head / size);
  const pieces = 8, shares = Array.from({ length: pieces + 1 }, (_, k) => k / pieces);
  const ends = shares.map((share) => camera.project(plus(from, plus(neck, from, -1), share)));
  const tip = camera.project(plus(from, vector)), base = ends[pieces];
  const shaft = (a, b, on = paint) => {
    on.lineCap = "round";
    on.lineWidth = Math.max(2 * radius * a.scale, 1.5);
    on.strokeStyle = hue;
    on.beginPath();
    trace([a, b], false, on);
    on.stroke();
  };
  const point = (on = paint) => {
    const [dx, dy] = [tip.x - base.x, tip.y - base.y];
    const across = Math.max((2.2 * radius + 0.006) * base.scale, 3) / (Math.hypot(dx, dy) || 1);
    on.fillStyle = hue;
    on.beginPath();
    const foot = (side) => ({ x: base.x - side * across * dy, y: base.y + side * across * dx });
    trace([foot(1), tip, foot(-1)], true, on);
    on.fill();
  };
  if (!tip || ends.some((end) => !end)) return;
  for (let k = 0; k < pieces; k++) {
    const [a, b] = [ends[k], ends[k + 1]];
    parts.push({ depth: 0.5 * (a.depth + b.depth) - nearer, draw: () => shaft(a, b) });
  }
  parts.push({ depth: base.depth - nearer - 0.001, draw: () => point() });
  through.push((on) => shaft(ends[0], base, on), point);
}

function arrows(frame, shown, parts, through) {
  for (const force of forces) {
    const at = force.at.at(0, frame);
    if (!isKnown(at)) continue;
    const along = (kind, ...style) => {
      if (!kind.count) return;
      const vector = kind.at(0, frame).map((v) => v / newtonPerMetre);
      if (isKnown(vector)) arrow(at, vector, ...style, parts, through);
    };
    if (shown.measured) along(force.measured, 0.014, colour.x, 0.03);
    if (shown.predicted) along(force.predicted, 0.005, colour.y, 0.05);
  }
}

// Forces behind the body shine through it; where they are seen anyhow, nothing changes.
const veil = document.createElement("canvas").getContext("2d");
function shineThrough(draws, ratio) {
  if (!draws.length) return;
  const { width, height } = canvas;
  if (veil.canvas.width !== width || veil.canvas.height !== height) Object.assign(veil.canvas, { width, height });
  veil.setTransform(ratio, 0, 0, ratio, 0, 0);
  veil.clearRect(0, 0, camera.width, camera.height);
  draws.forEach((draw) => draw(veil));
  paint.globalAlpha = 0.5;
  paint.drawImage(veil.canvas, 0, 0, camera.width, camera.height);
  paint.globalAlpha = 1;
}

// The path of the centre of mass; what lies behind is drawn stronger.
function drawPath(frame) {
  const every = Math.max(1, Math.ceil(DATA.frames / 1500));
  const piece = (from, to, alpha) => {
    let line = [];
    const end = () => {
      trace(camera.outline(line, false));
      line = [];
    };
    paint.globalAlpha = alpha;
    paint.beginPath();
    for (let k = from; ; k = Math.min(k + every, to)) {
      const p = com.at(0, k);
      if (isKnown(p)) line.push(p); else end();
      if (k >= to) break;
    }
    end();
    paint.stroke();
  };
  paint.save();
  paint.lineWidth = 2;
  paint.lineJoin = "round";
  paint.strokeStyle = colour.truth;
  piece(0, DATA.frames - 1, 0.35);
  if (frame > 0) piece(0, frame, 0.9);
  paint.restore();
}

// The centre of mass as a quartered ball, and where it is above the floor.
function drawCentre(frame) {
  const p = com.at(0, frame), a = isKnown(p) && camera.project(p);
  if (!a) return;
  paint.lineWidth = 1.2;
  paint.strokeStyle = colour.truth;
  paint.setLineDash([3, 4]);
  paint.beginPath();
  trace(camera.outline([p, [p[0], p[1], floor]], false));
  paint.stroke();
  paint.setLineDash([]);
  const r = clamp(0.035 * a.scale, 5, 30);
  const fill = (hue, from, to) => {
    paint.fillStyle = hue;
    paint.beginPath();
    paint.moveTo(a.x, a.y);
    paint.arc(a.x, a.y, r, from, to);
    paint.fill();
  };
  fill("#ffffff", 0, 2 * Math.PI);
  fill("#111111", 0, 0.5 * Math.PI);
  fill("#111111", Math.PI, 1.5 * Math.PI);
  paint.lineWidth = 2;
  paint.beginPath();
  paint.arc(a.x, a.y, r, 0, 2 * Math.PI);
  paint.stroke();
}

// The laboratory's axes in the corner.
function drawAxes() {
  const [x0, y0, size] = [44, camera.height - 44, 26];
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis, k) => ({
    name: "xyz"[k], x: dot(axis, camera.right), y: dot(axis, camera.up), out: dot(axis, camera.out),
  }));
  paint.font = "600 12px system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
  paint.textAlign = "center";
  paint.textBaseline = "middle";
  paint.lineWidth = 2;
  for (const axis of axes.sort((a, b) => a.out - b.out)) {
    paint.globalAlpha = axis.out > -0.3 ? 1 : 0.55;
    paint.strokeStyle = paint.fillStyle = colour.soft;
    paint.beginPath();
    paint.moveTo(x0, y0);
    paint.lineTo(x0 + size * axis.x, y0 - size * axis.y);
    paint.stroke();
    if (Math.hypot(axis.x, axis.y) > 0.25) paint.fillText(axis.name, x0 + (size + 10) * axis.x, y0 - (size + 10) * axis.y);
  }
  paint.globalAlpha = 1;
}

// Draws all of a frame, which may lie between two, and returns where each bone is in the picture.
function drawScene(frame, shown) {
  const parts = [], places = [];
  camera.aim();
  const ratio = canvas.width / camera.width;
  paint.setTransform(ratio, 0, 0, ratio, 0, 0);
  paint.clearRect(0, 0, camera.width, camera.height);
  if (camera.elevation > -0.02) drawFloor();
  drawPlates();
  drawShadow(frame);
  limbs(frame, parts, places);
  if (shown.markers) dots(frame, parts, places);
  const through = [];
  arrows(frame, shown, parts, through);
  parts.sort((a, b) => b.depth - a.depth).forEach((part) => part.draw());
  shineThrough(through, ratio);
  if (shown.trace && com.count) drawPath(frame);
  if (shown.com && com.count) drawCentre(frame);
  drawAxes();
  return places;
}
