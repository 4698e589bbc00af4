// The system that the program runs on in the browser: files in memory, a clock, random numbers, and standard output. This is
// the part of "wasi_snapshot_preview1" that the program imports; there is no network, and no way to one.

const ERRNO = { SUCCESS: 0, BADF: 8, EXIST: 20, INVAL: 28, IO: 29, ISDIR: 31, NOENT: 44, NOSYS: 52, NOTDIR: 54, NOTEMPTY: 55, PIPE: 64 };
const TYPE = { CHARACTER: 2, FOLDER: 3, FILE: 4 };
const OPEN = { CREATE: 1, FOLDER: 2, EXCLUSIVE: 4, TRUNCATE: 8 };
const ROOT = 3;
/** The program's own end: a status, as of a process. */
class Exit extends Error {
  constructor(status) {
    super(`exit ${status}`);
    this.status = status;
  }
}

/** A file in memory that grows as it is written. */
class MemoryFile {
  constructor(bytes = new Uint8Array()) {
    this.bytes = bytes;
    this.size = bytes.length;
  }

  /** Makes room for `size` bytes. */
  reserve(size) {
    if (size <= this.bytes.length) return;
    const grown = new Uint8Array(Math.max(size, 2 * this.bytes.length, 4096));
    grown.set(this.bytes.subarray(0, this.size));
    this.bytes = grown;
  }

  write(at, from) {
    this.reserve(at + from.length);
    this.bytes.set(from, at);
    this.size = Math.max(this.size, at + from.length);
  }

  read(at, into) {
    const found = this.bytes.subarray(Math.min(at, this.size), Math.min(at + into.length, this.size));
    into.set(found);
    return found.length;
  }

  /** Its bytes. */
  content() {
    return this.bytes.subarray(0, this.size);
  }
}

/** Folders and files by their paths, which begin without a slash. */
export class Files {
  constructor() {
    this.files = new Map();
    this.folders = new Set([""]);
  }

  /** Puts a file, and the folders that it is in. */
  put(path, bytes) {
    const parts = path.split("/");
    for (let n = 1; n < parts.length; n++) this.folders.add(parts.slice(0, n).join("/"));
    this.files.set(path, new MemoryFile(bytes));
  }

  /** The names in a folder. */
  names(folder) {
    const start = folder === "" ? "" : `${folder}/`;
    const all = [...this.files.keys(), ...this.folders].filter((path) => path !== "" && path.startsWith(start));
    return [...new Set(all.map((path) => path.slice(start.length).split("/")[0]))].filter((name) => name !== "");
  }
}

/** A path without "." and ".."; undefined if it leads out. */
function clean(path) {
  const parts = [];
  for (const part of path.split("/")) {
    if (part === "..") {
      if (parts.pop() === undefined) return undefined;
    } else if (part !== "" && part !== ".") parts.push(part);
  }
  return parts.join("/");
}

/**
 * Runs a compiled program to its end.
 *
 * `words` are its command line without its name, `files` what it finds, and where it writes; `heard` is called with each text that
 * it writes on standard error. Returns its status, and its standard output. Its breaking off (the program's own
 * fault) is thrown.
 */
export async function run(module, words, files, heard) {
  const system = new System(["rigident", ...words], files, heard);
  const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: system.calls() });
  system.memory = instance.exports.memory;
  let status = 0;
  try {
    instance.exports._start();
  } catch (error) {
    if (!(error instanceof Exit)) throw error;
    status = error.status;
  }
  return { status, output: system.output() };
}

class System {
  constructor(words, files, heard) {
    this.words = words.map((word) => new TextEncoder().encode(`${word}\0`));
    this.files = files;
    this.heard = heard;
    this.written = [];
    this.errors = new TextDecoder();
    this.handles = new Map([[ROOT, { folder: "" }]]);
    this.next = ROOT + 1;
  }

  output() {
    const decoder = new TextDecoder();
    return this.written.map((bytes) => decoder.decode(bytes, { stream: true })).join("") + decoder.decode();
  }

  view() {
    return new DataView(this.memory.buffer);
  }

  bytes(at, length) {
    return new Uint8Array(this.memory.buffer, at, length);
  }

