// Time, controls, readings and curves.

const element = (id) => document.getElementById(id);
const [slider, clock, now, play, hover] = ["time", "clock", "now", "play", "hover"].map(element);
const LAST = DATA.frames - 1;
const state = { frame: 0, playing: false, speed: 1, before: null, places: [], heading: 0, offset: [0, 0, 0] };

const minus = (text) => text.replace("-", "\u2212");
const fixed = (value, decimals) => minus(value.toFixed(decimals).replace(/^-(0(\.0*)?)$/, "$1"));
const seconds = (frame) => (frame / DATA.rate).toFixed(2);
const isShown = (id) => element(id)?.checked ?? false;

// ---- what is looked at

const heading = Math.atan2(DATA.forward[1], DATA.forward[0]);
const middle = [0, 1, 2].map((k) => 0.5 * (bounds.own.low[k] + bounds.own.high[k]));

// The middle of the person: the centre of mass where it is known.
function person(frame) {
  const known = [];
  if (com.count) known.push(com.at(0, frame));
  else for (let k = 0; k < body.count; k++) known.push(body.at(k, frame));
  const those = known.filter(isKnown);
  return those.length ? [0, 1].map((k) => those.reduce((sum, p) => sum + p[k], 0) / those.length) : middle.slice(0, 2);
}

// Furthest that any point is from the person's middle, horizontally, over about a hundred frames.
const reach = (() => {
  let most = 0.3;
  for (let frame = 0; frame <= LAST; frame += Math.max(1, Math.floor(LAST / 100))) {
    const [x, y] = person(frame);
    for (let k = 0; k < body.count; k++) {
      const p = body.at(k, frame);
      if (isKnown(p)) most = Math.max(most, Math.hypot(p[0] - x, p[1] - y));
    }
  }
  return most;
})();
const travel = Math.hypot(bounds.own.high[0] - bounds.own.low[0], bounds.own.high[1] - bounds.own.low[1]);

// Far enough to see all of the person, or all of the way: each corner of the box around it.
function fittingDistance() {
  camera.aim();
  const half = isShown("follow") ? [0.7 * reach, 0.7 * reach] : [0, 1].map((k) => 0.5 * (bounds.own.high[k] - bounds.own.low[k]));
  half.push(0.5 * (bounds.own.high[2] - floor) + 0.1);
  const wide = (FOCAL * camera.height) / (0.46 * camera.width), high = FOCAL / 0.43;
  let most = 0.5;
  for (let k = 0; k < 8; k++) {
    const corner = half.map((v, axis) => (k & (1 << axis) ? v : -v));
    const needed = Math.max(wide * Math.abs(dot(corner, camera.right)), high * Math.abs(dot(corner, camera.up)));
    most = Math.max(most, needed + dot(corner, camera.out));
  }
  return most;
}

function look(azimuth, elevation) {
  Object.assign(camera, { azimuth: heading + azimuth, elevation });
  camera.distance = fittingDistance();
  state.offset = [0, 0, 0];
  redraw();
}
const VIEWS = {
  front: () => look(0, 0.04),
  side: () => look(-0.5 * Math.PI, 0.04),
  top: () => look(-0.5 * Math.PI, 0.5 * Math.PI),
  reset: () => look(-0.9, 0.22),
};

// ---- drawing, once per refresh of the screen

let isAwaited = false;
function redraw() {
  if (isAwaited) return;
  isAwaited = true;
  requestAnimationFrame(refresh);
}

function refresh(time) {
  isAwaited = false;
  if (state.playing) {
    advance(state.before === null ? 0 : (time - state.before) / 1000);
    state.before = time;
  }
  show();
  if (state.playing) redraw();
}

function show() {
  const [x, y] = isShown("follow") ? person(state.frame) : middle;
  camera.target = plus([x, y, 0.5 * (bounds.own.high[2] + floor)], state.offset);
  const kinds = ["measured", "predicted", "com", "trace", "markers"];
  const shown = Object.fromEntries(kinds.map((kind) => [kind, isShown(`show-${kind}`)]));
  state.places = drawScene(state.frame, shown);
  read(Math.round(state.frame));
}

