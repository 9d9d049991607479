const data = JSON.parse(document.getElementById("data").textContent);
const [LENGTH, STRESS] = data.units;
const flat = data.dim === 2;
const bodies = data.bodies.map((body) => ({
  ...body, points: unpack(body.points), move: unpack(body.move), cells: unpack(body.cells), edges: unpack(body.edges),
  values: Object.fromEntries(Object.entries(body.values).map(([name, value]) => [name, unpack(value)])), shown: true,
}));
const contacts = data.contacts.map((pair) => ({
  ...pair, points: unpack(pair.points), move: unpack(pair.move), cells: unpack(pair.cells), place: unpack(pair.place),
  states: Object.fromEntries(Object.entries(pair.states).map(([name, value]) => [name, unpack(value)])), shown: true,
}));
const CONTACT = {
  pressure: ["pressure", STRESS], traction: ["size of the tangential traction", STRESS], status: ["stick, slip, open", ""],
  gap: ["gap", LENGTH], slip: ["size of the slip", LENGTH],
};
const STATUS = ["open", "stick", "slip"];
const now = {field: "von_mises", scale: data.scale, contact: "pressure", state: data.states - 1, arrows: true, clear: false, edges: flat, probe: null, box: data.near, zoom: 1};
const view = document.getElementById("view");
const control = (name) => document.getElementById(name);

function label(name) {
  if (name === "von_mises") return `von Mises stress [${STRESS}]`;
  if (name.startsWith("stress_")) return `stress ${name.slice(7)} [${STRESS}]`;
  return (name === "size" ? "size of the displacement" : `displacement ${name.slice(5)}`) + ` [${LENGTH}]`;
}

function placed(item) {
  const count = item.points.length / 3, xyz = [0, 1, 2].map(() => new Float32Array(count));
  for (let i = 0; i < count; i++) for (let c = 0; c < 3; c++) xyz[c][i] = item.points[3 * i + c] + now.scale * item.move[3 * i + c];
  return xyz;
}

function corners(item, offset) {
  return Array.from({length: item.cells.length / 3}, (_, i) => item.cells[3 * i + offset]);
}

function lines(xyz, pairs) {
  const made = [[], [], []];
  for (let i = 0; i < pairs.length; i += 2)
    for (let c = 0; c < 3; c++) made[c].push(xyz[c][pairs[i]], xyz[c][pairs[i + 1]], null);
  return made;
}

function state(pair, name) {  // the values of one state of the load path; gap and slip are known of the last one only
  const values = pair.states[name], count = pair.points.length / 3;
  return values.length === count ? values : values.subarray(now.state * count, (now.state + 1) * count);
}

function span(arrays) {
  let low = Infinity, high = -Infinity;
  for (const array of arrays) for (const value of array) { if (value < low) low = value; if (value > high) high = value; }
  return low < high ? [low, high] : [low - 0.5, high + 0.5];
}

function bodyTraces() {
  const shown = bodies.filter((body) => body.shown);
  const [low, high] = shown.length ? span(shown.map((body) => body.values[now.field])) : [0, 1];
  const top = now.field === "von_mises" ? Math.min(high, data.top) : high;
  return shown.flatMap((body, index) => {
    const [x, y, z] = placed(body), made = [];
    made.push({
      type: "mesh3d", name: plain(body.name), x, y, z, i: corners(body, 0), j: corners(body, 1), k: corners(body, 2),
      intensity: body.values[now.field], colorscale: "Viridis", cmin: now.field === "von_mises" ? 0 : low, cmax: top,
      showscale: index === 0, opacity: now.clear ? 0.3 : 1, hoverinfo: "none", meta: {body: bodies.indexOf(body)},
      lighting: flat ? {ambient: 1, diffuse: 0, specular: 0} : {ambient: 0.75, diffuse: 0.4, specular: 0},
      colorbar: {orientation: "h", y: -0.02, yanchor: "top", thickness: 12, len: 0.9, title: {text: plain(label(now.field)), side: "top"}},
    });
    if (now.edges) {
      const [ex, ey, ez] = lines([x, y, z], body.edges);
      made.push({type: "scatter3d", mode: "lines", x: ex, y: ey, z: ez, line: {color: "rgba(0,0,0,0.6)", width: 1.5}, hoverinfo: "skip", showlegend: false});
    }
    return made;
  });
}

