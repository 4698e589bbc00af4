// The answer: the report, the files to download, the next step, and a person's motion.

import { by, download, make } from "./dom.js";

const STATUS = {
  identified: ["Everything is identified.", "good"],
  partly_identified: ["Partly identified.", "fair"],
  not_identified: ["Not identified.", "bad"],
  implausible: ["This recording cannot be true: do not use the numbers.", "bad"],
};
const TYPES = { json: "application/json", html: "text/html", toml: "text/plain" };

const ending = (name) => name.slice(name.lastIndexOf(".") + 1).toLowerCase();
const stem = (name) => name.replace(/\.rig\.toml$/, "").replace(/\.[^.]*$/, "");

/** Shows a page in a frame; the page that was there is let go. */
export function frame(of, bytes) {
  const old = of.src;
  of.src = URL.createObjectURL(new Blob([bytes], { type: "text/html" }));
  if (old.startsWith("blob:")) URL.revokeObjectURL(old);
}

/** Shows an answer: `{output, made, of, rigText, words}`. Returns its status in words, and its kind. */
export function show(found) {
  const result = JSON.parse(found.output);
  const [words, kind] = STATUS[result.status] ?? [result.status ?? "Done.", "fair"];
  by("answer").hidden = false;
  by("headline").textContent = words;
  by("headline").className = `status ${kind}`;
  const buttons = found.made.map(([path, bytes]) => {
    const name = path.replace(/^answer\//, "");
    return make("button", { type: "button", onclick: () => download(name.replaceAll("/", "-"), bytes, TYPES[ending(name)]) }, `Download ${name}`);
  });
  if (found.rigText) buttons.push(make("button", { type: "button", onclick: () => download(`${stem(found.of)}.rig.toml`, found.rigText, "text/plain") }, "Download the rig file"));
  by("downloads").replaceChildren(...buttons);
  by("next").replaceChildren(next(result, found));
  const report = found.made.find(([path]) => path === "answer/report.html");
  by("report").hidden = report === undefined;
  if (report) frame(by("report"), report[1]);
  motions(found.made.filter(([path]) => /^answer\/motion(-\d+)?\.html$/.test(path)));
  return [words, kind];
}

/** Shows the motions of a person's trials as they were used. Their scripts run, and reach nothing. */
function motions(pages) {
  for (const old of by("motions").querySelectorAll("iframe")) URL.revokeObjectURL(old.src);
  by("motions").replaceChildren(...pages.flatMap(([path, bytes], k) => {
    const name = pages.length === 1 ? "Motion" : `Motion ${k + 1}`;
    const shown = make("iframe", { title: `${name} of the answer over time`, sandbox: "allow-scripts", referrerpolicy: "no-referrer", "data-page": path });
    frame(shown, bytes);
    return [make("h3", {}, name), shown];
  }));
}

/** The next steps: the program's advice, and the same in a terminal. */
function next(result, found) {
  const lines = [...(result.advice ?? []), ...(result.warnings ?? []).slice(0, 3)];
  if (lines.length === 0 && result.status === "identified") {
    lines.push("Take a second recording of the same body, put on anew: two answers that agree within their uncertainties say more than one.");
  }
  const list = make("ul", {}, ...lines.map((line) => make("li", {}, line)));
  const command = ["rigident", ...(found.words ?? ["identify", found.of])].map((word) => (/\s/.test(word) ? `"${word}"` : word)).join(" ");
  return make("div", { class: "box" }, make("h3", {}, "Next steps"), list, make("p", { class: "soft" }, `The same in a terminal, with the files beside each other: ${command}`));
}
