"use strict";
// Draws what live/__init__.py packs into <script type="application/json"> inside a figure. Lazily: when it comes
// into sight. The still picture stays in the page for paper, for saving, and where anything here fails.
const KINDS = { f4: Float32Array, i2: Int16Array, i1: Int8Array, u1: Uint8Array, u4: Uint32Array };

function unpacked(part) {
  const raw = atob(part.data), bytes = new Uint8Array(raw.length);
  for (let n = 0; n < raw.length; n++) bytes[n] = raw.charCodeAt(n);
  return new KINDS[part.kind](bytes.buffer);
}

function values(part) {
  return Array.from(unpacked(part), v => (Number.isFinite(v) ? v : null));
}

function digits(v) {
  if (v == null) return "–";
  return (v !== 0 && (Math.abs(v) < 1e-3 || Math.abs(v) >= 1e6) ? v.toExponential(3) : String(+v.toPrecision(4))).replace("-", "−");
}

function make(tag, parent, text) {
  const element = document.createElement(tag);
  if (text) element.textContent = text;
  if (parent) parent.appendChild(element);
  return element;
}

function onResize(box, act) { // after the frame: sizes set inside the observer's own round would be reported as an error
  let width = box.clientWidth;
  new ResizeObserver(() => {
    if (box.clientWidth === width) return;
    width = box.clientWidth;
    requestAnimationFrame(act);
  }).observe(box);
}

// The curve nearest to the pointer, named with its values: for charts of many curves.
function nearest(u, readout, given) {
  const { idx, top } = u.cursor;
  if (idx == null || top < 0) return;
  let best = null, least = Infinity;
  for (let k = 1; k < u.data.length; k++) {
    const v = u.data[k][idx];
    if (v == null) continue;
    const off = Math.abs(u.valToPos(v, "y") - top);
    if (off < least) { least = off; best = k; }
  }
  if (best) readout.textContent = `${u.series[best].label}: ${digits(u.data[best][idx])} at ${digits(u.data[0][idx])} (${given.labels.join(", ")})`;
}

// 1, 2 and 5 of each decade: uPlot counts on from the least value, 13.14, 23.14 to 103.14.
function round(_, __, low, high) {
  const ticks = [];
  for (let p = Math.floor(Math.log10(low)); p <= Math.log10(high); p++) {
    for (const m of [1, 2, 5]) if (m * 10 ** p >= low && m * 10 ** p <= high) ticks.push(m * 10 ** p);
  }
  return ticks;
}

function drawChart(given, box, key) {
  const readout = given.legend ? null : make("p", null);
  const series = given.series.map(s => ({
    label: s.name, stroke: s.colour, width: 1.2, spanGaps: false, points: { show: false },
    dash: s.dashed ? [6, 4] : undefined, value: (_, v) => digits(v),
  }));
  const axis = label => ({ label, labelSize: 18, font: "11px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", stroke: "#52606d", grid: { stroke: "#e4e7eb", width: 1 }, ticks: { stroke: "#cbd2d9", width: 1 }, values: (_, ticks) => ticks.map(v => (v == null ? "" : digits(v))) });
  const plot = new uPlot({
    width: box.clientWidth, height: given.height,
    scales: { x: { time: false, distr: given.log ? 3 : 1, range: given.log ? (_, low, high) => [low, high] : undefined } },
    axes: [{ ...axis(given.labels[0]), size: 34, ...(given.log ? { splits: round, filter: (_, ticks) => ticks } : {}) }, { ...axis(given.labels[1]), size: 52, space: 16 }],
    series: [{ label: given.labels[0], value: (_, v) => digits(v) }, ...series],
    legend: { show: given.legend }, cursor: { sync: { key }, drag: { x: true, y: false } },
    hooks: readout ? { setCursor: [u => nearest(u, readout, given)] } : {},
  }, [values(given.x), ...given.series.map(s => values(s.y))], box);
  if (readout) { readout.className = "readout"; readout.textContent = "Point at a curve to read it."; box.appendChild(readout); }
  onResize(box, () => { if (box.clientWidth) plot.setSize({ width: box.clientWidth, height: given.height }); });
}

function drawCharts(given, box, key) {
  given.charts.forEach(one => drawChart(one, make("div", box), key));
  make("p", box, "Drag across to zoom, double-click for all; click a name to hide its curve.").className = "readout";
}

