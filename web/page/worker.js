// Runs the program, away from the page: one command at a time, each in a memory of its own, so that nothing is left of the last.

import { Files, run } from "./wasi.js";

let compiled;

/** Compiles the program once. */
function program() {
  compiled ??= (async () => {
    const answer = await fetch("rigident.wasm");
    if (!answer.ok) throw new Error(`the program (rigident.wasm) is not beside this page: ${answer.status}`);
    return WebAssembly.compile(await answer.arrayBuffer());
  })();
  return compiled;
}

onmessage = async ({ data: { id, words, files } }) => {
  const errors = [];
  const heard = (text) => {
    errors.push(text);
    postMessage({ id, words: text });
  };
  try {
    const module = await program();
    const system = new Files();
    for (const [path, file] of files) {
      system.put(path, new Uint8Array(typeof file === "string" ? new TextEncoder().encode(file) : await file.arrayBuffer()));
    }
    const given = new Set(system.files.keys());
    const ended = await run(module, words, system, heard);
    const written = [...system.files].filter(([path]) => !given.has(path));
    const made = written.map(([path, file]) => [path, file.content().slice()]);
    postMessage({ id, status: ended.status, output: ended.output, errors: errors.join(""), made });
  } catch (error) {
    postMessage({ id, failed: failure(error, errors.join("")) });
  }
};

/** Words for the failure of a program that did not come to its end. */
function failure(error, said) {
  if (error instanceof WebAssembly.RuntimeError) {
    const last = said.trim().split("\n").slice(-3).join(" ");
    const memory = /alloc|memory/i.test(last + error.message);
    return memory
      ? "the browser gave no more memory: use the program, which takes larger files"
      : `a fault of Rigident, not of the file: ${last || error.message}. Please report it.`;
  }
  return error.name === "NotReadableError"
    ? "the file cannot be read any more: it was changed or moved since it was chosen; choose it again"
    : error.message;
}
