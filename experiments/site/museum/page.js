"use strict";
/* Pictures in SVG, sliders, and the words that say what they show. */

const raised = (power) => [...power].map((x) => ({ "-": "\u207b" })[x] || "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[x]).join("");
const show = (x, digits = 4) =>
  x === null || x === undefined ? "none"
  : x === Infinity ? "infinite"
  : String(Number(x.toPrecision(digits))).replace(/^-/, "\u2212").replace(/e\+?(.*)$/, (_, power) => `\u00b710${raised(power)}`);

function ticks([low, high], count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((x) => x * power >= raw) * power;
  const first = Math.ceil(low / step - 1e-9);
  return range(Math.floor(high / step + 1e-9) - first + 1).map((i) => Number(((first + i) * step).toPrecision(6)));
}

/* Limits that hold all numbers, with some room. */
function limits(numbers, room = 0.08) {
  const fine = numbers.filter(Number.isFinite);
  const low = Math.min(...fine), high = Math.max(...fine), gap = (high - low || 1) * room;
  return [low - gap, high + gap];
}

/* The size of a plot: letters are never scaled, so that they can be read on a phone. */
function plotSize(count) {
  const narrow = window.innerWidth < 900, whole = Math.min(window.innerWidth, 1280) - (narrow ? 22 : 400);
  const W = Math.floor(count > 1 ? (whole - (narrow ? 5 : 13)) / 2 : Math.min(whole, 620));
  return { W, H: Math.round(narrow ? (count > 1 ? 190 : 210) : Math.min(W * 0.8, 380)) };
}

/* One plot. marks: {line: points} {area: points} {dot: point} {arrow: [from, to]} {text, at}, each
   with a `kind` that the style sheet colours. */
function plot({ x, y, xlabel, ylabel, alt }, marks) {
  const { W, H } = plot.size, many = (from, length) => Math.max(2, Math.min(5, Math.floor(length / from)));
  const across = ticks(x, many(55, W - 60)), upward = ticks(y, many(32, H - 54));
  const left = 9 + 7 * Math.max(...upward.map((v) => show(v).length)), right = 12, top = 26, bottom = 40;
  const px = (v) => left + ((v - x[0]) / (x[1] - x[0])) * (W - left - right);
  const py = (v) => H - bottom - ((v - y[0]) / (y[1] - y[0])) * (H - top - bottom);
  const at = ([a, b]) => `${px(a).toFixed(1)},${py(b).toFixed(1)}`;
  const path = (points) => points.filter((p) => p.every(Number.isFinite)).map(at).join(" ");
  const axis = [
    ...across.map((v) => `<line class="grid" x1="${px(v)}" x2="${px(v)}" y1="${top}" y2="${H - bottom}"/>` +
      `<text x="${px(v)}" y="${H - bottom + 15}" text-anchor="middle">${show(v)}</text>`),
    ...upward.map((v) => `<line class="grid" x1="${left}" x2="${W - right}" y1="${py(v)}" y2="${py(v)}"/>` +
      `<text x="${left - 5}" y="${py(v) + 4}" text-anchor="end">${show(v)}</text>`),
  ];
  const drawn = marks.map((m) => {
    const kind = m.kind || "one";
    if (m.line) return `<polyline class="line ${kind}" points="${path(m.line)}"/>`;
    if (m.area) return `<polygon class="area ${kind}" points="${path(m.area)}"/>`;
    if (m.dot) return `<circle class="dot ${kind}" cx="${px(m.dot[0])}" cy="${py(m.dot[1])}" r="5"/>`;
    if (m.text) return `<text class="${kind}" x="${px(m.at[0])}" y="${py(m.at[1])}">${m.text}</text>`;
    const [a, b] = m.arrow;
    return `<line class="line ${kind}" x1="${px(a[0])}" y1="${py(a[1])}" x2="${px(b[0])}" y2="${py(b[1])}" marker-end="url(#tip)"/>`;
  });
  const clip = `clip${plot.number = (plot.number || 0) + 1}`;
  return `<svg width="${W}" viewBox="0 0 ${W} ${H}" role="img" aria-label="${alt}"><defs>` +
    `<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" markerHeight="6" orient="auto"><path d="M0 0L8 4L0 8z"/></marker>` +
    `<clipPath id="${clip}"><rect x="${left}" y="${top}" width="${W - left - right}" height="${H - top - bottom}"/></clipPath></defs>` +
    `${axis.join("")}<g clip-path="url(#${clip})">${drawn.join("")}</g>` +
    `<rect class="frame" x="${left}" y="${top}" width="${W - left - right}" height="${H - top - bottom}"/>` +
    `<text x="${W - 2}" y="${H - 7}" text-anchor="end">${xlabel}</text><text x="2" y="14">${ylabel}</text></svg>`;
}

/* What a room shows, with plots of a size that fits their number. */
function shown(room, values, answers) {
  plot.size = plotSize(plot.count || 2);
  const seen = room.show(values, answers);
  if (seen.figures.length === plot.count) return seen;
  plot.count = seen.figures.length;
  return shown(room, values, answers);
}

/* room: {sliders: {name: [label, low, high, step, value]}, breaks: [[words, values]], answers(p),
   show(p, answers) -> {verdict, fails, figures: [[svg, key]], rows: [[what, number]]}}; a key is
   [[kind, words]], the legend below the figure. */
function start(room) {
  const box = document.getElementById("sliders"), values = {};
  const find = (id) => document.getElementById(id);
  const draw = () => {
    const answers = room.answers(values), seen = shown(room, values, answers);
    find("verdict").textContent = seen.verdict;
    find("verdict").className = seen.fails ? "fails" : "holds";
    find("figures").innerHTML = seen.figures.map(([svg, key]) =>
      `<figure>${svg}<figcaption>${key.map(([kind, words]) => `<span><i class="key ${kind}"></i>${words}</span>`).join(" ")}</figcaption></figure>`).join("");
    find("rows").innerHTML = seen.rows.map(([what, number]) => `<tr><th scope="row">${what}</th><td>${number}</td></tr>`).join("");
  };
  const set = (name, value) => {
    values[name] = Number(value);
    find(name).value = value;
    find(`${name}-value`).textContent = show(values[name], 12);
  };
  const restore = (chosen = {}) => {
    for (const [name, [, , , , value]] of Object.entries(room.sliders)) set(name, chosen[name] ?? value);
    draw();
  };
  for (const [name, [label, low, high, step]] of Object.entries(room.sliders)) {
    box.insertAdjacentHTML("beforeend", `<div><label for="${name}">${label}</label><output id="${name}-value" for="${name}"></output><input type="range" id="${name}" min="${low}" max="${high}" step="${step}"></div>`);
    find(name).addEventListener("input", (event) => {
      set(name, event.target.value);
      draw();
    });
  }
  const buttons = [...room.breaks, ["Reset", {}]];
  buttons.forEach(([words, chosen]) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words;
    button.addEventListener("click", () => restore(chosen));
    find("buttons").append(button);
  });
  window.answers = room.answers;
  window.sliders = room.sliders;
  window.verdict = (p) => shown(room, p, room.answers(p)).verdict;
  window.addEventListener("resize", draw);
  restore();
}
