// The columns of a file: which quantity each is, and in which unit, chosen from lists.

import { by, make, select } from "./dom.js";

const axes = (names, words) => ["x", "y", "z"].map((axis, k) => [names[k], `${words} ${axis}`]);

/** Columns that have a meaning, in groups, each with the units of its quantity. */
const GROUPS = [
  { name: "Time", units: "time", choices: [["t_s", "time"]] },
  { name: "Load cell: force", units: "force", choices: axes(["fx_n", "fy_n", "fz_n"], "force") },
  { name: "Load cell: moment", units: "moment", choices: axes(["mx_nm", "my_nm", "mz_nm"], "moment") },
  { name: "IMU: acceleration", units: "acceleration", choices: axes(["imu_ax_mps2", "imu_ay_mps2", "imu_az_mps2"], "acceleration") },
  { name: "IMU: angular rate", units: "rate", choices: axes(["imu_gx_radps", "imu_gy_radps", "imu_gz_radps"], "angular rate") },
  { name: "Direction of gravity", units: "acceleration", choices: axes(["gx_mps2", "gy_mps2", "gz_mps2"], "gravity") },
  { name: "Raw gauges", units: "voltage", choices: [1, 2, 3, 4, 5, 6].map((k) => [`g${k}_v`, `gauge ${k}`]) },
];
/** Units by quantity; the first is the SI's. */
const UNITS = {
  time: ["s", "ms", "us", "ns", "min", "h"],
  force: ["N", "mN", "daN", "kN", "kgf", "gf", "lbf", "ozf"],
  moment: ["N m", "N mm", "N cm", "kN m", "kgf m", "kgf cm", "kgf mm", "lbf in", "lbf ft", "ozf in"],
  acceleration: ["m/s^2", "g", "mg", "cm/s^2", "mm/s^2", "ft/s^2"],
  rate: ["rad/s", "deg/s", "mdeg/s", "mrad/s", "rpm"],
  voltage: ["V", "mV", "uV"],
};

const groupOf = (known) => GROUPS.find((group) => group.choices.some(([name]) => name === known));
const plain = (unit) => unit?.replace(/[[\]()\s·.*_]/g, "").replaceAll("²", "^2");

/** The unit of the list that a written one is; undefined if it is none of them. */
const listed = (units, written) => units.find((unit) => plain(unit) === plain(written)) ?? (written ? written : undefined);

/** Puts the choices into the columns, over the program's proposal. */
function overlaid(columns, said) {
  const names = new Set(columns.map(({ name }) => name));
  return columns.map((column) => {
    const own = Object.entries(said).find(([, { name }]) => name === column.name);
    if (own) return { ...column, column: own[0], unit: own[1].unit ?? column.unit };
    return said[column.column] && names.has(said[column.column].name) ? { ...column, column: null } : column;
  });
}

/**
 * Shows the columns of files as lists, with the choices made before; `changed` is called with the choices then, as
 * {column: {name, unit}} by known names.
 */
export function show(given, said, changed) {
  const files = given.map((file) => ({ ...file, columns: overlaid(file.columns, said) }));
  const head = ["column in the file", "first values", "meaning", "unit"].map((words) => make("th", { scope: "col" }, words));
  by("columns").replaceChildren(...files.map((file, n) => make("div", { class: "scroll" }, make("table", {},
    make("caption", { class: files.length > 1 ? "" : "hidden" }, files.length > 1 ? file.file : "Columns of the file"),
    make("thead", {}, make("tr", {}, ...head.map((cell) => cell.cloneNode(true)))),
    make("tbody", {}, ...file.columns.map((column, k) => row(file, column, `${n}-${k}`, () => changed(chosen(files, said)))))))));
}

function row(file, column, k, changed) {
  const isMissing = file.missing_units?.includes(column.name) === true;
  const group = groupOf(column.column);
  const known = groupOf(column.column) ? [] : column.column ? [[column.column, column.column]] : [];
  const what = select({ "aria-label": `Meaning of column ${column.name}`, "data-column": k, class: "what", onchange: changed },
    [["", "not used"], ...known, ...GROUPS], column.column ?? "");
  const cell = (...content) => make("td", {}, ...content);
  return make("tr", { class: isMissing ? "missing" : undefined }, make("th", { scope: "row" }, column.name || "(no name)"),
    make("td", { class: "cells", title: column.cells.join(", ") }, column.cells.join(", ")), cell(what), cell(unitList(column, k, group, isMissing, changed)));
}

function unitList(column, k, group, isMissing, changed) {
  if (!group || column.is_clock) return column.is_clock ? "time of day" : "";
  const units = UNITS[group.units];
  const isOwn = column.name === column.column;
  const written = isOwn ? undefined : listed(units, column.unit);
  const all = written && !units.includes(written) ? [written, ...units] : units;
  const choices = all.map((unit) => [unit, unit]);
  if (!written) choices.unshift(["", isMissing ? "which?" : `${units[0]}, by its name`]);
  return select({ "aria-label": `Unit of column ${column.name}`, "data-unit": k, class: "unit", "aria-invalid": isMissing ? "true" : undefined,
    disabled: isOwn, onchange: changed }, choices, isMissing ? "" : written ?? "");
}

/** The choices in the lists. Of several files one that is as proposed is no choice: each may have a time by the same name. */
function chosen(files, said) {
  const found = {};
  for (const what of document.querySelectorAll("#columns select.what")) {
    const [n, k] = what.dataset.column.split("-").map(Number);
    const column = files[n].columns[k];
    if (what.value === "") continue;
    const unit = document.querySelector(`#columns select[data-unit="${n}-${k}"]`)?.value;
    const [units, before] = [groupOf(what.value)?.units, groupOf(column.column)?.units];
    const isOwn = column.name === what.value;
    // Of a column that was just picked the SI's unit is in the list, unless the file says one.
    const first = column.unit || column.is_clock || isOwn ? undefined : UNITS[units]?.[0];
    const choice = { name: column.name, unit: units === before && unit ? unit : first, isOwn };
    const isProposed = column.column === what.value && (unit === undefined || plain(unit) === plain(column.unit ?? "") || unit === "");
    if (files.length > 1 && isProposed && said[what.value]?.name !== column.name) continue;
    found[what.value] = choice;
  }
  return found;
}

/** The program's options for the choices. */
export function options(columns) {
  return Object.entries(columns).filter(([, { isOwn }]) => !isOwn).flatMap(([known, { name, unit }]) => ["--column", `${known}=${name}${unit ? `:${unit}` : ""}`]);
}
