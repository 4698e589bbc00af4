// The certificate: a form of its statements, and the page that the program makes of them.

import { frame } from "./answer.js";
import { by, download, make } from "./dom.js";
import { stated } from "./rig.js";

/** The certificate's file, as the program writes it. */
export const NAME = "certificate.html";

/** Keys of [certificate] in groups, each with its words; * marks those that are required. */
const GROUPS = [
  ["Certificate and laboratory", [["number", "Number *"], ["laboratory", "Laboratory *"], ["laboratory_address", "Its address *"], ["place", "Measured at *"],
    ["measured_on", "Measured on *"], ["operator", "Measured by *"], ["authorised_by", "Authorised by *"]]],
  ["Customer and part", [["customer", "Customer *"], ["customer_address", "Its address *"], ["part", "Part *"], ["part_number", "Number of its drawing or type"],
    ["part_serial", "Serial number or mark *"], ["condition", "Condition"], ["received_on", "Received on"]]],
  ["Measurement", [["procedure", "Procedure *"], ["deviations", "Deviations from it"], ["conditions", "Conditions *"], ["traceability", "Traceability to the SI *"],
    ["external", "Provided by others"], ["remarks", "Remarks"]]],
];
/** Keys of the instruments' tables in the rig file. */
const INSTRUMENTS = [["[load_cell]", "Load cell"], ["[[imu]]", "IMU"]];
const OF_INSTRUMENTS = [["serial", "serial number *"], ["calibrated_on", "calibrated on *"]];

const field = (id, words, changed) => make("label", {}, words, make("input", { type: "text", id, autocomplete: "off", maxlength: 400, oninput: changed }));
const idOf = (header, key) => `certify-${header.replace(/\W/g, "")}-${key}`;
let page;

/** Makes the form; `changed` is called after each change. */
export function start(changed) {
  const group = (title, fields) => make("fieldset", {}, make("legend", {}, title), ...fields);
  const own = GROUPS.map(([title, keys]) => group(title, keys.map(([key, words]) => field(`certify-${key}`, words, changed))));
  const instruments = INSTRUMENTS.flatMap(([header, name]) => OF_INSTRUMENTS.map(([key, words]) => field(idOf(header, key), `${name}: ${words}`, changed)));
  by("certificate-fields").replaceChildren(...own, group("Instruments, as the rig file has them", instruments));
  by("download-certificate").addEventListener("click", () => download(NAME, page, "text/html"));
  // Its frame runs no scripts; printing is this page's.
  by("print-certificate").addEventListener("click", () => by("certificate-page").contentWindow.print());
}

/** Offers a certificate, or none; the fields of an IMU that the rig file does not have are left out. */
export function offer(is, rigText) {
  by("certificate").hidden = !is;
  by("certificate-shown").hidden = true;
  complain();
  const hasImu = /^\s*\[\[\s*imu\s*\]\]/m.test(rigText);
  for (const [key] of OF_INSTRUMENTS) by(idOf("[[imu]]", key)).parentElement.hidden = !hasImu;
}

const value = (id) => by(id).value.trim();

/** Returns the program's options. */
export function options() {
  const keys = GROUPS.flatMap(([, own]) => own.map(([key]) => key)).filter((key) => value(`certify-${key}`) !== "");
  return ["--certificate", NAME, ...keys.flatMap((key) => ["--certify", `${key}=${value(`certify-${key}`)}`])];
}

/** Returns a rig file with the statements about the instruments. */
export function rigText(text) {
  return INSTRUMENTS.reduce((all, [header]) => {
    const keys = OF_INSTRUMENTS.map(([key]) => [key, by(idOf(header, key)).parentElement.hidden ? "" : value(idOf(header, key))]);
    return stated(all, header, Object.fromEntries(keys));
  }, text);
}

/** Shows the certificate, and lists the missing statements by the words of the program. */
export function show(bytes, errors) {
  page = bytes;
  by("certificate-shown").hidden = false;
  const draft = /is a draft: ([\s\S]*?)\. State keys of/.exec(errors)?.[1];
  by("certificate-words").textContent = draft ? `A draft: ${draft.replace(/ \((certificate|load_cell|imu)\.\w+\)/g, "")}.` : "The certificate is complete.";
  by("certificate-words").className = `status ${draft ? "fair" : "good"}`;
  frame(by("certificate-page"), bytes);
  by("certificate-words").focus();
}

export function complain(words) {
  by("certificate-error").textContent = words ?? "";
  by("certificate-error").hidden = !words;
}

const inputs = () => [...by("certificate-fields").querySelectorAll("input")];

/** The form, to be kept over a reload. */
export const kept = () => Object.fromEntries(inputs().map((input) => [input.id, input.value]));

/** Puts back a form that was kept. */
export function restore(old) {
  for (const input of inputs()) input.value = old?.[input.id] ?? "";
}
