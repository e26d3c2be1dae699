"use strict";
// The tire to turn, its modes as they swing, and the footprint as it rolls, on plain canvases.
const RAMP = ["#ffffff", "#fdd9a0", "#f59053", "#d4402f", "#7f1d3f", "#2b0a2e"];
const SIDES = ["#2166ac", "#92c5de", "#f7f7f7", "#f4a582", "#b2182b"]; // inwards, at rest, outwards

function colours(stops, count) { // a table of `count` colours [r, g, b] between the stops
  const parts = stops.map(s => [1, 3, 5].map(k => parseInt(s.slice(k, k + 2), 16)));
  return Array.from({ length: count }, (_, n) => {
    const place = n / (count - 1) * (stops.length - 1), low = Math.min(Math.floor(place), stops.length - 2);
    return parts[low].map((v, k) => Math.round(v + (place - low) * (parts[low + 1][k] - v)));
  });
}

function canvasIn(box, ratio, tall = 460) {
  const canvas = make("canvas", box), ink = canvas.getContext("2d");
  const fit = () => {
    const width = box.clientWidth, height = Math.min(width * ratio, tall), scale = window.devicePixelRatio || 1;
    canvas.style.width = width + "px"; canvas.style.height = height + "px";
    canvas.width = width * scale; canvas.height = height * scale;
    ink.setTransform(scale, 0, 0, scale, 0, 0);
    return [width, height];
  };
  return { canvas, ink, fit };
}

function whileSeen(element, frame) { // frame(seconds) while the element is in sight and the page is shown
  let running = false;
  const tick = now => { if (!running) return; frame(now / 1000); requestAnimationFrame(tick); };
  new IntersectionObserver(([entry]) => {
    const was = running;
    running = entry.isIntersecting;
    if (running && !was) requestAnimationFrame(tick);
  }).observe(element);
}

function drawShapes(given, box) {
  const points = unpacked(given.points), quads = unpacked(given.quads), moved = unpacked(given.shapes), across = unpacked(given.across);
  const count = points.length / 3, faces = quads.length / 4, bar = make("div", box);
  bar.className = "bar-of-buttons";
  const { canvas, ink, fit } = canvasIn(box, 0.75);
  canvas.style.touchAction = "pan-y";
  let azimuth = -0.96, elevation = 0.31, mode = 0, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  const buttons = given.titles.map((title, n) => {
    const b = make("button", bar, title); b.type = "button";
    b.onclick = () => { mode = n; buttons.forEach((o, k) => o.setAttribute("aria-pressed", k === n)); };
    return b;
  });
  buttons[0].setAttribute("aria-pressed", true);
  const play = make("button", bar, playing ? "stop" : "play"); play.type = "button";
  play.onclick = () => { playing = !playing; play.textContent = playing ? "stop" : "play"; };
  make("p", box, "Drag to turn. Red: outwards, blue: inwards; exaggerated.").className = "readout";
  canvas.onpointerdown = down => {
    canvas.setPointerCapture(down.pointerId);
    let x = down.clientX, y = down.clientY;
    canvas.onpointermove = e => {
      azimuth -= (e.clientX - x) * 0.01;
      elevation = Math.max(-1.5, Math.min(1.5, elevation + (e.clientY - y) * 0.01));
      x = e.clientX; y = e.clientY;
    };
  };
  canvas.onpointerup = canvas.onpointercancel = () => { canvas.onpointermove = null; };
  const table = colours(SIDES, 64), seen = new Float32Array(points.length), out = new Float32Array(count);
  const depth = new Float32Array(faces), order = Array.from({ length: faces }, (_, n) => n);
  let [width, height] = fit(), swing = 1;
  onResize(box, () => { [width, height] = fit(); });
  whileSeen(canvas, now => {
    if (playing) swing = Math.sin(2.4 * now);
    const ca = Math.cos(azimuth), sa = Math.sin(azimuth), ce = Math.cos(elevation), se = Math.sin(elevation);
    const size = 0.42 * Math.min(width, 1.15 * height) / 32767, big = swing * 0.14 * 32767 / 127;
    for (let n = 0, from = mode * 3 * count; n < count; n++, from += 3) {
      const [dx, dy, dz] = [moved[from], moved[from + 1], moved[from + 2]];
      out[n] = swing * across[mode * count + n] / 127;
      const x = points[3 * n] + big * dx, y = points[3 * n + 1] + big * dy, z = points[3 * n + 2] + big * dz;
      seen[3 * n] = -sa * x + ca * y;
      seen[3 * n + 1] = -se * ca * x - se * sa * y + ce * z;
      seen[3 * n + 2] = ce * ca * x + ce * sa * y + se * z;
    }
    for (let q = 0; q < faces; q++) depth[q] = seen[3 * quads[4 * q] + 2] + seen[3 * quads[4 * q + 2] + 2];
    order.sort((a, b) => depth[a] - depth[b]);
    ink.clearRect(0, 0, width, height);
    const at = k => [width / 2 + size * seen[3 * k], height / 2 - size * seen[3 * k + 1]];
    for (const q of order) {
      const [a, b, c, d] = [0, 1, 2, 3].map(k => quads[4 * q + k]);
      const [p, s, t, w] = [at(a), at(b), at(c), at(d)];
      const mean = (out[a] + out[b] + out[c] + out[d]) / 4, tilt = Math.abs((t[0] - p[0]) * (w[1] - s[1]) - (t[1] - p[1]) * (w[0] - s[0]));
      const span = Math.hypot(t[0] - p[0], t[1] - p[1]) * Math.hypot(w[0] - s[0], w[1] - s[1]) || 1;
      const light = 0.6 + 0.4 * tilt / span;
      const rgb = table[Math.max(0, Math.min(63, Math.round(31.5 * (1 + mean))))];
      ink.fillStyle = ink.strokeStyle = `rgb(${rgb.map(v => Math.round(v * light)).join(",")})`;
      ink.beginPath(); ink.moveTo(...p); ink.lineTo(...s); ink.lineTo(...t); ink.lineTo(...w); ink.closePath();
      ink.fill(); ink.stroke();
    }
  });
}

