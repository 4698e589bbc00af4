// The page: from files to an answer. What the program decides, it decides; this shows it.

import * as columns from "./columns.js";
import { by, digits, download, make, select } from "./dom.js";
import * as poses from "./poses.js";
import { Cancelled, call, cancel, complaint } from "./program.js";
import * as rig from "./rig.js";
import * as store from "./store.js";
import * as tells from "./tells.js";

/** More than this is not read in a browser, whose programs have 4 GiB: files, their numbers and what is made of them. */
const MOST_BYTES = 400 * 1024 * 1024;
const MIB = 1024 * 1024;

const files = new Map();
let recording;
let seen;
let chosen = {};
let ownRig;
let answer;

const ending = (name) => name.slice(name.lastIndexOf(".") + 1).toLowerCase();
const isRig = (name) => name.endsWith(".rig.toml");
const isPerson = (name) => ["c3d", "trc"].includes(ending(name));
const stem = (name) => (name.includes(".") ? name.slice(0, name.lastIndexOf(".")) : name);
/** Files that only go with others. */
const isBeside = (name) => isRig(name) || ["mot", "sto", "toml", "osim", "xml", "json", "factor"].includes(ending(name));

function say(words, kind = "") {
  by("state").textContent = words;
  by("state").className = `status ${kind}`;
}

function complain(id, words) {
  by(id).textContent = words ?? "";
  by(id).hidden = !words;
}

// Files.

async function add(list) {
  const refused = [];
  for (const file of list) {
    const whole = [...files.values()].reduce((sum, other) => sum + other.size, file.size);
    if (file.size === 0) refused.push(`${file.name} is empty`);
    else if (whole > MOST_BYTES) {
      refused.push(`${file.name} has ${digits(file.size / MIB, 3)} MiB: this page reads ${MOST_BYTES / MIB} MiB in all. The program reads files of this size: rigident identify ${file.name}`);
    } else files.set(file.name, file);
  }
  ownRig = undefined;
  await store.keep("answer", undefined);
  await store.keep("files", [...files.values()]);
  await taken();
  if (refused.length > 0) say(refused.join(". "), "bad");
}

/** Shows the files, and looks at the recording among them. */
async function taken() {
  const candidates = [...files.keys()].filter((name) => !isBeside(name));
  if (!candidates.includes(recording)) recording = candidates[0];
  const rows = [...files.values()].map((file) => {
    const several = candidates.length > 1 && candidates.includes(file.name) && !isPerson(file.name);
    const choice = several ? make("input", { type: "radio", name: "recording", value: file.name, checked: file.name === recording, "aria-label": `Identify from ${file.name}`,
      onchange: () => { recording = file.name; chosen = {}; ownRig = undefined; look(); } }) : undefined;
    const remove = make("button", { type: "button", "aria-label": `Remove ${file.name}`, onclick: async () => { files.delete(file.name); chosen = {}; await store.keep("files", [...files.values()]); await taken(); } }, "Remove");
    return make("li", {}, choice, make("span", {}, file.name), make("span", { class: "soft" }, `${digits(file.size / 1024, 3)} KiB`), remove);
  });
  by("files").replaceChildren(...rows);
  await look();
}

function hideAll() {
  for (const id of ["understood", "person", "tells", "job"]) by(id).hidden = true;
  by("answer").hidden = true;
  complain("job-error");
}

/** The rig file beside the recording: one that was chosen, under its own or another name. */
function rigOf(name) {
  const own = files.get(`${stem(name)}.rig.toml`);
  const others = [...files.values()].filter((file) => isRig(file.name));
  return own ?? (others.length === 1 ? others[0] : undefined);
}

/** What the program finds: the recording, and everything that may go with it. */
function given(rigText) {
  const all = [...files.values()].map((file) => [file.name, file]);
  if (rigText === undefined) return all;
  const name = `${stem(recording)}.rig.toml`;
  return [...all.filter(([other]) => other !== name), [name, rigText]];
}

/** Shows what is understood of the recording. */
async function look() {
  hideAll();
  seen = undefined;
  if (recording === undefined) {
    say(files.size === 0 ? "Ready. Choose a recording." : "A rig file, and no recording: choose that, too.");
    return;
  }
  if (isPerson(recording)) return person();
  const beside = rigOf(recording);
  const rigText = ownRig ?? (beside ? await beside.text() : undefined);
  say(`Reading ${recording} …`);
  const words = ["import", "--look", "--json", recording];
  if (rigText === undefined) words.push(...columns.options(chosen), "--sign", by("sign").value.replace("_", "-"));
  let ended;
  try {
    ended = await call(words, given(rigText));
  } catch (error) {
    return say(error.message, "bad");
  }
  by("understood").hidden = false;
  if (ended.status !== 0) {
    by("understood-words").textContent = "";
    by("columns").replaceChildren();
    by("rig-form").hidden = true;
    by("rig-details").hidden = rigText === undefined;
    if (rigText !== undefined) by("rig").value = rigText;
    complain("understood-error", complaint(ended));
    return say(`${recording} cannot be read as it is.`, "bad");
  }
  show(JSON.parse(ended.output).files[0], rigText);
}