function contactTraces() {
  const shown = contacts.filter((pair) => pair.shown);
  if (!shown.length) return [];
  const [low, high] = now.contact === "status" ? [-0.5, 2.5] : span(shown.map((pair) => state(pair, now.contact)));
  const scale = now.contact === "status"
    ? [[0, COLOURS.grey], [1 / 3, COLOURS.grey], [1 / 3, COLOURS.blue], [2 / 3, COLOURS.blue], [2 / 3, COLOURS.orange], [1, COLOURS.orange]] : "Cividis";
  const [name, unit] = CONTACT[now.contact];
  const bar = {orientation: "h", y: 1.0, yanchor: "bottom", thickness: 12, len: 0.9, title: {text: plain(`contact: ${name}` + (unit ? ` [${unit}]` : "")), side: "top"}};
  if (now.contact === "status") Object.assign(bar, {tickvals: [0, 1, 2], ticktext: STATUS});
  return shown.flatMap((pair, index) => {
    const [x, y, z] = placed(pair), values = state(pair, now.contact), made = [], meta = {contact: contacts.indexOf(pair)};
    const look = {colorscale: scale, cmin: low, cmax: high, showscale: index === 0, colorbar: bar};
    if (pair.cells.length) {
      made.push({
        type: "mesh3d", name: plain(pair.name), x, y, z, i: corners(pair, 0), j: corners(pair, 1), k: corners(pair, 2), intensity: values, ...look,
        hoverinfo: "none", meta, lighting: {ambient: 1, diffuse: 0, specular: 0},
      });
    } else {
      made.push({
        type: "scatter3d", mode: "markers", name: plain(pair.name), x, y, z, hoverinfo: "none", meta,
        marker: {size: 4, color: values, ...look, line: {width: 0}},
      });
    }
    if (now.arrows && now.state === data.states - 1) made.push(...arrows(pair, [x, y, z]));
    return made;
  });
}

function arrows(pair, xyz) {
  const force = pair.states.vector, status = state(pair, "status");
  const touching = [...status.keys()].filter((i) => status[i] > 0), every = Math.ceil(touching.length / 400);
  const largest = Math.max(...touching.map((i) => Math.hypot(force[3 * i], force[3 * i + 1], force[3 * i + 2])), 1e-300);
  const arrowLength = 0.15 * Math.max(...now.box[0].map((low, c) => now.box[1][c] - low));
  const made = [[], [], []], tips = [[], [], []];
  for (let n = 0; n < touching.length; n += every) {
    const i = touching[n];
    for (let c = 0; c < 3; c++) {
      const tip = xyz[c][i] + (arrowLength * force[3 * i + c]) / largest;
      made[c].push(xyz[c][i], tip, null);
      tips[c].push(tip);
    }
  }
  const common = {hoverinfo: "skip", showlegend: false, type: "scatter3d"};
  return [
    {...common, mode: "lines", x: made[0], y: made[1], z: made[2], line: {color: "#000", width: 3}},
    {...common, mode: "markers", x: tips[0], y: tips[1], z: tips[2], marker: {size: flat ? 4 : 2.5, color: "#000"}},
  ];
}

function probeTrace() {
  if (!now.probe) return [];
  const item = now.probe.body === undefined ? contacts[now.probe.contact] : bodies[now.probe.body];
  const [x, y, z] = placed(item), i = now.probe.node;
  return [{type: "scatter3d", mode: "markers", x: [x[i]], y: [y[i]], z: [z[i]], hoverinfo: "skip", showlegend: false,
    marker: {size: 8, color: "rgba(0,0,0,0)", line: {color: "#d00", width: 4}, symbol: "circle-open"}}];
}

