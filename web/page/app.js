// The page: from files to an answer. Decisions are the program's; this shows them.

import * as answers from "./answer.js";
import * as certificate from "./certificate.js";
import * as clocks from "./clocks.js";
import * as columns from "./columns.js";
import { by, digits, download, make } from "./dom.js";
import * as people from "./person.js";
import * as poses from "./poses.js";
import { Cancelled, call, cancel, complaint } from "./program.js";
import * as rig from "./rig.js";
import * as store from "./store.js";
import * as tells from "./tells.js";

/** More than this is not read in a browser, whose programs have 4 GiB: files, their numbers and the rows made of them. */
const MOST_BYTES = 400 * 1024 * 1024;
const MIB = 1024 * 1024;
/** The rig file of several tables that are one recording. */
const TOGETHER = "together.rig.toml";
/** Progress is shown of work that takes longer than this, ms. */
const SHOWN_AFTER = 300;

const files = new Map();
/** Rig files that list streams. */
const listing = new Set();
let recording;
let seen;
let chosen = {};
let ownRig;

const ending = (name) => name.slice(name.lastIndexOf(".") + 1).toLowerCase();
const isRig = (name) => name.endsWith(".rig.toml");
const isPerson = (name) => people.isTrial(name);
const stem = (name) => (name.includes(".") ? name.slice(0, name.lastIndexOf(".")) : name);
/** Files that only go with others. */
const isBeside = (name) => isRig(name) || ["mot", "sto", "toml", "osim", "xml", "json", "factor"].includes(ending(name));
const tables = () => [...files.keys()].filter((name) => !isBeside(name) && !isPerson(name));
/** The recording consists of several files. */
const isOfStreams = () => recording === TOGETHER || listing.has(recording);

function say(words, kind = "") {
  by("state").textContent = words;
  by("state").className = `status ${kind}`;
}

function complain(id, words) {
  by(id).textContent = words ?? "";
  by(id).hidden = !words;
}

let running = 0;

/** Runs a command with its progress, and a way to cancel it, which gets the focus if `isAwaited`. */
async function run(words, given, isAwaited = false) {
  running++;
  by("identify").disabled = by("make-certificate").disabled = true;
  by("progress-words").textContent = "";
  by("progress-bar").removeAttribute("value");
  const shown = setTimeout(() => {
    by("progress").hidden = false;
    if (isAwaited) by("cancel").focus();
  }, SHOWN_AFTER);
  try {
    return await call(words, given, (text) => {
      const last = text.trim().split("\n").at(-1);
      if (!last) return;
      by("progress-words").textContent = last;
      const share = /\s(\d+) %, \d+ s$/.exec(last)?.[1];
      if (share === undefined) by("progress-bar").removeAttribute("value");
      else by("progress-bar").value = Number(share) / 100;
    });
  } finally {
    clearTimeout(shown);
    if (--running === 0) {
      by("progress").hidden = true;
      by("identify").disabled = by("make-certificate").disabled = false;
    }
  }
}

// Files.

async function add(list) {
  const [refused, taking] = [[], []];
  for (const file of list) {
    const whole = [...files.values()].reduce((sum, other) => sum + other.size, file.size);
    if (file.size === 0) refused.push(`${file.name} is empty`);
    else if (whole > MOST_BYTES) {
      refused.push(`${file.name} has ${digits(file.size / MIB, 3)} MiB: this page reads ${MOST_BYTES / MIB} MiB in all. The program reads files of this size: rigident identify ${file.name}`);
    } else {
      files.set(file.name, file);
      taking.push(file.name);
    }
  }
  ownRig = undefined;
  await store.keep("answer", undefined);
  await store.keep("files", [...files.values()]);
  await taken(taking);
  if (refused.length > 0) say(refused.join(". "), "bad");
}

async function remove(name) {
  files.delete(name);
  chosen = {};
  await store.keep("files", [...files.values()]);
  await taken();
}

/** The recordings that can be made of the files: their names, and words. */
function recordings() {
  const found = [...listing].map((name) => [name, `Identify from all files that ${name} lists`]);
  const single = tables();
  found.push(...single.map((name) => [name, `Identify from ${name}`]));
  if (single.length > 1 && listing.size === 0) found.push([TOGETHER, "Identify from all tables as one recording, each with its own clock"]);
  const trial = [...files.keys()].find(isPerson);
  if (trial !== undefined) found.push([trial, "Identify a person from the trials"]);
  return found;
}