function show(file, rigText) {
  seen = file;
  const isByRig = rigText !== undefined;
  const how = Object.entries(file.written ?? {}).map(([key, value]) => `${key}: ${value}`);
  if (file.header_line) how.push(`header in line ${file.header_line}`);
  const parts = [`${file.file}${how.length ? ` (${how.join("; ")})` : ""}.`];
  if (file.recording) parts.push(tells.words(file.recording));
  if (isByRig) parts.push(ownRig === undefined ? `The rig file ${rigOf(recording).name} says what its columns are.` : "The rig file below, as you changed it, says what its columns are.");
  parts.push(...(file.warnings ?? []));
  by("understood-words").textContent = parts.join(" ");
  complain("understood-error", file.error);
  by("rig-form").hidden = isByRig || !file.columns;
  by("rig-details").hidden = false;
  by("own-rig").hidden = ownRig === undefined;
  if (file.columns) {
    columns.show(file, chosen, async (said) => {
      chosen = said;
      await keepForm();
      const focused = document.activeElement?.dataset;
      await look();
      if (focused?.column) document.querySelector(`[data-column="${focused.column}"]`)?.focus();
      if (focused?.unit) document.querySelector(`[data-unit="${focused.unit}"]`)?.focus();
    });
  } else by("columns").replaceChildren();
  by("rig").value = isByRig ? rigText : file.rig ?? "";
  refresh();
  const ready = file.recording && !file.error;
  if (ready) tells.show(file.recording);
  by("tells").hidden = by("job").hidden = !ready;
  if (ready) say(`${recording} is understood. Look through it, then identify.`, "good");
  else say(`${recording}: ${file.error ? "something is still to be said" : "it is not understood"}.`, "fair");
}

const hasImu = () => seen?.recording?.columns.some((name) => name.startsWith("imu")) === true;
const isFromForm = () => seen?.rig !== undefined && ownRig === undefined && !rigOf(recording);

/** Puts the form into the rig file and the sketch. */
function refresh() {
  by("imu-form").hidden = !hasImu();
  rig.sketch(hasImu());
  if (isFromForm()) by("rig").value = rig.text(seen.rig, hasImu());
}

const keepForm = () => store.keep("form", { ...rig.kept(), chosen, recording, ownRig, height: by("height").value, poses: poses.rows(), poseSign: by("pose-sign").value, posesShown: !by("poses").hidden });

// A person.

function person() {
  by("person").hidden = by("job").hidden = false;
  const trials = [...files.keys()].filter(isPerson);
  const roles = trials.map((name) => make("label", {}, `${name}: `, select({ "data-trial": name, "aria-label": `What ${name} is` },
    [["motion", "a motion"], ["static", "standing upright"], ["", "not used"]], /stand|static|t-?pose/i.test(name) ? "static" : "motion")));
  by("person-trials").replaceChildren(...roles);
  say("A person's trials: say which one is of standing upright, and the height.", "good");
}

function personWords() {
  const role = (wanted) => [...document.querySelectorAll("[data-trial]")].filter((list) => list.value === wanted).map((list) => list.dataset.trial);
  const words = ["body", "identify", ...role("motion"), ...role("static").flatMap((name) => ["--static", name])];
  const height = by("height").value.trim();
  return height === "" ? words : [...words, "--height-m", height];
}

// The answer.

async function identify() {
  const words = isPerson(recording) ? personWords() : ["identify", recording];
  const rigText = isPerson(recording) || by("rig").value.trim() === "" ? undefined : by("rig").value;
  by("answer").hidden = true;
  complain("job-error");
  running(true);
  const begun = performance.now();
  const progress = (text) => {
    const last = text.trim().split("\n").at(-1);
    if (last) by("progress-words").textContent = last;
  };
  try {
    const ended = await call([...words, "--json", "--out", "answer"], given(rigText), progress);
    if (ended.status > 1 || ended.made.length === 0) {
      complain("job-error", complaint(ended));
      return say("There is no answer.", "bad");
    }
    answer = { output: ended.output, made: ended.made, of: recording, rigText };
    showAnswer(answer, `${digits((performance.now() - begun) / 1000, 2)} s`);
    by("headline").focus();
    await store.keep("answer", answer);
  } catch (error) {
    if (error instanceof Cancelled) return say("Cancelled. Nothing was kept.", "fair");
    complain("job-error", error.message);
    say("There is no answer.", "bad");
  } finally {
    running(false);
  }
}

function running(is) {
  by("cancel").hidden = by("progress").hidden = !is;
  by("identify").disabled = is;
  by("progress-words").textContent = "";
  if (is) {
    say("Identifying …");
    by("cancel").focus();
  }
}

const STATUS = {
  identified: ["Everything is identified.", "good"],
  partly_identified: ["Partly identified.", "fair"],
  not_identified: ["Not identified.", "bad"],
  implausible: ["This recording cannot be true: do not use the numbers.", "bad"],
};
const TYPES = { json: "application/json", html: "text/html", toml: "text/plain" };

