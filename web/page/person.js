// A person: trials and their roles, markers on their segments, and the trial over time.

import { frame } from "./answer.js";
import { by, digits, download, make, select } from "./dom.js";
import { Cancelled, complaint } from "./program.js";

const ending = (name) => name.slice(name.lastIndexOf(".") + 1).toLowerCase();
const stem = (name) => name.slice(0, name.lastIndexOf("."));
/** The file that says which segments markers are on. */
const MARKERS = "page.markers.toml";

export const isTrial = (name) => ["c3d", "trc"].includes(ending(name));

/** The user's statements: role and forces by trial, segment by marker, height and mass. */
const state = { roles: {}, grounds: {}, own: {} };
let names = [];
let calls;

const trials = () => names.filter(isTrial);
const forces = () => names.filter((name) => ["mot", "sto"].includes(ending(name)));
const roleOf = (name) => state.roles[name] ?? (/stand|static|t-?pose|calib/i.test(name) && trials().length > 1 ? "static" : "motion");
/** The forces of a TRC trial: chosen, by its name, or the only ones there are. */
function groundOf(name) {
  if (ending(name) !== "trc") return "";
  if (forces().includes(state.grounds[name]) || state.grounds[name] === "") return state.grounds[name];
  const own = forces().find((file) => file.startsWith(stem(name)));
  return own ?? (forces().length === 1 && roleOf(name) === "motion" ? forces()[0] : "");
}

/** Listens to the form; `changed` is called after each change. */
export function listen(changed) {
  for (const id of ["height", "mass"]) by(id).addEventListener("input", changed);
  by("trial").addEventListener("change", () => look());
  by("download-markers").addEventListener("click", () => download(MARKERS, markersText(), "text/plain"));
}

/** Shows the trials among files, by name; `run` calls the program with words and more files, `changed` is called after a choice. */
export async function show(all, callbacks) {
  names = all;
  calls = callbacks;
  const list = (kind, name, choices, chosen, words) => make("label", { class: "inline" }, words, select({ [`data-${kind}`]: name, "aria-label": `${words} of ${name}`, onchange: (event) => {
    (kind === "trial" ? state.roles : state.grounds)[name] = event.target.value;
    calls.changed();
    look();
  } }, choices, chosen));
  by("person-trials").replaceChildren(...trials().map((name) => make("div", { class: "trial" }, make("b", {}, name), " ",
    list("trial", name, [["motion", "a motion"], ["static", "standing upright"], ["", "not used"]], roleOf(name), "Role "),
    ...(ending(name) === "trc" && forces().length > 0 ? [list("ground", name, [["", "none"], ...forces().map((file) => [file, file])], groundOf(name), "Forces ")] : []))));
  const shown = trials().includes(by("trial").value) ? by("trial").value : (trials().find((name) => roleOf(name) === "motion") ?? trials()[0]);
  by("trial").replaceChildren(...trials().map((name) => make("option", { value: name, selected: name === shown }, name)));
  await look();
}

let looks = 0;

/** Looks at the chosen trial. */
async function look() {
  const [trial, own] = [by("trial").value, ++looks];
  const ground = groundOf(trial);
  complain();
  let ended;
  try {
    ended = await calls.run(["body", "markers", trial, "--json", "--page", "page.html", ...(ground === "" ? [] : ["--ground", ground])], []);
  } catch (error) {
    if (own === looks) complain(error instanceof Cancelled ? "Cancelled: the trial was not read." : error.message);
    return;
  }
  if (own !== looks) return;
  const page = ended.made.find(([path]) => path === "page.html");
  by("markers-shown").hidden = page === undefined;
  if (page === undefined) {
    complain(complaint(ended));
    return;
  }
  frame(by("trial-motion"), page[1]);
  table(JSON.parse(ended.output));
}

