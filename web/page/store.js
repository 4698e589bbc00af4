// Files, choices and the answer, kept on this computer over a reload, in the browser's own database.

const NAME = "rigident";
const STORE = "state";

function open() {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(NAME, 1);
    request.onupgradeneeded = () => request.result.createObjectStore(STORE);
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}

async function within(mode, act) {
  const database = await open();
  try {
    return await new Promise((resolve, reject) => {
      const transaction = database.transaction(STORE, mode);
      const request = act(transaction.objectStore(STORE));
      transaction.oncomplete = () => resolve(request.result);
      transaction.onerror = transaction.onabort = () => reject(transaction.error ?? request.error);
    });
  } finally {
    database.close();
  }
}

/** Keeps a value under a name; false where the browser keeps nothing (a private window, a full disk). */
export const keep = (name, value) => within("readwrite", (store) => store.put(value, name)).then(() => true, () => false);

/** Returns the value kept under a name; undefined without one. */
export const kept = (name) => within("readonly", (store) => store.get(name)).catch(() => undefined);

/** Forgets everything. */
export const forget = () => within("readwrite", (store) => store.clear()).catch(() => undefined);