const axis = (name) => ({title: {text: plain(`${name} [${LENGTH}]`)}, showbackground: false, zeroline: false, showspikes: false});
const HOME = flat ? {eye: {x: 0, y: 0, z: 2.2}, up: {x: 0, y: 1, z: 0}, center: {x: 0, y: 0, z: 0}} : {eye: {x: -1.1, y: -1.5, z: 0.7}, up: {x: 0, y: 0, z: 1}, center: {x: 0, y: 0, z: 0}};
const MARGIN = 0.05;  // of the size of the box, about it
const FRONT = 0.54;

function boxed() {  // ranges of the axes, and the size of the picture: in a parallel projection that of the aspect ratio
  const [low, high] = now.box, size = Math.max(...low.map((value, c) => high[c] - value)), rim = MARGIN * size, made = {"scene.aspectmode": "manual"};
  // In the front view one unit of the aspect ratio is about FRONT of the height between the colour bars.
  const height = view.clientHeight - 120, share = low.map((value, c) => (high[c] - value) / size + 2 * MARGIN);
  const tall = flat ? Math.min(0.85 / share[1], (0.8 * view.clientWidth) / height / share[0]) / FRONT : Math.min(1.6, (2 * view.clientWidth) / height);
  ["x", "y", "z"].forEach((name, c) => {
    const thin = flat && c === 2, a = thin ? -size / 10 : low[c] - rim, b = thin ? size / 10 : high[c] + rim;
    made[`scene.${name}axis.range`] = [a, b];
    made[`scene.aspectratio.${name}`] = (now.zoom * tall * (b - a)) / size;
  });
  return made;
}
const layout = {
  margin: {l: 0, r: 0, t: 50, b: 70}, showlegend: false, uirevision: "kept",
  scene: {
    dragmode: flat ? "pan" : "orbit", xaxis: axis(data.axes[0]), yaxis: axis(data.axes[1]),
    zaxis: flat ? {visible: false} : axis(data.axes[2]),
    camera: {...HOME, projection: {type: "orthographic"}},
  },
};
const config = {responsive: true, displaylogo: false};

function draw() {
  Plotly.react(view, [...bodyTraces(), ...contactTraces(), ...probeTrace()], layout, config);
}

function probe(place) {
  now.probe = place;
  const table = control("values");
  table.replaceChildren();
  const add = (name, value, unit) => {
    const row = element("tr");
    row.append(element("th", name, {scope: "row"}), element("td", `${typeof value === "string" ? value : number(value)} ${unit}`));
    table.append(row);
  };
  if (!place) return;
  const item = place.body === undefined ? contacts[place.contact] : bodies[place.body], i = place.node;
  add(place.body === undefined ? "contact" : "node", `${i} of ${item.name}`, "");
  data.axes.forEach((name, c) => add(name, item.points[3 * i + c], LENGTH));
  if (place.body === undefined) {
    for (const [name, [words, unit]] of Object.entries(CONTACT)) add(words, name === "status" ? STATUS[state(item, name)[i]] : state(item, name)[i], unit);
  } else {
    for (const [name, values] of Object.entries(item.values)) {
      const words = label(name), at = words.lastIndexOf(" [");
      add(words.slice(0, at), values[i], words.slice(at + 2, -1));
    }
  }
}

function turn(about, up, closer) {
  const camera = structuredClone(view.layout.scene.camera), {x, y, z} = camera.eye, distance = Math.hypot(x, y, z) * closer;
  if (flat) {
    const step = 0.1, centre = camera.center || {x: 0, y: 0, z: 0};
    camera.center = {x: centre.x - about * step, y: centre.y + up * step, z: centre.z};
    camera.eye = {x: camera.center.x, y: camera.center.y, z};
  } else {
    const angle = Math.atan2(y, x) + (about * Math.PI) / 12;
    const height = Math.max(-1.5, Math.min(1.5, Math.asin(z / Math.hypot(x, y, z)) + (up * Math.PI) / 12));
    camera.eye = {x: distance * Math.cos(height) * Math.cos(angle), y: distance * Math.cos(height) * Math.sin(angle), z: distance * Math.sin(height)};
  }
  now.zoom /= closer;
  Plotly.relayout(view, {"scene.camera": camera, ...boxed()});
}