function showAnswer(found, took) {
  const result = JSON.parse(found.output);
  const [words, kind] = STATUS[result.status] ?? [result.status ?? "Done.", "fair"];
  by("answer").hidden = false;
  by("headline").textContent = words;
  by("headline").className = `status ${kind}`;
  say(took ? `${words} It took ${took}.` : words, kind);
  const buttons = found.made.map(([path, bytes]) => {
    const name = path.replace(/^answer\//, "");
    return make("button", { type: "button", onclick: () => download(name.replaceAll("/", "-"), bytes, TYPES[ending(name)]) }, `Download ${name}`);
  });
  if (found.rigText) buttons.push(make("button", { type: "button", onclick: () => download(`${stem(found.of)}.rig.toml`, found.rigText, "text/plain") }, "Download the rig file"));
  by("downloads").replaceChildren(...buttons);
  by("next").replaceChildren(next(result, found));
  const report = found.made.find(([path]) => path === "answer/report.html");
  by("report").hidden = report === undefined;
  if (report) {
    const old = by("report").src;
    by("report").src = URL.createObjectURL(new Blob([report[1]], { type: "text/html" }));
    if (old.startsWith("blob:")) URL.revokeObjectURL(old);
  }
}

/** What to do next: the program's advice, and the same in a terminal. */
function next(result, found) {
  const lines = [...(result.advice ?? []), ...(result.warnings ?? []).slice(0, 3)];
  if (lines.length === 0 && result.status === "identified") {
    lines.push("Take a second recording of the same body, put on anew: two answers that agree within their uncertainties say more than one.");
  }
  const list = make("ul", {}, ...lines.map((line) => make("li", {}, line)));
  const command = isPerson(found.of) ? `rigident ${personWords().join(" ")}` : `rigident identify ${found.of}`;
  return make("div", { class: "box" }, make("h3", {}, "What to do next"), list, make("p", { class: "soft" }, `The same in a terminal, with the files beside each other: ${command}`));
}

// Beginning.

async function example() {
  const names = ["bracket.csv", "bracket.rig.toml"];
  try {
    const loaded = await Promise.all(names.map(async (name) => {
      const got = await fetch(`example/${name}`);
      if (!got.ok) throw new Error(`${name} is not beside this page`);
      return new File([await got.blob()], name);
    }));
    files.clear();
    recording = undefined;
    await add(loaded);
  } catch (error) {
    say(`The example cannot be loaded: ${error.message}`, "bad");
  }
}

async function takePoses() {
  const made = poses.recording();
  if (made.wrong) {
    made.at.focus();
    return say(`${made.wrong}.`, "bad");
  }
  files.clear();
  recording = undefined;
  by("poses").hidden = true;
  await add([new File([made.text], "poses.csv"), new File([poses.rig(by("pose-sign").value)], "poses.rig.toml")]);
  await keepForm();
}

function listen() {
  by("choose").addEventListener("change", async (event) => {
    const list = [...event.target.files];
    event.target.value = "";
    await add(list);
  });
  for (const name of ["dragover", "dragleave", "drop"]) {
    document.addEventListener(name, (event) => {
      event.preventDefault();
      by("drop").classList.toggle("over", name === "dragover");
      if (name === "drop") add([...event.dataTransfer.files]);
    });
  }
  by("example").addEventListener("click", example);
  by("by-level").addEventListener("click", () => {
    by("poses").hidden = false;
    document.querySelector("#pose-table input").focus();
    keepForm();
  });
  by("take-poses").addEventListener("click", takePoses);
  by("forget").addEventListener("click", async () => {
    await store.forget();
    location.reload();
  });
  by("identify").addEventListener("click", identify);
  by("cancel").addEventListener("click", () => cancel());
  by("download-rig").addEventListener("click", () => download(`${stem(recording)}.rig.toml`, by("rig").value, "text/plain"));
  by("rig").addEventListener("change", () => { ownRig = by("rig").value; keepForm(); look(); });
  by("own-rig").addEventListener("click", () => { ownRig = undefined; keepForm(); look(); });
  by("sign").addEventListener("change", () => { keepForm(); look(); });
  by("height").addEventListener("input", keepForm);
  by("pose-sign").addEventListener("change", keepForm);
  rig.listen(() => { refresh(); keepForm(); });
  poses.start(keepForm);
}

async function begin() {
  listen();
  const [old, form, last] = await Promise.all(["files", "form", "answer"].map(store.kept));
  if (form) {
    rig.restore(form);
    ({ chosen = {}, recording, ownRig } = form);
    by("height").value = form.height ?? "";
    by("pose-sign").value = form.poseSign ?? "on_body";
    by("poses").hidden = !form.posesShown;
  }
  poses.fill(form?.poses);
  for (const file of old ?? []) files.set(file.name, file);
  await taken();
  if (last && last.of === recording) {
    answer = last;
    by("job").hidden = false;
    showAnswer(last);
  }
  // Without it the page still works, but not offline.
  navigator.serviceWorker?.register("sw.js").catch(() => undefined);
  try {
    by("version").textContent = (await call(["--version"], [])).output.trim();
  } catch (error) {
    say(error.message, "bad");
  }
}

begin();
