"use strict";
// One system of units at a time, of the reader's choice; frames come in m and m/s.
const Units = (() => {
  const FOOT = 0.3048, MILE = 1852, KNOT = 1852 / 3600;
  const RANGES = [0.25, 0.5, 1, 2, 3, 4, 5, 6, 8, 10, 20, 40];
  const SYSTEMS = {
    nautical: {
      words: "nmi, ft, kt", distance: ["nmi", MILE], height: ["ft", FOOT], speed: ["kt", KNOT],
      rate: ["ft/min", FOOT / 60], rateStep: 10, ranges: RANGES, climbs: [500, 1000, 1500],
      // A tape's half, its marks and those that have a number.
      heights: [1000, 100, 500], speeds: [50, 10, 20],
    },
    metric: {
      words: "km, m, m/s", distance: ["km", 1000], height: ["m", 1], speed: ["m/s", 1],
      rate: ["m/s", 1], rateStep: 0.1, ranges: [0.5, 1, 2, 4, 6, 8, 10, 15, 20, 40, 80],
      climbs: [150, 300, 450], heights: [300, 50, 100], speeds: [25, 5, 10],
    },
  };
  let name = "nautical";

  const now = () => SYSTEMS[name];
  function choose(wanted) { if (SYSTEMS[wanted]) name = wanted; }
  function other() { return name === "nautical" ? "metric" : "nautical"; }
  function of(kind, value) { return value / now()[kind][1]; }
  function unit(kind) { return now()[kind][0]; }
  function metres(kind, value) { return value * now()[kind][1]; }
  function distance(m, digits) { return `${of("distance", m).toFixed(digits)} ${unit("distance")}`; }
  function range(m) { return `${+of("distance", m).toFixed(2)} ${unit("distance")}`; }
  function height(m) { return `${Math.round(of("height", m))} ${unit("height")}`; }
  // A vertical speed, signed; one that rounds to nothing has no sign.
  function rate(mps) {
    const step = now().rateStep, steps = Math.round(of("rate", mps) / step);
    const sign = steps > 0 ? "+" : steps < 0 ? "−" : "";
    return `${sign}${(Math.abs(steps) * step).toFixed(step < 1 ? 1 : 0)}`;
  }
  // How far above the ownship: in hundreds of feet, or in metres to the next ten.
  function above(m) {
    if (m === null) return "";
    const feet = name === "nautical";
    const value = Math.round(m / (feet ? 100 * FOOT : 10)) * (feet ? 1 : 10);
    const size = String(Math.abs(value)).padStart(2, "0");
    return `${value < 0 ? "−" : "+"}${size}${feet ? "" : " m"}`;
  }
  // The three digits of a heading or track; north is 360.
  function heading(degrees) {
    return `${String(((Math.round(degrees) + 359) % 360) + 1).padStart(3, "0")}°`;
  }
  return { choose, other, of, unit, metres, distance, range, height, rate, above, heading,
    get name() { return name; }, get system() { return now(); } };
})();