// Bars of several series side by side over named places, with their errors; uPlot keeps axes, pointer and zoom.
function drawBars(given, box, key) {
  box = make("div", box);
  const wide = 0.84 / given.series.length, count = given.names.length;
  const errors = given.series.map(s => (s.error ? values(s.error) : []));
  const [lows, highs] = given.chance ? given.chance.map(values) : [[], []];
  const at = (u, v, scale) => u.valToPos(v, scale, true);
  const paint = u => {
    const ink = u.ctx, { left, top, width, height } = u.bbox;
    ink.save();
    ink.beginPath(); ink.rect(left, top, width, height); ink.clip();
    given.series.forEach((s, k) => u.series[k + 1].show && u.data[k + 1].forEach((v, n) => {
      if (v == null) return;
      const from = at(u, n + wide * (k - given.series.length / 2) + 0.01, "x");
      const to = at(u, n + wide * (k + 1 - given.series.length / 2) - 0.01, "x"), y = at(u, v, "y");
      ink.globalAlpha = given.few[n] ? 0.45 : 1;
      ink.fillStyle = s.colour;
      ink.fillRect(from, y, to - from, top + height - y);
      ink.globalAlpha = 1;
      const error = errors[k][n], middle = (from + to) / 2;
      if (lows[n] != null && highs[n] != null) { // a box: what the road's chance leaves open
        const upper = at(u, v + highs[n], "y"), half = 0.3 * (to - from);
        ink.strokeStyle = "#52606d"; ink.lineWidth = 0.8 * devicePixelRatio;
        ink.strokeRect(middle - half, upper, 2 * half, at(u, v + lows[n], "y") - upper);
      }
      if (error == null) return;
      ink.strokeStyle = "#1f2933"; ink.lineWidth = devicePixelRatio;
      ink.beginPath(); ink.moveTo(middle, at(u, v - error, "y")); ink.lineTo(middle, at(u, v + error, "y")); ink.stroke();
    }));
    ink.restore();
  };
  const axis = label => ({ label, labelSize: 18, font: "11px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", stroke: "#52606d", grid: { stroke: "#e4e7eb", width: 1 }, ticks: { stroke: "#cbd2d9", width: 1 } });
  const some = u => { // as many names as have room
    const each = Math.max(Math.ceil((u.scales.x.max - u.scales.x.min) * 30 / box.clientWidth), 1);
    return given.names.map((_, n) => n).filter(n => n % each === 0);
  };
  const shown = (_, low, high) => { // of one bar alone uPlot makes a range of a hundred
    const first = Math.max(Math.round(low), 0), last = Math.min(Math.round(high), count - 1);
    return [first - 0.6, last + 0.6];
  };
  const tenths = v => (v < 0 ? "−" : "+") + Math.abs(v).toFixed(1);
  const byChance = n => (lows[n] == null || highs[n] == null ? "" : `, by chance ${tenths(lows[n])} to ${tenths(highs[n])}`);
  const told = (k, v, n) => (v == null ? "–" : digits(v) + (errors[k][n] == null ? ", error unknown" : " ± " + digits(errors[k][n])) + byChance(n));
  const plot = new uPlot({
    width: box.clientWidth, height: given.height,
    scales: { x: { time: false, range: shown }, y: { range: (_, low, high) => [given.floor, Math.max(high, given.top)] } },
    axes: [
      { ...axis(given.labels[0]), size: 44, rotate: -45, grid: { show: false }, splits: some, values: (_, places) => places.map(n => given.names[n]) },
      { ...axis(given.labels[1]), size: 52, values: (_, ticks) => ticks.map(v => (v == null ? "" : digits(v))) },
    ],
    series: [{ label: given.labels[0], value: (_, n) => (n == null ? "–" : given.names[n]) },
      ...given.series.map((s, k) => ({ label: s.name, stroke: s.colour, fill: s.colour, paths: () => null, points: { show: false }, value: (_, v, __, n) => told(k, v, n) }))],
    cursor: { sync: { key }, drag: { x: true, y: false } }, hooks: { draw: [paint] },
  }, [given.names.map((_, n) => n), ...given.series.map(s => values(s.y))], box);
  make("p", box, "Point at a band to read it; drag across to zoom, double-click for all; click a name to hide its bars.").className = "readout";
  onResize(box, () => { if (box.clientWidth) plot.setSize({ width: box.clientWidth, height: given.height }); });
}

function saveButtons(figure) {
  const image = figure.querySelector("img"), bar = make("div", figure);
  bar.className = "save";
  const save = (name, href) => { const a = make("a"); a.download = name; a.href = href; a.click(); };
  const stem = "tireroad-" + (figure.id || "figure");
  if (image.src.startsWith("data:image/svg")) make("button", bar, "SVG").onclick = () => save(stem + ".svg", image.src);
  make("button", bar, "PNG").onclick = () => {
    if (image.src.startsWith("data:image/png")) return save(stem + ".png", image.src);
    const canvas = make("canvas"), scale = 2;
    canvas.width = scale * image.naturalWidth; canvas.height = scale * image.naturalHeight;
    const ink = canvas.getContext("2d");
    ink.fillStyle = "#fff"; ink.fillRect(0, 0, canvas.width, canvas.height);
    ink.drawImage(image, 0, 0, canvas.width, canvas.height);
    save(stem + ".png", canvas.toDataURL("image/png"));
  };
  bar.querySelectorAll("button").forEach(b => { b.type = "button"; b.title = "Save this figure"; });
}

function enliven(figure) {
  const source = figure.querySelector('script[type="application/json"]');
  if (!source || figure.dataset.drawn) return;
  const given = JSON.parse(source.textContent), box = make("div");
  box.className = "live";
  figure.insertBefore(box, figure.firstChild);
  figure.classList.add("alive");
  try {
    ({ charts: drawCharts, bars: drawBars, shapes: drawShapes, footprint: drawFootprint })[given.kind](given, box, figure.id);
    figure.dataset.drawn = "yes";
  } catch (error) {
    box.remove(); figure.classList.remove("alive");
    console.error(figure.id, error);
  }
}

addEventListener("beforeprint", () => document.querySelectorAll("details.more").forEach(d => { d.open = true; }));

document.addEventListener("DOMContentLoaded", () => {
  const figures = document.querySelectorAll("figure");
  figures.forEach(saveButtons);
  const seen = new IntersectionObserver(entries => entries.forEach(entry => {
    if (!entry.isIntersecting) return;
    seen.unobserve(entry.target);
    enliven(entry.target);
  }), { rootMargin: "200px" });
  figures.forEach(figure => seen.observe(figure));
});
