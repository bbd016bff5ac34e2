"use strict";
// Pages of runs beside each other on one clock, once all of them are there.
window.addEventListener("load", () => {
  const apps = [...document.querySelectorAll("iframe")].map((frame) => frame.contentWindow.App);
  const lasts_s = Math.max(...apps.map((app) => app.lasts_s));
  // The first keeps the time, and joins last: by then the others listen.
  for (const app of [...apps].reverse()) {
    app.join(apps.filter((other) => other !== app), app === apps[0], lasts_s);
  }
  // Keys are the first one's from the start, and where none of the pages has the focus.
  const first = document.querySelector("iframe").contentWindow;
  first.focus();
  document.addEventListener("keydown", (event) => {
    const same = new first.KeyboardEvent("keydown", { key: event.key, shiftKey: event.shiftKey,
      ctrlKey: event.ctrlKey, altKey: event.altKey, metaKey: event.metaKey, bubbles: true,
      cancelable: true });
    if (!first.document.body.dispatchEvent(same)) event.preventDefault();
  });
});