  text(at, length) {
    return new TextDecoder().decode(this.bytes(at, length));
  }

  /** The pieces of memory that a list at `at` names. */
  pieces(at, count) {
    const view = this.view();
    return Array.from({ length: count }, (_, n) => {
      const place = at + 8 * n;
      return this.bytes(view.getUint32(place, true), view.getUint32(place + 4, true));
    });
  }

  /** The path that a call names, relative to an open folder. */
  path(handle, at, length) {
    const folder = this.handles.get(handle)?.folder;
    if (folder === undefined) return undefined;
    return clean(`${folder}/${this.text(at, length)}`);
  }

  /** Writes pieces to a handle, `at` a place or where it is. */
  write(handle, pieces, count, done, at) {
    const list = this.pieces(pieces, count);
    const total = list.reduce((sum, piece) => sum + piece.length, 0);
    this.view().setUint32(done, total, true);
    if (handle === 1) {
      this.written.push(...list.map((piece) => piece.slice()));
      return ERRNO.SUCCESS;
    }
    if (handle === 2) {
      const text = list.map((piece) => this.errors.decode(piece, { stream: true })).join("");
      if (text !== "") this.heard(text);
      return ERRNO.SUCCESS;
    }
    const open = this.handles.get(handle);
    if (open?.file === undefined) return ERRNO.BADF;
    let place = at ?? (open.appends ? open.file.size : open.at);
    for (const piece of list) {
      open.file.write(place, piece);
      place += piece.length;
    }
    if (at === undefined) open.at = place;
    return ERRNO.SUCCESS;
  }

  read(handle, pieces, count, done, at) {
    const open = this.handles.get(handle);
    if (handle !== 0 && open?.file === undefined) return ERRNO.BADF;
    let total = 0;
    // Nobody types: standard input is at its end.
    for (const piece of handle === 0 ? [] : this.pieces(pieces, count)) {
      const found = open.file.read((at ?? open.at) + total, piece);
      total += found;
      if (found < piece.length) break;
    }
    if (handle !== 0 && at === undefined) open.at += total;
    this.view().setUint32(done, total, true);
    return ERRNO.SUCCESS;
  }

  stat(at, type, size) {
    const view = this.view();
    for (let n = 0; n < 8; n++) view.setBigUint64(at + 8 * n, 0n, true);
    view.setUint8(at + 16, type);
    view.setBigUint64(at + 24, 1n, true);
    view.setBigUint64(at + 32, BigInt(size), true);
    return ERRNO.SUCCESS;
  }

  open(folder, path, flags, statusFlags, to) {
    const view = this.view();
    const give = (open) => {
      this.handles.set(this.next, open);
      view.setUint32(to, this.next++, true);
      return ERRNO.SUCCESS;
    };
    if (path === undefined) return ERRNO.NOENT;
    if (this.files.folders.has(path)) {
      return flags & OPEN.CREATE ? ERRNO.ISDIR : give({ folder: path });
    }
    let file = this.files.files.get(path);
    if (file !== undefined && flags & OPEN.CREATE && flags & OPEN.EXCLUSIVE) return ERRNO.EXIST;
    if (file !== undefined && flags & OPEN.FOLDER) return ERRNO.NOTDIR;
    if (file === undefined) {
      const parent = path.includes("/") ? path.slice(0, path.lastIndexOf("/")) : "";
      if (!(flags & OPEN.CREATE) || !this.files.folders.has(parent)) return ERRNO.NOENT;
      file = new MemoryFile();
      this.files.files.set(path, file);
    } else if (flags & OPEN.TRUNCATE) {
      file.size = 0;
    }
    return give({ file, at: 0, appends: (statusFlags & 1) !== 0 });
  }