/** Shows the files, and looks at the recording among them: one of those that are new, if any is. */
async function taken(fresh = []) {
  listing.clear();
  for (const file of files.values()) {
    if (isRig(file.name) && /^\s*\[\[\s*stream\s*\]\]/m.test(await file.text())) listing.add(file.name);
  }
  const all = recordings();
  const first = all.find(([name]) => fresh.includes(name));
  if (first !== undefined && recording !== TOGETHER) {
    [recording] = first;
    chosen = {};
  }
  if (!all.some(([name]) => name === recording)) recording = all[0]?.[0];
  by("files").replaceChildren(...[...files.values()].map((file) => make("li", {}, make("span", {}, file.name), make("span", { class: "soft" }, `${digits(file.size / 1024, 3)} KiB`),
    make("button", { type: "button", "aria-label": `Remove ${file.name}`, onclick: () => remove(file.name) }, "Remove"))));
  by("recordings").hidden = all.length < 2;
  by("recordings").replaceChildren(make("legend", {}, "Recording"), ...all.map(([name, words]) => make("label", {}, make("input", { type: "radio", name: "recording", value: name,
    checked: name === recording, onchange: () => { recording = name; chosen = {}; ownRig = undefined; keepForm(); look(); } }), ` ${words}`)));
  await look();
}

function hideAll() {
  for (const id of ["understood", "person", "clocks", "tells", "job", "answer", "certificate"]) by(id).hidden = true;
  complain("job-error");
}

/** The rig file beside the recording: one that was chosen, under its own or another name. */
function rigOf(name) {
  if (name === TOGETHER) return undefined;
  const own = files.get(isRig(name) ? name : `${stem(name)}.rig.toml`);
  const others = [...files.values()].filter((file) => isRig(file.name) && !listing.has(file.name));
  return own ?? (others.length === 1 ? others[0] : undefined);
}

/** The files that the program finds: the recording, and everything that may go with it. */
function given(rigText) {
  const all = [...files.values()].map((file) => [file.name, file]);
  if (rigText === undefined) return all;
  const name = isRig(recording) ? recording : `${stem(recording)}.rig.toml`;
  return [...all.filter(([other]) => other !== name), [name, rigText]];
}

let looks = 0;

/** Shows the recording as it is understood. */
async function look() {
  hideAll();
  seen = undefined;
  const own = ++looks;
  if (recording === undefined) {
    say(files.size === 0 ? "Ready. Choose a recording." : "A rig file, and no recording: choose that, too.");
    return;
  }
  if (isPerson(recording)) return person();
  const beside = rigOf(recording);
  const rigText = ownRig ?? (beside ? await beside.text() : undefined);
  const name = recording === TOGETHER ? tables().join(", ") : recording;
  say(`Reading ${name} …`);
  const words = ["import", "--look", "--json", ...(recording === TOGETHER && rigText === undefined ? tables() : [recording])];
  if (rigText === undefined) words.push(...columns.options(chosen), "--sign", by("sign").value.replace("_", "-"));
  let ended;
  try {
    ended = await run(words, given(rigText));
  } catch (error) {
    if (own !== looks) return undefined;
    return error instanceof Cancelled ? say(`Cancelled: ${name} was not read.`, "fair") : say(error.message, "bad");
  }
  if (own !== looks) return undefined;
  by("understood").hidden = false;
  if (ended.status !== 0) return unreadable(ended, name, rigText);
  const found = JSON.parse(ended.output);
  show(found, rigText);
  if (isOfStreams() && by("rig").value.trim() !== "") await lookAtClocks(own, rigText === undefined ? undefined : found.files[0]);
  return undefined;
}

function unreadable(ended, name, rigText) {
  by("understood-words").textContent = "";
  by("warnings").replaceChildren();
  by("columns").replaceChildren();
  by("rig-form").hidden = true;
  by("rig-details").hidden = rigText === undefined;
  if (rigText !== undefined) by("rig").value = rigText;
  complain("understood-error", complaint(ended));
  say(`${name} cannot be read as it is.`, "bad");
}

/** One line of words about how a file is written. */
function written(file) {
  const how = Object.entries(file.written ?? {}).map(([key, value]) => `${key}: ${value}`);
  if (file.header_line) how.push(`header in line ${file.header_line}`);
  return `${file.file}${how.length ? ` (${how.join("; ")})` : ""}.`;
}