function show(box) {
  now.box = box;
  now.zoom = 1;
  draw();
  Plotly.relayout(view, {"scene.camera": {...HOME, projection: {type: "orthographic"}}, ...boxed()});
}

function drawContact() {
  const chart = control("contact-chart"), pair = contacts[Number(control("pair").value) || 0];
  if (!pair) return;
  const status = state(pair, "status"), pressure = state(pair, "pressure"), common = {margin: {l: 60, r: 15, t: 30, b: 95}, legend: {orientation: "h", y: -0.25, yanchor: "top"}, uirevision: "kept"};
  const words = [...status].map((value) => STATUS[value]);
  if (!flat) {
    const [name, unit] = CONTACT[now.contact], count = pair.points.length / 3;
    const x = pair.place.subarray(0, count), y = pair.place.subarray(count);
    const trace = {
      type: "scatter", mode: "markers", x, y, text: words, meta: {contact: contacts.indexOf(pair)},
      marker: {color: state(pair, now.contact), colorscale: now.contact === "status" ? [[0, COLOURS.grey], [0.5, COLOURS.blue], [1, COLOURS.orange]] : "Cividis", showscale: now.contact !== "status", size: 7, symbol: "square"},
      hovertemplate: `x %{x:.4g}, y %{y:.4g} ${plain(LENGTH)}<br>${name} %{marker.color:.4g} ${plain(unit)}<br>%{text}<extra></extra>`,
    };
    Plotly.react(chart, [trace], {...common, xaxis: {title: {text: plain(`x on the surface [${LENGTH}]`)}}, yaxis: {title: {text: plain(`y on the surface [${LENGTH}]`)}, scaleanchor: "x"}}, config);
    return;
  }
  const bound = state(pair, "bound"), traction = state(pair, "along"), order = [...pair.place.keys()].sort((a, b) => pair.place[a] - pair.place[b]);
  const pick = (values) => order.map((i) => values[i]), x = pick(pair.place), meta = {contact: contacts.indexOf(pair), order};
  const series = (name, y, look) => ({type: "scatter", name, x, y, text: pick(words), meta, hovertemplate: `%{x:.4g} ${plain(LENGTH)}: %{y:.4g} ${plain(STRESS)}, %{text}`, ...look});
  Plotly.react(chart, [
    series("pressure", pick(pressure), {mode: "lines+markers", line: {color: COLOURS.green}, marker: {size: 5}}),
    series("friction bound", pick(bound), {mode: "lines", line: {color: COLOURS.grey, dash: "dash"}}),
    series("minus friction bound", pick(bound).map((v) => -v), {mode: "lines", line: {color: COLOURS.grey, dash: "dash"}, showlegend: false}),
    series("tangential traction", pick(traction), {mode: "lines+markers", line: {color: COLOURS.blue},
      marker: {size: 7, symbol: pick(status).map((s) => ["x", "circle", "square-open"][s]), color: pick(status).map((s) => [COLOURS.grey, COLOURS.blue, COLOURS.orange][s])}}),
  ], {...common, xaxis: {title: {text: plain(`place on the surface [${LENGTH}]`)}}, yaxis: {title: {text: plain(`[${STRESS}]`)}}}, config);
}

function drawPath() {
  if (!data.history) return;
  const h = data.history, i = now.state;
  const sheared = Math.max(...h.shift) - Math.min(...h.shift) > 1e-6 * (Math.max(...h.approach) - Math.min(...h.approach));
  const [a, b] = sheared ? ["shift", "shear_force"] : ["approach", "normal_force"];
  Plotly.react(control("path-chart"), [
    {type: "scatter", mode: "lines+markers", name: "states", x: h[a], y: h[b], line: {color: COLOURS.blue}, hovertemplate: "state %{pointNumber}<br>%{x:.4g}, %{y:.4g}<extra></extra>"},
    {type: "scatter", mode: "markers", name: "this state", x: [h[a][i]], y: [h[b][i]], marker: {size: 13, color: COLOURS.orange}, hoverinfo: "skip"},
  ], {margin: {l: 60, r: 15, t: 30, b: 50}, showlegend: false, uirevision: "kept",
    xaxis: {title: {text: plain(`${a} [${LENGTH}]`)}}, yaxis: {title: {text: plain(`${b.replace("_", " ")} [${STRESS} ${LENGTH}^2]`)}}}, config);
  control("state-words").textContent = `state ${i + 1} of ${data.states}: ${h.stick_nodes[i]} contacts stick, ${h.slip_nodes[i]} slip`;
}