function advance(elapsed) {
  // After a pause of the browser's own, as in a hidden tab, go on from here.
  const next = state.frame + Math.min(elapsed, 0.25) * state.speed * DATA.rate;
  if (next <= LAST) state.frame = next;
  else if (isShown("repeat") && LAST > 0) state.frame = next % LAST;
  else {
    state.frame = LAST;
    setPlaying(false);
  }
}

// ---- readings

const charts = [...document.querySelectorAll("figure.curve")].map((figure) => {
  const svg = figure.querySelector("svg"), plot = svg.querySelector("svg");
  const cursor = document.createElementNS("http://www.w3.org/2000/svg", "line");
  const [, , width, height] = plot.getAttribute("viewBox").split(" ").map(Number);
  cursor.setAttribute("class", "cursor");
  cursor.setAttribute("y1", 0);
  cursor.setAttribute("y2", height);
  plot.append(cursor);
  const [from, to] = [+figure.dataset.from, +figure.dataset.to];
  return { svg, plot, cursor, width, from, to, values: figure.querySelectorAll(".value") };
});

function read(frame) {
  slider.value = frame;
  clock.value = `${seconds(frame)} / ${seconds(LAST)} s`;
  slider.setAttribute("aria-valuetext", `${seconds(frame)} s of ${seconds(LAST)} s`);
  charts.forEach(({ cursor, width, from, to, values }, k) => {
    const x = (width * (frame / DATA.rate - from)) / (to - from);
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    curves[k].lines.forEach((line, j) => {
      const value = line[frame];
      values[j].textContent = Number.isFinite(value) ? fixed(value, curves[k].decimals) : "–";
    });
  });
  const text = words(frame);
  if (now.textContent !== text) now.textContent = text;
}

// The present frame in words.
function words(frame) {
  const parts = [`${seconds(frame)} s, frame ${frame + 1} of ${DATA.frames}${isUnused(frame) ? ", not used" : ""}`];
  if (com.count && isKnown(com.at(0, frame))) {
    parts.push(`centre of mass ${com.at(0, frame).map((v) => fixed(v, 3)).join(", ")} m`);
  }
  for (const force of forces) {
    const size = (kind) => (kind.count ? Math.hypot(...kind.at(0, frame)) : NaN);
    const [measured, predicted] = [size(force.measured), size(force.predicted)];
    if (!isKnown(force.at.at(0, frame)) || !Number.isFinite(measured)) continue;
    const beside = Number.isFinite(predicted) ? `, predicted ${fixed(predicted, 0)} N` : "";
    parts.push(`${force.name}: measured ${fixed(measured, 0)} N${beside}`);
  }
  return parts.join(" · ");
}

// ---- time

function setPlaying(playing) {
  if (playing && state.frame >= LAST) state.frame = 0;
  Object.assign(state, { playing, before: null, frame: playing ? state.frame : Math.round(state.frame) });
  play.classList.toggle("playing", playing);
  play.querySelector("span").textContent = playing ? "Pause" : "Play";
  // A screen reader announces a frame that stays.
  now.setAttribute("aria-live", playing ? "off" : "polite");
  redraw();
}

function seek(frame) {
  state.frame = clamp(Math.round(frame), 0, LAST);
  state.before = null;
  redraw();
}

function step(frames) {
  setPlaying(false);
  seek(state.frame + frames);
}

play.addEventListener("click", () => setPlaying(!state.playing));
slider.addEventListener("input", () => seek(+slider.value));
element("speed").addEventListener("change", (event) => (state.speed = +event.target.value));
for (const [id, view] of Object.entries(VIEWS)) element(id).addEventListener("click", view);
element("follow").addEventListener("change", () => {
  camera.distance = fittingDistance();
  redraw();
});
document.querySelectorAll(".show input").forEach((input) => input.addEventListener("change", redraw));

