"use strict";
// What each line and symbol means, drawn as the display draws it.
const Legend = (() => {
  const list = document.getElementById("legend-list");
  const WIDE = 44, HIGH = 26;

  const traffic = (level, course) => (c) => Symbols.traffic(c, WIDE / 2, HIGH / 2, level, course,
    level ? 9 : 8);
  const band = (region) => (c) => {
    const [colour, width, dash] = Rose.painted(region);
    across(c, Symbols.colours[colour], width, dash);
  };
  function across(c, colour, width, dash) {
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.setLineDash(dash);
    c.beginPath();
    c.moveTo(3, HIGH / 2);
    c.lineTo(WIDE - 3, HIGH / 2);
    c.stroke();
    c.setLineDash([]);
  }
  function area(c) {
    c.fillStyle = c.strokeStyle = Symbols.colours["symbol-caution"];
    c.globalAlpha = 0.2;
    c.fillRect(3, 3, WIDE - 6, HIGH - 6);
    c.globalAlpha = 1;
    c.beginPath();
    c.rect(3, 3, WIDE - 6, HIGH - 6);
    c.clip();
    Rose.hatch(c, 0, 0, WIDE, HIGH);
  }
  const ROWS = [
    [(c) => Symbols.own(c, WIDE / 2, HIGH / 2, 9), "the ownship"],
    [traffic(0, 0.6), "traffic that flies as the arrowhead points"],
    [traffic(0, null), "traffic whose direction of flight is not known"],
    [traffic(1, 0.6), "preventive alert (caution)"],
    [traffic(2, 0.6), "corrective alert (caution)"],
    [traffic(3, 0.6), "warning alert"],
    [(c) => across(c, Symbols.colours.traffic, 1.5, []), "line from the ownship: a contact without a range"],
    [area, "loss area: separation is lost there, if the ownship turns there at once"],
    [band("FAR"), "guidance, far: a direction, altitude or speed that loses separation"],
    [band("MID"), "guidance, mid: sooner"],
    [band("NEAR"), "guidance, near: soonest"],
    [band("RECOVERY"), "guidance, recovery: what leads out again"],
    [(c) => Symbols.bug(c, WIDE / 2, HIGH / 2), "heading or altitude that was commanded"],
  ];
  const HEIGHTS = { nautical: "hundreds of feet", metric: "metres" };

  function row(paint, words) {
    const made = document.createElement("li"), canvas = document.createElement("canvas");
    const ratio = window.devicePixelRatio || 1;
    canvas.width = WIDE * ratio;
    canvas.height = HIGH * ratio;
    canvas.setAttribute("aria-hidden", "true");
    const c = canvas.getContext("2d");
    c.scale(ratio, ratio);
    paint(c);
    made.append(canvas, words);
    return made;
  }
  function draw(sensors) {
    const reaches = sensors.filter((s) => s.range && s.azimuth).map((s) => [
      (c) => across(c, Symbols.colours[s.kind], 2, Rose.DASHES[s.kind]),
      `${s.name}: beyond it this ${s.kind === "radar" ? "radar" : "camera"} sees nothing`]);
    const tag = [(c) => Canvas.text(c, Units.above(-90), WIDE / 2, HIGH / 2 + 4,
      Symbols.colours.traffic, "center"), `altitude from the ownship's, in ${HEIGHTS[Units.name]}; an ` +
      "arrow from 500 ft/min (2.5 m/s) on"];
    list.replaceChildren(...[...ROWS, tag, ...reaches].map((one) => row(...one)));
  }
  return { draw };
})();
