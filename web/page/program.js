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
    if (data.message !== undefined) return waiting.report(data.message);
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
 * Runs a command: `words` as on a command line, `files` as pairs of path and File, Blob or text. `report` is called with what it says on
 * standard error. Returns `{status, output, errors, made}`; `made` are pairs of path and bytes.
 */
export function call(words, files, report = () => {}) {
  const job = () =>
    new Promise((resolve, reject) => {
      start();
      waiting = { id: ++number, resolve, reject, report };
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
  reject?.(new Cancelled("stopped"));
}

/** What a command said was wrong: its object's error, or the last words on standard error. */
export function complaint({ output, errors }) {
  try {
    const { error } = JSON.parse(output);
    if (typeof error === "string") return error;
  } catch {
    // No object: its words say it.
  }
  return errors.replace(/^rigident: /gm, "").trim() || "it ended without a word";
}
