// The data of the page, unpacked: see series.rs.

const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
const DIGIT = new Uint8Array(128);
for (let k = 0; k < 64; k++) DIGIT[DIGITS.charCodeAt(k)] = k;

function unpacked(text, step, frames) {
  const values = new Float32Array(frames);
  let at = 0, last = 0, before = 0;
  for (let k = 0; k < frames; k++) {
    if (text[at] === ".") {
      at += 1;
      before = last;
      values[k] = NaN;
      continue;
    }
    let number = 0, scale = 1, digit;
    do {
      digit = DIGIT[text.charCodeAt(at++)];
      number += (digit & 31) * scale;
      scale *= 32;
    } while (digit > 31);
    const steps = (number % 2 ? -1 : 1) * Math.floor(number / 2) + 2 * last - before;
    before = last;
    last = steps;
    values[k] = steps * step;
  }
  return values;
}

const DATA = JSON.parse(document.getElementById("motion").textContent);
const channels = (packed) => packed.channels.map((text) => unpacked(text, packed.step, DATA.frames));

// The value between two frames.
function between(values, frame) {
  const k = Math.floor(frame), part = frame - k;
  return part === 0 ? values[k] : values[k] + part * (values[k + 1] - values[k]);
}

// Points of which each has three channels.
class Points {
  constructor(packed) {
    this.channels = channels(packed);
    this.count = this.channels.length / 3;
  }
  at(point, frame) {
    const c = this.channels, k = 3 * point;
    return [between(c[k], frame), between(c[k + 1], frame), between(c[k + 2], frame)];
  }
}

const points = new Points(DATA.points), markers = new Points(DATA.markers), com = new Points(DATA.com);
// What is looked at.
const body = points.count ? points : markers;
const forces = DATA.forces.map((force) => ({
  name: force.name, at: new Points(force.at), measured: new Points(force.measured), predicted: new Points(force.predicted),
}));
const curves = DATA.curves.map((curve) => ({ ...curve, lines: curve.lines.map((line) => channels(line)[0]) }));

const isUnused = (frame) => DATA.unused.some(([from, to]) => from <= frame && frame <= to);
const isKnown = (point) => point.every(Number.isFinite);