function drawFootprint(given, box) {
  const points = unpacked(given.points), time = unpacked(given.time), shown = unpacked(given.values);
  const count = points.length / 2, [hx, hy] = given.half, table = colours(RAMP, 256);
  let left = Infinity, right = -Infinity, low = Infinity, high = -Infinity;
  for (let n = 0; n < count; n++) {
    left = Math.min(left, points[2 * n] - 2 * hx); right = Math.max(right, points[2 * n] + 2 * hx);
    low = Math.min(low, points[2 * n + 1] - 2 * hy); high = Math.max(high, points[2 * n + 1] + 2 * hy);
  }
  const { canvas, ink, fit } = canvasIn(box, (high - low) / (right - left), 360);
  const bar = make("div", box), slider = make("input", bar), play = make("button", bar, "play"), told = make("p", box);
  bar.className = "bar-of-buttons"; told.className = "readout"; play.type = "button";
  Object.assign(slider, { type: "range", min: 0, max: time.length - 1, value: given.begin });
  slider.setAttribute("aria-label", "instant");
  let playing = false, at = -1, place = given.begin, last = 0, [width, height] = fit();
  play.onclick = () => { playing = !playing; play.textContent = playing ? "stop" : "play"; };
  slider.oninput = () => { place = +slider.value; };
  onResize(box, () => { [width, height] = fit(); at = -1; });
  whileSeen(canvas, now => {
    if (playing) { place = (place + 25 * Math.min(now - last, 0.1)) % time.length; slider.value = Math.floor(place); }
    last = now;
    const row = Math.floor(place);
    if (row === at) return;
    at = row;
    const scale = Math.min(width / (right - left), height / (high - low)), x0 = (width - scale * (right - left)) / 2;
    ink.clearRect(0, 0, width, height);
    for (let n = 0; n < count; n++) {
      const v = shown[row * count + n];
      ink.fillStyle = v ? `rgb(${table[v].join(",")})` : "#eef1f4";
      ink.fillRect(x0 + scale * (points[2 * n] - hx - left), scale * (high - points[2 * n + 1] - hy), 2 * scale * hx - 0.5, 2 * scale * hy - 0.5);
    }
    told.textContent = `${digits(1e3 * time[row])} ms; ${given.label}, darkest ${digits(given.top)} and more; forward is to the right, ${digits(right - left)} mm shown.`;
  });
}
