"use strict";
// The part of the camera's picture in which a contact was seen, pixel by pixel of the camera.
const Camera = (() => {
  const canvas = document.getElementById("camera");
  const words = document.getElementById("camera-words");
  const small = document.createElement("canvas");
  const SKY = 205, GROUND = 120, COLD = 60;

  function grey(value) {
    const level = Math.round(Math.min(Math.max(value, 0), 255));
    return `rgb(${level},${level},${level})`;
  }
  function extent(picture) {
    let most = 2;
    for (const [x, y] of [...picture.fuselage, ...picture.wing]) {
      most = Math.max(most, Math.abs(x), Math.abs(y));
    }
    return most;
  }
  function fill(c, points, x0, y0) {
    c.beginPath();
    points.forEach(([x, y], i) => c[i ? "lineTo" : "moveTo"](x0 + x, y0 - y));
    c.closePath();
    c.fill();
  }
  // What the camera rendered and searched, as it is, in the middle of its background.
  function show(s, patch, wide, high) {
    const side = patch.length, left = Math.floor((wide - side) / 2);
    s.fillStyle = grey(patch[0][0]);
    s.fillRect(0, 0, wide, high);
    patch.forEach((row, y) => row.forEach((level, x) => {
      s.fillStyle = grey(level);
      s.fillRect(left + x, y, 1, 1);
    }));
  }
  function draw(picture, scene) {
    const width = Math.max(canvas.clientWidth, 1), height = Math.max(canvas.clientHeight, 1);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const c = canvas.getContext("2d");
    c.clearRect(0, 0, width, height);
    if (!picture) {
      say("no picture");
      return null;
    }
    // So many of the camera's pixels as make the target a third of what is shown.
    const high = picture.patch ? picture.patch.length :
      Math.min(Math.max(Math.ceil(6 * extent(picture)), 16), 160);
    const wide = Math.ceil((high * width) / height);
    small.width = wide;
    small.height = high;
    const s = small.getContext("2d");
    if (picture.patch) show(s, picture.patch, wide, high);
    else outline(s, picture, wide, high);
    c.imageSmoothingEnabled = false;
    c.drawImage(small, 0, 0, width, height);
    say(`${scene.name(picture.target)} by ${picture.sensor}, ${picture.age.toFixed(1)} s ago: ` +
      `${picture.pixels} pixels, ${contrast(picture)}against the ${picture.background}`);
    return { target: picture.target, pixels: picture.pixels, wide, high };
  }
  function contrast(picture) {
    return picture.contrast === null ? "" : `contrast ${picture.contrast}, `;
  }
  function outline(s, picture, wide, high) {
    const below = picture.background === "ground";
    const around = picture.infrared ? COLD : below ? GROUND : SKY;
    s.fillStyle = grey(picture.infrared ? COLD : SKY);
    s.fillRect(0, 0, wide, high);
    // The ground below the horizon, which stands askew on the picture of a camera that banks.
    s.save();
    s.translate(wide / 2, high / 2);
    s.rotate((picture.tilt * Math.PI) / 180);
    s.fillStyle = grey(picture.infrared ? COLD + 25 : GROUND);
    const far = wide + high;
    s.fillRect(-far, Math.max(-picture.horizon, -far), 2 * far, 2 * far);
    s.restore();
    const change = Math.min(Math.max(picture.contrast, 0), 1);
    s.fillStyle = grey(picture.infrared ? around + change * (255 - around) : around * (1 - change));
    fill(s, picture.wing, wide / 2, high / 2);
    fill(s, picture.fuselage, wide / 2, high / 2);
  }
  function say(text) {
    if (words.textContent !== text) words.textContent = text;
  }
  return { draw };
})();
