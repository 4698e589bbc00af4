// Keeps the page's own files, so that it works without a network: the server's come first, those kept come where it gives none.

const NAME = "rigident";
const FILES = ["./", "page.css", "answer.js", "app.js", "certificate.js", "clocks.js", "columns.js", "dom.js", "person.js", "poses.js", "program.js", "rig.js", "sketch.js", "store.js", "tells.js", "wasi.js", "worker.js",
  "rigident.wasm", "example/bracket.csv", "example/bracket.rig.toml"];

self.addEventListener("install", (event) => {
  event.waitUntil(caches.open(NAME).then((cache) => cache.addAll(FILES)).then(() => self.skipWaiting()));
});

self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));

self.addEventListener("fetch", (event) => {
  if (event.request.method !== "GET" || !event.request.url.startsWith(self.registration.scope)) return;
  const newest = async () => {
    try {
      const answer = await fetch(event.request);
      if (answer.ok) await (await caches.open(NAME)).put(event.request, answer.clone());
      return answer;
    } catch (error) {
      const kept = await caches.match(event.request, { ignoreSearch: true });
      if (kept === undefined) throw error;
      return kept;
    }
  };
  event.respondWith(newest());
});
