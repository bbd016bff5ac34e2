"use strict";
// The socket: what is decided is said until it is answered, also over a lost connection.
const Link = (() => {
  const token = new URLSearchParams(location.search).get("token") || "";
  const waiting = new Map();
  const hears = {};
  let socket = null, over = false, lost = 0;

  // A tab that is loaded again has its key; one that was closed and is opened again asks with the
  // browser's, which counts while no other page decides.
  function key(storage) {
    try { return window[storage].getItem("key") || ""; } catch { return ""; }
  }
  function keep(value) {
    for (const storage of value ? ["sessionStorage", "localStorage"] : []) {
      try { window[storage].setItem("key", value); } catch { /* then a reload only watches */ }
    }
  }
  function open() {
    const query = new URLSearchParams({ token, key: key("sessionStorage"),
      before: key("localStorage") });
    socket = new WebSocket(`ws://${location.host}/socket?${query}`);
    socket.addEventListener("message", (event) => {
      const said = JSON.parse(event.data);
      if (said.type === "welcome") {
        keep(said.key);
        for (const text of waiting.values()) socket.send(text);
      }
      if (said.id && said.type !== "welcome") waiting.delete(said.id);
      if (said.type === "end") over = true;
      if (hears[said.type]) hears[said.type](said);
    });
    socket.addEventListener("close", (event) => {
      if (over) return;
      if (hears.lost) hears.lost(event.code);
      if (event.code === 4001) return;  // another page took its place
      lost += 1;
      setTimeout(open, Math.min(200 * lost, 2000));
    });
    socket.addEventListener("open", () => { lost = 0; });
  }
  function send(content) {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(content));
  }
  function decide(content) {
    const bytes = crypto.getRandomValues(new Uint8Array(8));
    const id = Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");
    const text = JSON.stringify({ type: "decide", id, ...content });
    waiting.set(id, text);
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(text);
    return id;
  }
  return { open, send, decide, hears, waiting };
})();