function everything() { draw(); drawContact(); drawPath(); }

function choices(id, items, chosen, change) {
  const box = control(id);
  for (const [value, words] of items) box.append(element("option", words, {value}));
  box.value = chosen;
  box.addEventListener("change", () => { change(box.value); everything(); });
}

if (bodies.length) choices("field", Object.keys(bodies[0].values).map((name) => [name, label(name)]), now.field, (value) => { now.field = value; });
choices("contact", Object.entries(CONTACT).map(([name, [words]]) => [name, words]), now.contact, (value) => { now.contact = value; });
choices("pair", contacts.map((pair, i) => [i, pair.name]), 0, () => {});
for (const [id, list] of [["bodies", bodies], ["pairs", contacts]]) for (const item of list) {
  const box = element("input", "", {type: "checkbox"}), line = element("label");
  box.checked = true;
  box.addEventListener("change", () => { item.shown = box.checked; draw(); });
  line.append(box, ` ${item.name}`);
  control(id).append(line);
}
for (const name of ["arrows", "clear", "edges"]) {
  control(name).checked = now[name];
  control(name).addEventListener("change", () => { now[name] = control(name).checked; draw(); });
}
const slider = control("scale");
slider.max = data.most_scale; slider.step = data.most_scale / 100; slider.value = data.scale;
const times = () => { control("scale-words").textContent = `displacements x ${number(now.scale)}`; };
slider.addEventListener("input", () => { now.scale = Number(slider.value); times(); draw(); });
times();
if (data.history) {
  const steps = control("state");
  steps.max = data.states - 1; steps.value = now.state;
  steps.addEventListener("input", () => { now.state = Number(steps.value); everything(); });
} else control("path").hidden = true;
if (!bodies.length) control("body-controls").hidden = true;
for (const [id, ...move] of [["left", -1, 0, 1], ["right", 1, 0, 1], ["up", 0, 1, 1], ["down", 0, -1, 1], ["closer", 0, 0, 0.8], ["farther", 0, 0, 1.25]])
  control(id).addEventListener("click", () => turn(...move));
control("home").addEventListener("click", () => show(data.box));
control("near").addEventListener("click", () => show(data.near));
const KEYS = {ArrowLeft: [-1, 0, 1], ArrowRight: [1, 0, 1], ArrowUp: [0, 1, 1], ArrowDown: [0, -1, 1], "+": [0, 0, 0.8], "=": [0, 0, 0.8], "-": [0, 0, 1.25]};
view.addEventListener("keydown", (event) => { if (KEYS[event.key]) { turn(...KEYS[event.key]); event.preventDefault(); } });
control("largest").addEventListener("click", () => {
  let best = null;
  bodies.forEach((body, index) => { if (body.shown) body.values[now.field].forEach((value, node) => { if (!best || value > best.value) best = {value, body: index, node}; }); });
  if (best) probe({body: best.body, node: best.node});
  draw();
});
control("peak").addEventListener("click", () => {
  let best = null;
  contacts.forEach((pair, index) => state(pair, "pressure").forEach((value, node) => { if (!best || value > best.value) best = {value, contact: index, node}; }));
  if (best) probe({contact: best.contact, node: best.node});
  draw();
});
everything();
show(now.box);
view.on("plotly_click", ({points: [point]}) => {
  if (point.data.meta) { probe({...point.data.meta, node: point.pointNumber}); draw(); }
});
control("contact-chart").on("plotly_click", ({points: [point]}) => {
  const {contact, order} = point.data.meta;
  probe({contact, node: order ? order[point.pointNumber] : point.pointNumber});
  draw();
});