for (const { svg, plot, from, to } of charts) {
  const go = (event) => {
    const box = plot.getBoundingClientRect();
    seek((from + ((event.clientX - box.left) / box.width) * (to - from)) * DATA.rate);
  };
  svg.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    svg.setPointerCapture(event.pointerId);
    go(event);
  });
  svg.addEventListener("pointermove", (event) => svg.hasPointerCapture(event.pointerId) && go(event));
}

const KEYS = {
  " ": () => setPlaying(!state.playing),
  ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
  ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
  Home: () => seek(0),
  End: () => seek(LAST),
  "+": () => zoom(0.9),
  "-": () => zoom(1 / 0.9),
  f: VIEWS.front, s: VIEWS.side, t: VIEWS.top, r: VIEWS.reset,
};
// While the picture itself was reached by keys.
const TURNS = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
document.addEventListener("keydown", (event) => {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  // Whoever goes from control to control by keys uses the control's own; a click leaves no such focus.
  const focus = document.activeElement;
  const usesSpace = focus !== slider && focus.matches("button:focus-visible, input:focus-visible");
  if (focus.matches("select") || (usesSpace && key === " ")) return;
  if (TURNS[key] && focus === canvas && canvas.matches(":focus-visible")) {
    camera.turn(...TURNS[key]);
    redraw();
  } else if (KEYS[key]) KEYS[key](event);
  else return;
  event.preventDefault();
});

// ---- pointer on the picture: turn, shift, come nearer

const pointers = new Map();
function zoom(factor) {
  camera.zoom(factor, 0.3, 20 * fittingDistance());
  redraw();
}

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  hover.hidden = true;
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => pointers.delete(event.pointerId));
canvas.addEventListener("pointermove", (event) => {
  const last = pointers.get(event.pointerId);
  if (!last) return name(event);
  const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
  if (pointers.size === 2) pinch(event.pointerId, [event.clientX, event.clientY]);
  else if (event.shiftKey || event.buttons & 6) shift(dx, dy);
  else camera.turn(-0.008 * dx, 0.008 * dy);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  redraw();
});
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("pointerleave", () => (hover.hidden = true));
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(clamp(event.deltaY * (event.deltaMode ? 20 : 1), -200, 200) * 0.0015));
}, { passive: false });

function shift(dx, dy) {
  const from = camera.target;
  camera.shift(dx, dy);
  state.offset = plus(state.offset, plus(camera.target, from, -1));
}

function pinch(moved, to) {
  const [other] = [...pointers].filter(([id]) => id !== moved).map(([, place]) => place);
  const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
  zoom(apart(pointers.get(moved)) / apart(to));
}

// Writes the name of the bone or the marker under the pointer beside it.
function name(event) {
  const box = canvas.getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
  const hit = ({ a, b, r }) => {
    const [dx, dy] = [b.x - a.x, b.y - a.y];
    const part = clamp(((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy || 1), 0, 1);
    return Math.hypot(a.x + part * dx - x, a.y + part * dy - y) < r + 2;
  };
  const nearest = state.places.filter(hit).sort((a, b) => a.a.depth + a.b.depth - b.a.depth - b.b.depth)[0];
  hover.hidden = !nearest;
  if (!nearest) return;
  hover.textContent = nearest.name;
  hover.style.left = `${clamp(x + 12, 0, box.width - 120)}px`;
  hover.style.top = `${clamp(y + 14, 0, box.height - 30)}px`;
}

// ---- beginning

new ResizeObserver(() => {
  const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  if (box.width < 1 || box.height < 1) return;
  // What fitted before fits again.
  const closeness = camera.width > 1 ? camera.distance / fittingDistance() : 1;
  canvas.width = Math.round(box.width * ratio);
  canvas.height = Math.round(box.height * ratio);
  camera.resize(box.width, box.height);
  camera.distance = closeness * fittingDistance();
  // At once: a new size has emptied the canvas.
  show();
}).observe(canvas);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  readColours();
  redraw();
});

readColours();
if (forces.length) element("scale").textContent = `1 m of arrow: ${newtonPerMetre} N · `;
element("scale").textContent += `grid ${grid.step} m`;
element("follow").checked = travel > 4;
VIEWS.reset();
setPlaying(LAST > 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches);
