"use strict";
const COLOURS = {blue: "#0072B2", orange: "#D55E00", green: "#009E73", grey: "#666666"};

function element(name, text = "", attributes = {}) {
  const made = document.createElement(name);
  made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

function bytes(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);  // browsers of 2025, ten times as fast
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
  return value === null || value === undefined || !Number.isFinite(Number(value)) ? "-" : Number(value).toPrecision(4).replace(/\.?0+(e|$)/, "$1");
}

function plain(name) {  // as text in a chart: plotly reads tags and formulas in labels
  return String(name).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll("$", "&#36;");
}

async function unsqueezed(name) {  // the text that an element of this name holds compressed
  const packed = bytes(document.getElementById(name).textContent);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

async function plotly() {  // unpacks the library of charts, which stands at the end of the page
  if (document.readyState === "loading") await new Promise((then) => document.addEventListener("DOMContentLoaded", then));
  const script = document.createElement("script");
  script.textContent = await unsqueezed("plotly");
  document.head.append(script);
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
