// Motion in a recording, before anything is identified: how much there is, and which parameters it can show.

import { by, digits, make } from "./dom.js";

const DEGREE = Math.PI / 180;
/** Below these a motion is hardly there: a tilt of 2°, a rate of 0.05 rad/s. */
const LEAST_TILT_RAD = 2 * DEGREE;
const LEAST_RATE_RADPS = 0.05;

/** One line of words on rows, rate and gaps. */
export function words(seen) {
  const rate = seen.rate_hz ? `, ${digits(seen.rate_hz, 6)} rows per second over ${digits(seen.duration_s)} s` : "";
  const gaps = seen.is_static ? "" : seen.gaps === 0 ? ", no gaps" : `, ${seen.gaps} gap${seen.gaps === 1 ? "" : "s"}, the longest of ${digits(seen.longest_gap_s, 3)} s`;
  return `${seen.rows} ${seen.is_static ? "still poses" : "rows"}${rate}${gaps}.`;
}

/** Shows the motion, and the parameters that it can show. */
export function show(seen) {
  const tilt = seen.tilt_rms_rad;
  const degrees = (rad) => `${digits(rad / DEGREE, 2)}°`;
  const rows = [];
  const add = (what, from, tells) => rows.push([what, from, tells]);
  add("mass", seen.force_n === null ? "no force is measured" : `mean force ${digits(seen.force_n, 3)} N`, seen.force_n !== null);
  if (tilt) {
    add("centre of mass across gravity", "moments of its weight", seen.force_n !== null);
    add("centre of mass in all directions", `gravity moves over the body by ${degrees(tilt[0])} and ${degrees(tilt[1])}, 1 σ, about two axes`,
      tilt[0] > LEAST_TILT_RAD);
  }
  for (const [k, axis] of ["x", "y", "z"].entries()) {
    const rate = seen.rate_rms_radps?.[k];
    if (rate !== undefined) {
      add(`inertia about the IMU's ${axis}`, `turns at ${digits(rate, 2)} rad/s about it, root mean square`, rate > LEAST_RATE_RADPS);
    }
  }
  if (!seen.rate_rms_radps) add("inertia", seen.is_static ? "still poses have none in them" : "no angular rate is measured", false);
  const line = ([what, from, tells]) => make("tr", {}, make("th", { scope: "row" }, what), make("td", {}, tells ? "yes" : "hardly, or not"), make("td", { class: "soft" }, from));
  const head = ["of the body", "seen", "by"].map((name) => make("th", { scope: "col" }, name));
  by("tells-table").replaceChildren(make("table", {}, make("caption", { class: "hidden" }, "Motion in the recording"), make("thead", {}, make("tr", {}, ...head)), make("tbody", {}, ...rows.map(line))),
    make("p", { class: "soft" }, "By its motion alone: how well, and whether the readings agree, the answer says."));
}
