// The rig file: the columns as understood, and the form of load cell and IMU, as text.

import { by } from "./dom.js";
import { IDENTITY, draw, quaternion, turned, words } from "./sketch.js";

/** The form. */
export const state = { rotation: IDENTITY, position_mm: [0, 0, 0], shifts: {} };

const list = (values) => `[${values.map((value) => (Number.isInteger(value) ? `${value}.0` : String(value))).join(", ")}]`;
const quoted = (text) => JSON.stringify(text);
/** A length in m of one in mm, without the last digit of a division. */
const metres = (mm) => Number((mm / 1000).toPrecision(12));

/** Returns the text of the rig file: the program's own, with the form's statements. */
export function text(proposed, hasImu) {
  const cellClass = by("cell-class").value;
  const name = by("body-name").value.trim();
  let all = proposed;
  if (hasImu) {
    const imuClass = by("imu-class").value;
    const own = [`position_m = ${list(state.position_mm.map(metres))}     # of its origin, in the axes of the load cell`,
      `rotation_wxyz = ${list(quaternion(state.rotation).map((q) => Number(q.toPrecision(16))))}     # ${words(state.rotation)}`];
    if (imuClass !== "") own.push(`class = ${quoted(imuClass)}`);
    all = all.replace(/\[\[imu\]\]\n# position_m.*\n# rotation_wxyz.*\n?/, () => `[[imu]]\n${own.join("\n")}\n`);
  }
  for (const [file, seconds] of Object.entries(state.shifts)) {
    const line = `[[stream]]\nfile = ${quoted(file)}\n`;
    if (seconds !== 0) all = all.replace(line, () => `${line}clock_offset_s = ${Number.isInteger(seconds) ? `${seconds}.0` : seconds}\n`);
  }
  if (cellClass !== "") all += `\n[load_cell]\nclass = ${quoted(cellClass)}\n`;
  if (name !== "") all += `\n[body]\nname = ${quoted(name)}\n`;
  return all;
}

/** Returns a rig file whose first table of a header says these keys; empty ones are left as they are. */
export function stated(all, header, values) {
  const given = Object.entries(values).filter(([, value]) => value !== "");
  if (given.length === 0) return all;
  const own = given.map(([key, value]) => `${key} = ${quoted(value)}`);
  const lines = all.split("\n");
  const at = lines.findIndex((line) => line.replace(/#.*/, "").replace(/\s/g, "") === header);
  if (at < 0) return `${all.trimEnd()}\n\n${header}\n${own.join("\n")}\n`;
  const next = lines.findIndex((line, n) => n > at && /^\s*\[/.test(line));
  const end = next < 0 ? lines.length : next;
  const kept = lines.slice(at + 1, end).filter((line) => !given.some(([key]) => new RegExp(`^\\s*${key}\\s*=`).test(line)));
  return [...lines.slice(0, at + 1), ...own, ...kept, ...lines.slice(end)].join("\n");
}

/** Draws the IMU as the form has it. */
export function sketch(hasImu) {
  draw(by("sketch"), state.rotation, hasImu ? state.position_mm.map(metres) : null);
  by("sketch-words").textContent = `IMU: ${words(state.rotation)}. Direction of its place as typed in, distance not to scale.`;
}

/** Listens to the form; `changed` is called after each change. */
export function listen(changed) {
  for (const [k, axis] of ["x", "y", "z"].entries()) {
    by(`imu-${axis}`).addEventListener("input", (event) => {
      const value = event.target.valueAsNumber;
      event.target.setAttribute("aria-invalid", Number.isFinite(value) ? "false" : "true");
      state.position_mm[k] = Number.isFinite(value) ? value : 0;
      changed();
    });
  }
  for (const button of document.querySelectorAll("[data-turn]")) {
    button.addEventListener("click", () => {
      state.rotation = button.dataset.turn === "reset" ? IDENTITY : turned(state.rotation, Number(button.dataset.turn));
      changed();
    });
  }
  for (const id of ["cell-class", "imu-class", "body-name"]) by(id).addEventListener("input", changed);
}

/** The form, to be kept over a reload. */
export const kept = () => ({ ...state, cell: by("cell-class").value, imu: by("imu-class").value, name: by("body-name").value, sign: by("sign").value });

/** Puts back a form that was kept. */
export function restore(old) {
  state.rotation = old.rotation ?? IDENTITY;
  state.position_mm = old.position_mm ?? [0, 0, 0];
  state.shifts = old.shifts ?? {};
  for (const [k, axis] of ["x", "y", "z"].entries()) by(`imu-${axis}`).value = String(state.position_mm[k]);
  by("cell-class").value = old.cell ?? "";
  by("imu-class").value = old.imu ?? "";
  by("body-name").value = old.name ?? "";
  by("sign").value = old.sign ?? "on_body";
}
