// Still poses typed in by hand: readings of a level along x and y of the load cell, and those of the load cell.

import { by, make } from "./dom.js";

const G = 9.80665;
const DEGREE = Math.PI / 180;
const COLUMNS = [["x up by, °", "level along x"], ["y up by, °", "level along y"], ["Fx, N"], ["Fy, N"], ["Fz, N"], ["Mx, N m"], ["My, N m"], ["Mz, N m"]];
const NS = "http://www.w3.org/2000/svg";
/** Poses to begin with: six tilts, to different sides. */
const FIRST = 6;

let changed = () => {};

/** Makes the table; `notify` is called after each change. */
export function start(notify) {
  changed = notify;
  const head = COLUMNS.map(([name, title]) => make("th", { scope: "col", title }, name));
  document.querySelector("#pose-table thead").replaceChildren(make("tr", {}, make("th", { scope: "col" }, "pose"), ...head, make("td")));
  by("add-pose").addEventListener("click", () => {
    add();
    document.querySelector("#pose-table tbody tr:last-child input").focus();
    changed();
  });
}

/** The table's cells as text, row by row. */
export const rows = () => [...document.querySelectorAll("#pose-table tbody tr")].map((row) => [...row.querySelectorAll("input")].map((input) => input.value));

/** Puts rows into the table, or empty ones. */
export function fill(kept) {
  document.querySelector("#pose-table tbody").replaceChildren();
  for (const cells of kept?.length ? kept : Array.from({ length: FIRST }, () => [])) add(cells);
  sketch([]);
}

function add(cells = []) {
  const body = document.querySelector("#pose-table tbody");
  const row = make("tr");
  const number = () => [...body.children].indexOf(row) + 1;
  const inputs = COLUMNS.map(([name], k) => make("td", {}, make("input", { type: "text", inputmode: "decimal", value: cells[k] ?? "", autocomplete: "off",
    oninput: () => { sketch(read(row)); changed(); }, onfocus: (event) => { event.target.setAttribute("aria-label", `pose ${number()}: ${name}`); sketch(read(row)); }, "aria-label": name })));
  const remove = make("button", { type: "button", class: "quiet", "aria-label": "Remove this pose", onclick: () => { row.remove(); count(); changed(); } }, "×");
  row.append(make("th", { scope: "row" }), ...inputs, make("td", {}, remove));
  body.append(row);
  count();
}

function count() {
  for (const [n, row] of [...document.querySelectorAll("#pose-table tbody tr")].entries()) row.firstChild.textContent = String(n + 1);
}

const read = (row) => [...row.querySelectorAll("input")].map((input) => number(input.value));
/** A number, its decimals behind a point or a comma; not a number otherwise. */
const number = (text) => (/^\s*[-+−]?(\d+([.,]\d*)?|[.,]\d+)\s*$/.test(text) ? Number(text.trim().replace("−", "-").replace(",", ".")) : NaN);

/**
 * Returns the recording as text, or words that say what is missing. A level along an axis shows sin α of it upwards, so the
 * gravity vector has −g sin α along it; the rest of its length is along z, downwards.
 */
export function recording() {
  const all = [...document.querySelectorAll("#pose-table tbody tr")];
  const used = all.filter((row) => [...row.querySelectorAll("input")].some((input) => input.value.trim() !== ""));
  const lines = ["fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,gx_mps2,gy_mps2,gz_mps2"];
  for (const row of used) {
    const pose = all.indexOf(row) + 1;
    const values = read(row);
    const bad = values.findIndex((value) => !Number.isFinite(value));
    if (bad >= 0) return { wrong: `pose ${pose}: ${COLUMNS[bad][0]} is ${row.querySelectorAll("input")[bad].value.trim() === "" ? "missing" : "not a number"}`, at: row.querySelectorAll("input")[bad] };
    const [x, y] = [values[0], values[1]].map((degrees) => -Math.sin(degrees * DEGREE));
    if (x * x + y * y > 1 || Math.abs(values[0]) > 90 || Math.abs(values[1]) > 90) {
      return { wrong: `pose ${pose}: no axes are tilted by ${values[0]}° and ${values[1]}° at the same time`, at: row.querySelector("input") };
    }
    const z = -Math.sqrt(1 - x * x - y * y);
    lines.push([...values.slice(2), ...[x, y, z].map((part) => part * G)].join(","));
  }
  if (used.length < 3) return { wrong: `${used.length} poses are typed in: three are the least, six to different sides are good`, at: document.querySelector("#pose-table input") };
  return { text: `${lines.join("\n")}\n` };
}

/** The rig file of such a recording. */
export const rig = (sign) => `# Still poses, typed in; the direction of gravity is from a level along x and y of the load cell.\n[recording]\nstatic = true\nwrench_sign = "${sign}"\n\n[load_cell]\noffset_n_nm = "estimate"\n`;

/** Draws a body on a load cell, tilted as the level shows along x (seen from the side) and along y (from the front). */
function sketch(values) {
  const svg = by("pose-sketch");
  svg.replaceChildren();
  const element = (name, attributes, text) => {
    const made = document.createElementNS(NS, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text) made.textContent = text;
    svg.append(made);
    return made;
  };
  const shown = [values[0], values[1]].map((value) => (Number.isFinite(value) ? value : 0));
  for (const [k, degrees] of shown.entries()) {
    const [cx, cy] = [62 + 116 * k, 120];
    const turn = `rotate(${-Math.max(-90, Math.min(90, degrees))} ${cx} ${cy})`;
    element("path", { d: `M${cx - 52} ${cy + 30}h104`, class: "level" });
    element("rect", { x: cx - 34, y: cy - 6, width: 68, height: 12, class: "cell", transform: turn });
    element("path", { d: `M${cx - 24} ${cy - 6}v-34h30l18 16v18z`, class: "solid", transform: turn });
    element("line", { x1: cx, y1: cy, x2: cx + 50, y2: cy, class: `axis s${k}`, transform: turn });
    element("text", { x: cx, y: cy + 50, class: "mid" }, `${"xy"[k]} up by ${degrees}°`);
  }
  by("pose-sketch-words").textContent = "The pose that is typed in, from two sides.";
}
