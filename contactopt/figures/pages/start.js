"use strict";
const COLOURS = {blue: "#0072B2", orange: "#D55E00", green: "#009E73", grey: "#666666"};

function element(name, text = "", attributes = {}) {
  const made = document.createElement(name);
  made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function bytes(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);  // of 2025, fast
  const letters = atob(text), made = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) made[i] = letters.charCodeAt(i);
  return made;
}

function unpack(packed) {  // the numbers of an array, without its shape
  const data = bytes(packed.data).buffer;
  if (packed.type === "u2") return Float32Array.from(new Uint16Array(data), (value) => packed.low + packed.step * value);
  return packed.type === "f4" ? new Float32Array(data) : new Int32Array(data);
}

function number(value) {
  return value === null || value === undefined || !Number.isFinite(Number(value)) ? "-" : String(Number(Number(value).toPrecision(4)));
}

function ticks(low, high, most) {  // round numbers between two numbers
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].find((m) => m * power >= rough * 0.999) * power;
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({length: Math.max(0, Math.min(count, 50))}, (_, i) => (first + i) * step);
}

function short(value) {  // as on an axis: 70000000 is 7e7
  const rounded = Number(value.toPrecision(6));
  return (Math.abs(rounded) < 1e6 ? String(rounded) : rounded.toExponential().replace("e+", "e")).replace("-", "\u2212");
}

function span(arrays) {
  let low = Infinity, high = -Infinity;
  for (const array of arrays) for (const value of array) { if (value < low) low = value; if (value > high) high = value; }
  return low < high ? [low, high] : [low - 0.5, high + 0.5];
}

function svg(name, attributes, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  return made;
}

const SCALES = {  // of an axis: a value's place, which values have one, round places, and the words at a place
  linear: {of: (value) => value, has: Number.isFinite, marks: ticks, words: short},
  share: {of: (value) => value, has: Number.isFinite, marks: () => [0, 0.25, 0.5, 0.75, 1], words: (place) => `${100 * place} %`, ends: [0, 1]},
  log: {of: Math.log10, has: (value) => value > 0, words: (k) => (k >= 0 && k < 4 ? String(10 ** k) : `1e${k}`),
    marks: (low, high, most) => { const step = Math.max(1, Math.ceil((high - low) / most)); return ticks(low / step, high / step, high - low).filter(Number.isInteger).map((k) => k * step); }},
};

// Lines {name, x, y, ink} in a box. `pairs`: every two points are a line of their own; `steps`: upright and level lines; `dots`: the look of a dot i, with its words.
function chart(box, lines, across, up, {x = "linear", y = "linear"} = {}) {
  const W = Math.max(260, box.clientWidth || 560), H = Math.round(0.6 * W), [L, R, T, B] = [58, 14, 28, 40], [h, v] = [SCALES[x], SCALES[y]];
  const picture = svg("svg", {viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `${up} against ${across}`});
  const seen = lines.map((line) => ({...line, at: Array.from(line.x, (own, i) => [h.of(own), v.of(line.y[i]), i]).filter(([, , i]) => h.has(line.x[i]) && v.has(line.y[i]))})).filter((line) => line.at.length);
  box.replaceChildren();
  if (!seen.length) { box.append(element("p", "Nothing is known here.", {class: "note"})); return; }
  const [[x0, x1], [y0, y1]] = [h, v].map((scale, c) => scale.ends ?? span(seen.map((line) => line.at.map((place) => place[c]))));
  const X = (place) => L + ((W - L - R) * (place - x0)) / (x1 - x0), Y = (place) => H - B - ((H - B - T) * (place - y0)) / (y1 - y0);
  for (const k of h.marks(x0, x1, W / 90)) picture.append(svg("path", {d: `M${X(k)} ${T}V${H - B}`, class: "grid"}), svg("text", {x: X(k), y: H - B + 16, "text-anchor": "middle"}, h.words(k)));
  for (const k of v.marks(y0, y1, H / 45)) picture.append(svg("path", {d: `M${L} ${Y(k)}H${W - R}`, class: "grid"}), svg("text", {x: L - 5, y: Y(k) + 4, "text-anchor": "end"}, v.words(k)));
  picture.append(svg("text", {x: (L + W - R) / 2, y: H - 6, "text-anchor": "middle"}, across), svg("text", {x: 4, y: 12}, up));
  for (const {name, ink, dash, pairs, steps, dots, pick, wide, at} of [...seen].reverse()) {
    const way = at.map(([a, b], i) => (i === 0 || (pairs && i % 2 === 0) ? `M${X(a)} ${Y(b)}` : steps ? `H${X(a)}V${Y(b)}` : `L${X(a)} ${Y(b)}`)).join("");
    const drawn = svg("path", {d: way, fill: "none", stroke: ink, "stroke-width": wide ?? 2, ...(dash && {"stroke-dasharray": "5 4"})});
    drawn.append(svg("title", {}, name));
    picture.append(drawn);
    if (dots) for (const [a, b, i] of at) {
      const {words, ...look} = dots(i), dot = svg("circle", {cx: X(a), cy: Y(b), r: 3.5, fill: ink, ...look});
      dot.append(svg("title", {}, words));
      if (pick) dot.addEventListener("click", () => pick(i));
      picture.append(dot);
    }
  }
  const legend = element("p", "", {class: "legend"});
  for (const {name, ink, quiet} of seen) if (name && !quiet) { const one = element("span", name); one.style.setProperty("--ink", ink); legend.append(one); }
  box.append(picture, legend);
}

async function unsqueezed(name) {  // the text that an element of this name holds compressed
  const packed = bytes(document.getElementById(name).textContent);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

async function start(program) {
  try {
    await program();
  } catch (fault) {
    const said = element("p", `This page could not be drawn: ${fault.message}. It needs a browser of 2023 or later.`, {id: "fault", role: "alert"});
    document.body.prepend(said);
    throw fault;
  }
}