/** Shows the markers of a trial, those of unknown names first. */
function table(found) {
  const unknown = found.markers.filter(({ segment }) => segment === null);
  const plates = found.plates.length === 0 ? "no forces of the ground" : `forces of ${found.plates.join(", ")}`;
  const parts = [`${found.frames} frames at ${digits(found.rate_hz, 5)} Hz, ${found.markers.length} markers, ${plates}.`, found.set ? `Marker set: ${found.set}.` : "No marker set is recognised by its names."];
  if (found.missing?.length) parts.push(`Missing of it: ${found.missing.join(", ")}.`);
  if (unknown.length > 0) parts.push(unknown.length === 1 ? "1 name is not known." : `${unknown.length} names are not known.`);
  if (found.bare_segments.length > 0) parts.push(`Too few markers on ${found.bare_segments.join(", ")}.`);
  by("markers-words").textContent = [...parts, ...found.notes].join(" ");
  by("markers-details").open = unknown.length > 0 && found.bare_segments.length > 0;
  const place = ({ joint, at_m: at }) => (joint === null || at === null ? "" : at.every((v) => v === 0) ? `centre of ${joint}` : `${at.map((v) => Math.round(1e3 * v)).join(", ")} mm forward, left, up of ${joint}`);
  const row = (marker) => make("tr", {}, make("th", { scope: "row" }, marker.name), make("td", {}, `${digits(100 * marker.seen, 3)} %`),
    make("td", {}, select({ "data-marker": marker.name, "aria-label": `Segment of marker ${marker.name}`, onchange: (event) => {
      if (event.target.value === "as known") delete state.own[marker.name];
      else state.own[marker.name] = event.target.value;
      calls.changed();
    } }, [["as known", marker.segment === null ? "not known, left out" : `${marker.segment}, by its name`], ["", "not used"], ...found.segments.map((name) => [name, name])], state.own[marker.name] ?? "as known")),
    make("td", { class: "soft" }, marker.segment === null ? "" : place(marker)));
  const head = ["marker", "seen", "segment", "place by its name"].map((words) => make("th", { scope: "col" }, words));
  const sorted = [...unknown, ...found.markers.filter(({ segment }) => segment !== null)];
  by("markers").replaceChildren(make("table", {}, make("caption", { class: "hidden" }, "Markers of the trial"), make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...sorted.map(row))));
}

function complain(words) {
  by("person-error").textContent = words ?? "";
  by("person-error").hidden = !words;
}

/** The file of the markers whose segment was chosen. */
const markersText = () => Object.entries(state.own).map(([name, segment]) => `[marker.${JSON.stringify(name)}]\nsegment = ${JSON.stringify(segment)}\n`).join("\n");

/** The files that the choices make. */
export const files = () => (Object.keys(state.own).length === 0 ? [] : [[MARKERS, markersText()]]);

/** The command line of the form. */
export function words() {
  const role = (wanted) => trials().filter((name) => roleOf(name) === wanted);
  const [motions, standing] = [role("motion"), role("static").slice(0, 1)];
  const made = ["body", "identify", ...motions, ...standing.flatMap((name) => ["--static", name])];
  for (const ground of motions.map(groundOf).filter((name) => name !== "")) made.push("--ground", ground);
  for (const [id, option] of [["height", "--height-m"], ["mass", "--mass-kg"]]) {
    const text = by(id).value.trim();
    if (text !== "") made.push(option, text);
  }
  const osim = names.filter((name) => ending(name) === "osim");
  if (osim.length === 1) made.push("--osim", osim[0]);
  const own = names.filter((name) => ending(name) === "toml" && !name.endsWith(".rig.toml"));
  if (files().length > 0) made.push("--markers", MARKERS);
  else if (own.length === 1) made.push("--markers", own[0]);
  return made;
}

/** The form, to be kept over a reload. */
export const kept = () => ({ ...state, height: by("height").value, mass: by("mass").value });

/** Puts back a form that was kept. */
export function restore(old) {
  Object.assign(state, { roles: old?.roles ?? {}, grounds: old?.grounds ?? {}, own: old?.own ?? {} });
  by("height").value = old?.height ?? "";
  by("mass").value = old?.mass ?? "";
}
