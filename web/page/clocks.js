// Clocks of several files: a curve of each over the time of the wrench's clock, and shifts by hand.

import { by, digits, make } from "./dom.js";

const NS = "http://www.w3.org/2000/svg";
/** Place of the curves in the chart: left, top, width and height. */
const AREA = { left: 8, top: 8, width: 1044, height: 200 };

function element(name, attributes, text) {
  const made = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Returns true where two streams have some time in common. */
const meet = (a, b) => Math.min(a.to_s, b.to_s) > Math.max(a.from_s, b.from_s);

/**
 * Shows the streams of a recording. `shifts` are seconds by file, as they are set by hand, undefined where they cannot be;
 * `changed` is called with a file and its shift.
 */
export function show(found, shifts, changed) {
  const reference = found.streams.find(({ file }) => file === found.clock_of) ?? found.streams[0];
  const together = found.streams.every((stream) => meet(stream, reference));
  const lines = [`Times are of the clock of ${reference.file}.`, ...found.streams.filter((stream) => stream !== reference).map(words), ...(found.warnings ?? [])];
  by("clocks-words").replaceChildren(...lines.map((line) => make("li", {}, line)));
  draw(found.streams, reference, together);
  const others = shifts === undefined ? [] : found.streams.filter((stream) => stream !== reference);
  by("clocks-shifts").replaceChildren(...others.map(({ file }) => make("label", {}, `Shift ${file} by, s`,
    make("input", { type: "number", step: "any", value: String(shifts[file] ?? 0), "data-shift": file, onchange: (event) => {
      const value = event.target.valueAsNumber;
      event.target.setAttribute("aria-invalid", Number.isFinite(value) ? "false" : "true");
      if (Number.isFinite(value)) changed(file, value);
    } }))));
}

/** One line about a stream's clock. */
function words({ file, carries, clock, from_s: from, to_s: to, rate_hz: rate }) {
  const own = clock ? `set by the motion: a second of its clock lasts ${digits(clock.rate, 8)} s, and its first row is at ${digits(from, 6)} s` : `as it is stamped, from ${digits(from, 6)} s to ${digits(to, 6)} s`;
  return `${file} (${carries.join(", ")}, ${digits(rate, 4)} rows per second): ${own}.`;
}

/** Returns the largest of 1, 2 and 5 times a power of ten that is not above `step`. */
function tidy(step) {
  if (!(step > 0)) return 1;
  const ten = 10 ** Math.floor(Math.log10(step));
  return ten * [5, 2, 1].find((times) => times * ten <= step * (1 + 1e-9));
}

/** Draws a curve for each stream, each over its own range of values. Streams without common time are drawn from their own beginnings. */
function draw(streams, reference, together) {
  const svg = by("clocks-chart");
  const begin = (stream) => (together ? 0 : stream.from_s);
  const spans = streams.map((stream) => [stream.from_s - begin(stream), stream.to_s - begin(stream)]);
  const [low, high] = [Math.min(...spans.map(([from]) => from)), Math.max(...spans.map(([, to]) => to))];
  const x = (t) => AREA.left + (AREA.width * (t - low)) / (high - low || 1);
  const foot = AREA.top + AREA.height;
  svg.replaceChildren(element("path", { d: `M${AREA.left} ${foot}h${AREA.width}`, class: "level" }));
  const step = tidy((high - low) / 5);
  for (let t = step * Math.ceil(low / step); t <= high + 1e-9 * step; t += step) {
    const anchor = x(t) < AREA.left + 20 ? "start" : x(t) > AREA.left + AREA.width - 20 ? "end" : "middle";
    svg.append(element("path", { d: `M${x(t)} ${foot}v5`, class: "level" }), element("text", { x: x(t), y: foot + 8, "text-anchor": anchor, "dominant-baseline": "hanging" }, `${digits(t, 6)} s`));
  }
  const captions = [];
  for (const [k, stream] of streams.entries()) {
    if (!stream.curve) continue;
    const { points, name, unit } = stream.curve;
    const range = [Math.min(...points.map(([, least]) => least)), Math.max(...points.map(([, , most]) => most))];
    const y = (value) => foot - 4 - ((AREA.height - 12) * (value - range[0])) / (range[1] - range[0] || 1);
    const line = points.map(([t, least, most]) => `${x(t - begin(stream)).toFixed(1)} ${y(least).toFixed(1)}L${x(t - begin(stream)).toFixed(1)} ${y(most).toFixed(1)}`).join("L");
    svg.append(element("path", { d: `M${line}`, class: `curve c${k % 3}` }));
    captions.push(make("span", { class: `key c${k % 3}` }, `${stream.file}: ${name}, ${digits(range[0], 3)} to ${digits(range[1], 3)}${unit ? ` ${unit}` : ""}${stream === reference ? " (its clock is the time)" : ""}`));
  }
  if (!together) captions.push(make("span", {}, "They have no time in common: each is drawn from its own beginning."));
  by("clocks-caption").replaceChildren(...captions);
}
