"use strict";
// What each sensor saw of each target so far, and the alerts that are on.
const Seen = (() => {
  const box = document.getElementById("seen"), words = document.getElementById("alerts");
  const MOST = 60;
  const cells = [];

  function cell(row, kind, text, scope) {
    const made = document.createElement(kind);
    made.textContent = text;
    if (scope) made.scope = scope;
    row.appendChild(made);
    return made;
  }
  function build() {
    const table = document.createElement("table");
    const head = table.createTHead().insertRow();
    cell(head, "th", "target", "col");
    for (const sensor of Data.sensors) cell(head, "th", sensor.name, "col");
    const body = table.createTBody();
    Data.targets.slice(0, MOST).forEach((name, target) => {
      const row = body.insertRow();
      cell(row, "th", name, "row");
      Data.sensors.forEach((sensor, number) => {
        cells.push({ made: cell(row, "td", ""), look: Data.looks[number].get(target), shown: null });
      });
    });
    box.appendChild(table);
    if (Data.targets.length > MOST) {
      const more = document.createElement("p");
      more.textContent = `and ${Data.targets.length - MOST} more`;
      box.appendChild(more);
    }
  }
  function update(t, drawn) {
    for (const one of cells) {
      const count = one.look ? Data.after(one.look.times, t) : 0;
      if (count === one.shown) continue;
      one.shown = count;
      const range = count && Number.isFinite(one.look.range)
        ? `, ${(one.look.range / 1000).toFixed(1)} km` : "";
      one.made.textContent = count ? `${count}` : "–";
      one.made.title = count
        ? `first at ${(one.look.times[0] + Data.start_s).toFixed(2)} s${range}` : "not yet";
    }
    const lines = drawn.alerts.map((a) => `${a.target}: level ${a.level}`);
    const text = lines.length ? lines.join(", ") : "none";
    if (words.textContent !== text) {
      words.textContent = text;
      const highest = Math.max(0, ...drawn.alerts.map((a) => a.level));
      words.className = highest ? `level${Math.min(highest, 3)}` : "";
    }
  }
  build();
  return { update };
})();
