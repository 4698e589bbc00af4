// Commands of the program, as the page calls them.

/** Thrown for a command that was cancelled. */
export class Cancelled extends Error {}

let worker;
let number = 0;
let waiting;

function start() {
  worker ??= new Worker("worker.js", { type: "module" });
  worker.onmessage = ({ data }) => {
    if (data.id !== waiting?.id) return;
    if (data.words !== undefined) return waiting.heard(data.words);
    const { resolve, reject } = waiting;
    waiting = undefined;
    if (data.failed !== undefined) reject(new Error(data.failed));
    else resolve(data);
  };
  worker.onerror = (event) => {
    event.preventDefault();
    const reject = waiting?.reject;
    waiting = undefined;
    worker = undefined;
    reject?.(new Error(`the program cannot be started: ${event.message ?? "its worker was not loaded"}`));
  };
}

let queue = Promise.resolve();

/**
 * Runs a command: `words` as on a command line, `files` as pairs of path and File, Blob or text. `heard` is called with the text of
 * standard error as it comes. Returns `{status, output, errors, made}`; `made` are pairs of path and bytes.
 */
export function call(words, files, heard = () => {}) {
  const job = () =>
    new Promise((resolve, reject) => {
      start();
      waiting = { id: ++number, resolve, reject, heard };
      worker.postMessage({ id: number, words, files });
    });
  const called = queue.then(job);
  queue = called.catch(() => {});
  return called;
}

/** Ends the command that runs, if one does. */
export function cancel() {
  const reject = waiting?.reject;
  waiting = undefined;
  worker?.terminate();
  worker = undefined;
  reject?.(new Cancelled("cancelled"));
}

/** The program's complaint: its object's error, or its last words on standard error. */
export function complaint({ output, errors }) {
  try {
    const { error } = JSON.parse(output);
    if (typeof error === "string") return error;
  } catch {
    // No object: its words say it.
  }
  return errors.replace(/^rigident: /gm, "").trim() || "it ended without a word";
}