function show(found, rigText) {
  const isByRig = rigText !== undefined;
  const tablesSeen = found.files.filter((file) => file.columns);
  const error = found.files.map((file) => file.error && (found.files.length > 1 ? `${file.file}: ${file.error}` : file.error)).filter(Boolean).join("\n");
  seen = { rig: found.rig ?? (found.files.length === 1 ? found.files[0].rig : undefined), recording: found.files.length === 1 ? found.files[0].recording : undefined,
    columns: found.files.flatMap((file) => file.recording?.columns ?? []) };
  const parts = found.files.map((file) => [written(file), file.recording && !isOfStreams() ? tells.words(file.recording) : ""].join(" ").trim());
  if (isByRig) parts.push(ownRig === undefined ? `The rig file ${rigOf(recording).name} names its columns.` : "The rig file below, as you changed it, names its columns.");
  if (!isOfStreams() && tables().length > 1 && seen.columns.length > 0) parts.push(partner());
  by("understood-words").textContent = parts.join(" ").trim();
  const warnings = found.files.flatMap((file) => file.warnings ?? []);
  by("warnings").replaceChildren(...(isOfStreams() && isByRig ? [] : warnings).map((words) => make("li", {}, words)));
  complain("understood-error", isOfStreams() && isByRig ? undefined : error);
  by("rig-form").hidden = isByRig || tablesSeen.length === 0;
  by("rig-details").hidden = false;
  by("own-rig").hidden = ownRig === undefined;
  if (tablesSeen.length > 0) columns.show(tablesSeen, chosen, rechosen);
  else by("columns").replaceChildren();
  by("rig").value = isByRig ? rigText : seen.rig ?? "";
  refresh();
  if (isOfStreams()) {
    if (error && !isByRig) say("Something is still to be said about the columns.", "fair");
    return;
  }
  ready(seen.recording && !error, error);
}

/** Says that another table may belong to a recording that lacks wrench or motion. */
function partner() {
  const has = (start) => seen.columns.some((name) => name.startsWith(start));
  const lacks = !has("fx_n") && !has("g1_v") ? "wrench" : !has("imu") && !has("gx_mps2") && !has("q") ? "motion" : undefined;
  return lacks ? `It has no ${lacks}: if another file has it, choose all tables as one recording above.` : "";
}

async function rechosen(said) {
  chosen = said;
  await keepForm();
  const focused = document.activeElement?.dataset;
  await look();
  if (focused?.column) document.querySelector(`[data-column="${focused.column}"]`)?.focus();
  if (focused?.unit) document.querySelector(`[data-unit="${focused.unit}"]`)?.focus();
}

function ready(is, error) {
  if (is) tells.show(seen.recording);
  by("tells").hidden = by("job").hidden = !is;
  const name = recording === TOGETHER ? "The recording" : recording;
  if (is) say(`${name} is understood. Look through it, then identify.`, "good");
  else say(`${name}: ${error ? "something is still to be said" : "it is not understood"}.`, "fair");
}

/** Shows the clocks of several files: by a look at their rig file that was taken before, or a new one. */
async function lookAtClocks(own, before) {
  let found = before;
  if (found === undefined) {
    try {
      const ended = await run(["import", "--look", "--json", recording], given(by("rig").value));
      if (own !== looks) return;
      if (ended.status !== 0) {
        complain("understood-error", complaint(ended));
        return say("The files are no recording together.", "bad");
      }
      found = JSON.parse(ended.output).files[0];
    } catch (error) {
      if (own !== looks) return;
      return error instanceof Cancelled ? say("Cancelled: the clocks were not compared.", "fair") : say(error.message, "bad");
    }
  }
  seen.recording = found.recording;
  by("clocks").hidden = false;
  complain("clocks-error", found.error);
  const isFree = recording === TOGETHER && ownRig === undefined;
  clocks.show(found, isFree ? rig.state.shifts : undefined, (file, seconds) => {
    rig.state.shifts[file] = seconds;
    keepForm();
    look();
  });
  ready(found.recording && !found.error, found.error);
}

const hasImu = () => seen?.columns.some((name) => name.startsWith("imu")) === true;
const isFromForm = () => seen?.rig !== undefined && ownRig === undefined && !rigOf(recording);

/** Puts the form into the rig file and the sketch. */
function refresh() {
  by("imu-form").hidden = !hasImu();
  rig.sketch(hasImu());
  if (isFromForm()) by("rig").value = rig.text(seen.rig, hasImu());
}

const keepForm = () => store.keep("form", { ...rig.kept(), chosen, recording, ownRig, person: people.kept(), certificate: certificate.kept(),
  poses: poses.rows(), poseSign: by("pose-sign").value, posesShown: !by("poses").hidden });

