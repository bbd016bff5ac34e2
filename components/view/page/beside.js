"use strict";
// Pages of runs beside each other on one clock, once all of them are there.
window.addEventListener("load", () => {
  const apps = [...document.querySelectorAll("iframe")].map((frame) => frame.contentWindow.App);
  const lasts_s = Math.max(...apps.map((app) => app.lasts_s));
  // The first keeps the time, and joins last: by then the others listen.
  for (const app of [...apps].reverse()) {
    app.join(apps.filter((other) => other !== app), app === apps[0], lasts_s);
  }
});