  calls() {
    const all = {
      args_sizes_get: (count, size) => {
        this.view().setUint32(count, this.words.length, true);
        this.view().setUint32(size, this.words.reduce((sum, word) => sum + word.length, 0), true);
        return ERRNO.SUCCESS;
      },
      args_get: (list, place) => {
        for (const [n, word] of this.words.entries()) {
          this.view().setUint32(list + 4 * n, place, true);
          this.bytes(place, word.length).set(word);
          place += word.length;
        }
        return ERRNO.SUCCESS;
      },
      environ_sizes_get: (count, size) => {
        this.view().setUint32(count, 0, true);
        this.view().setUint32(size, 0, true);
        return ERRNO.SUCCESS;
      },
      environ_get: () => ERRNO.SUCCESS,
      clock_res_get: (_, to) => {
        this.view().setBigUint64(to, 1000n, true);
        return ERRNO.SUCCESS;
      },
      clock_time_get: (id, _, to) => {
        const milliseconds = id === 0 ? Date.now() : performance.now();
        this.view().setBigUint64(to, BigInt(Math.round(milliseconds * 1e6)), true);
        return ERRNO.SUCCESS;
      },
      random_get: (at, length) => {
        for (let done = 0; done < length; done += 65536) {
          crypto.getRandomValues(this.bytes(at + done, Math.min(65536, length - done)));
        }
        return ERRNO.SUCCESS;
      },
      sched_yield: () => ERRNO.SUCCESS,
      poll_oneoff: (_, __, ___, count) => {
        this.view().setUint32(count, 0, true);
        return ERRNO.SUCCESS;
      },
      proc_exit: (status) => {
        throw new Exit(status);
      },
      fd_prestat_get: (handle, to) => {
        if (handle !== ROOT) return ERRNO.BADF;
        this.view().setUint32(to, 0, true);
        this.view().setUint32(to + 4, 1, true);
        return ERRNO.SUCCESS;
      },
      fd_prestat_dir_name: (handle, at) => {
        if (handle !== ROOT) return ERRNO.BADF;
        this.bytes(at, 1)[0] = 0x2f;
        return ERRNO.SUCCESS;
      },
      fd_fdstat_get: (handle, to) => {
        const open = this.handles.get(handle);
        if (handle > 2 && open === undefined) return ERRNO.BADF;
        const view = this.view();
        view.setBigUint64(to, 0n, true);
        view.setUint8(to, handle <= 2 ? TYPE.CHARACTER : open.file ? TYPE.FILE : TYPE.FOLDER);
        view.setUint16(to + 2, open?.appends ? 1 : 0, true);
        view.setBigUint64(to + 8, 0xffffffffn, true);
        view.setBigUint64(to + 16, 0xffffffffn, true);
        return ERRNO.SUCCESS;
      },
      fd_fdstat_set_flags: () => ERRNO.SUCCESS,
      fd_close: (handle) => (this.handles.delete(handle) ? ERRNO.SUCCESS : ERRNO.BADF),
      fd_sync: () => ERRNO.SUCCESS,
      fd_datasync: () => ERRNO.SUCCESS,
      fd_advise: () => ERRNO.SUCCESS,
      fd_filestat_get: (handle, to) => {
        const open = this.handles.get(handle);
        if (handle <= 2) return this.stat(to, TYPE.CHARACTER, 0);
        if (open === undefined) return ERRNO.BADF;
        return open.file ? this.stat(to, TYPE.FILE, open.file.size) : this.stat(to, TYPE.FOLDER, 0);
      },
      fd_filestat_set_size: (handle, size) => {
        const file = this.handles.get(handle)?.file;
        if (file === undefined) return ERRNO.BADF;
        file.reserve(Number(size));
        if (Number(size) > file.size) file.bytes.fill(0, file.size, Number(size));
        file.size = Number(size);
        return ERRNO.SUCCESS;
      },
      fd_filestat_set_times: () => ERRNO.SUCCESS,
      fd_seek: (handle, offset, whence, to) => {
        const open = this.handles.get(handle);
        if (open?.file === undefined) return ERRNO.BADF;
        const place = [0, open.at, open.file.size][whence] + Number(offset);
        if (!(place >= 0)) return ERRNO.INVAL;
        open.at = place;
        this.view().setBigUint64(to, BigInt(place), true);
        return ERRNO.SUCCESS;
      },
      fd_tell: (handle, to) => {
        const open = this.handles.get(handle);
        if (open?.file === undefined) return ERRNO.BADF;
        this.view().setBigUint64(to, BigInt(open.at), true);
        return ERRNO.SUCCESS;
      },
      fd_write: (handle, pieces, count, done) => this.write(handle, pieces, count, done),
      fd_pwrite: (handle, pieces, count, at, done) => this.write(handle, pieces, count, done, Number(at)),
      fd_read: (handle, pieces, count, done) => this.read(handle, pieces, count, done),
      fd_pread: (handle, pieces, count, at, done) => this.read(handle, pieces, count, done, Number(at)),
      fd_readdir: (handle, at, length, cookie, used) => {
        const folder = this.handles.get(handle)?.folder;
        if (folder === undefined) return ERRNO.BADF;
        const start = folder === "" ? "" : `${folder}/`;
        let place = 0;
        for (const [n, name] of this.files.names(folder).entries()) {
          if (n < Number(cookie)) continue;
          const encoded = new TextEncoder().encode(name);
          const entry = new Uint8Array(24 + encoded.length);
          const view = new DataView(entry.buffer);
          view.setBigUint64(0, BigInt(n + 1), true);
          view.setBigUint64(8, BigInt(n + 1), true);
          view.setUint32(16, encoded.length, true);
          view.setUint8(20, this.files.folders.has(start + name) ? TYPE.FOLDER : TYPE.FILE);
          entry.set(encoded, 24);
          const fits = entry.subarray(0, Math.min(entry.length, length - place));
          this.bytes(at + place, fits.length).set(fits);
          place += fits.length;
          if (place === length) break;
        }
        this.view().setUint32(used, place, true);
        return ERRNO.SUCCESS;
      },
      path_open: (handle, _, at, length, flags, __, ___, statusFlags, to) =>
        this.open(handle, this.path(handle, at, length), flags, statusFlags, to),
      path_filestat_get: (handle, _, at, length, to) => {
        const path = this.path(handle, at, length);
        if (path === undefined) return ERRNO.NOENT;
        if (this.files.folders.has(path)) return this.stat(to, TYPE.FOLDER, 0);
        const file = this.files.files.get(path);
        return file ? this.stat(to, TYPE.FILE, file.size) : ERRNO.NOENT;
      },
      path_filestat_set_times: () => ERRNO.SUCCESS,
      path_readlink: () => ERRNO.INVAL,
      path_symlink: () => ERRNO.NOSYS,
      path_create_directory: (handle, at, length) => {
        const path = this.path(handle, at, length);
        if (path === undefined) return ERRNO.NOENT;
        if (this.files.folders.has(path) || this.files.files.has(path)) return ERRNO.EXIST;
        const parent = path.includes("/") ? path.slice(0, path.lastIndexOf("/")) : "";
        if (!this.files.folders.has(parent)) return ERRNO.NOENT;
        this.files.folders.add(path);
        return ERRNO.SUCCESS;
      },
      path_remove_directory: (handle, at, length) => {
        const path = this.path(handle, at, length);
        if (!this.files.folders.has(path)) return ERRNO.NOENT;
        if (this.files.names(path).length > 0) return ERRNO.NOTEMPTY;
        this.files.folders.delete(path);
        return ERRNO.SUCCESS;
      },
      path_unlink_file: (handle, at, length) =>
        this.files.files.delete(this.path(handle, at, length)) ? ERRNO.SUCCESS : ERRNO.NOENT,
      path_link: (from, _, at, length, to, newAt, newLength) => {
        const file = this.files.files.get(this.path(from, at, length));
        const path = this.path(to, newAt, newLength);
        if (file === undefined || path === undefined) return ERRNO.NOENT;
        if (this.files.files.has(path) || this.files.folders.has(path)) return ERRNO.EXIST;
        this.files.files.set(path, file);
        return ERRNO.SUCCESS;
      },
      path_rename: (from, at, length, to, newAt, newLength) => {
        const old = this.path(from, at, length);
        const file = this.files.files.get(old);
        const path = this.path(to, newAt, newLength);
        if (file === undefined || path === undefined) return ERRNO.NOENT;
        this.files.files.delete(old);
        this.files.files.set(path, file);
        return ERRNO.SUCCESS;
      },
    };
    // A call that the program imports and never makes here, such as one of a socket.
    return new Proxy(all, {
      get: (calls, name) => calls[name] ?? (() => ERRNO.NOSYS),
      has: () => true,
    });
  }
}