// A person.

function person() {
  by("person").hidden = by("job").hidden = false;
  say("A person's trials: say which one is of standing upright, and the height.", "good");
  return people.show([...files.keys()], { run: (words, more) => run(words, [...given(), ...more]), changed: keepForm });
}

// The answer.

/** The command of the present recording, and the rig file that goes with it. */
function command() {
  if (isPerson(recording)) return { words: people.words(), rigText: undefined, more: people.files() };
  const rigText = by("rig").value.trim() === "" ? undefined : by("rig").value;
  return { words: ["identify", recording], rigText, more: [] };
}

/** The command and the texts that go with it, to tell whether an answer is that of the present form. */
const asked = () => JSON.stringify(command());

async function identify() {
  const { words, rigText, more } = command();
  // As it is now: the form may change while the program runs.
  const [of, question] = [recording, asked()];
  by("answer").hidden = by("certificate").hidden = true;
  complain("job-error");
  say("Identifying …");
  const begun = performance.now();
  try {
    const ended = await run([...words, "--json", "--out", "answer"], [...given(rigText), ...more], true);
    if (ended.status > 1 || ended.made.length === 0) {
      complain("job-error", complaint(ended));
      return say("There is no answer.", "bad");
    }
    const answer = { output: ended.output, made: ended.made, of, asked: question, rigText, words, more };
    answered(answer, `${digits((performance.now() - begun) / 1000, 2)} s`);
    by("headline").focus();
    await store.keep("answer", answer);
  } catch (error) {
    if (error instanceof Cancelled) say("Cancelled. Nothing was kept.", "fair");
    else {
      complain("job-error", error.message);
      say("There is no answer.", "bad");
    }
    by("identify").focus();
  }
  return undefined;
}

function answered(answer, took) {
  const [words, kind] = answers.show(answer);
  say(took ? `${words} It took ${took}.` : words, kind);
  certificate.offer(!isPerson(answer.of) && kind !== "bad", rigTextOf(answer));
}

const rigTextOf = (answer) => answer.rigText ?? "";

/** Identifies once more, with a certificate of the answer. */
async function certify() {
  const { words, rigText } = command();
  const [of, question] = [recording, asked()];
  certificate.complain();
  const stated = certificate.rigText(rigText ?? "");
  try {
    const ended = await run([...words, "--json", "--out", "answer", ...certificate.options()], given(stated === "" ? undefined : stated), true);
    const page = ended.made.find(([path]) => path === certificate.NAME);
    if (page === undefined) return certificate.complain(complaint(ended));
    certificate.show(page[1], ended.errors);
    const answer = { output: ended.output, made: ended.made.filter(([path]) => path !== certificate.NAME), of, asked: question, rigText: stated === "" ? undefined : stated, words, more: [] };
    answers.show(answer);
    await store.keep("answer", answer);
    await keepForm();
  } catch (error) {
    certificate.complain(error instanceof Cancelled ? "Cancelled: there is no certificate." : error.message);
  }
  return undefined;
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
  by("make-certificate").addEventListener("click", certify);
  by("cancel").addEventListener("click", () => cancel());
  by("download-rig").addEventListener("click", () => download(isRig(recording) ? recording : `${stem(recording)}.rig.toml`, by("rig").value, "text/plain"));
  by("rig").addEventListener("change", () => { ownRig = by("rig").value; keepForm(); look(); });
  by("own-rig").addEventListener("click", () => { ownRig = undefined; keepForm(); look(); });
  by("sign").addEventListener("change", () => { keepForm(); look(); });
  by("pose-sign").addEventListener("change", keepForm);
  rig.listen(() => { refresh(); keepForm(); });
  people.listen(keepForm);
  certificate.start(keepForm);
  poses.start(keepForm);
}

async function begin() {
  listen();
  const [old, form, last] = await Promise.all(["files", "form", "answer"].map(store.kept));
  if (form) {
    rig.restore(form);
    people.restore(form.person);
    certificate.restore(form.certificate);
    ({ chosen = {}, recording, ownRig } = form);
    by("pose-sign").value = form.poseSign ?? "on_body";
    by("poses").hidden = !form.posesShown;
  }
  poses.fill(form?.poses);
  for (const file of old ?? []) files.set(file.name, file);
  await taken();
  // An answer to another question, of a clock or rig file changed since, is not shown again.
  if (last && last.of === recording && last.asked === asked()) {
    by("job").hidden = false;
    answered(last);
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
