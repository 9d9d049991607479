const data = JSON.parse(document.getElementById("data").textContent);
const [LENGTH, STRESS] = data.units;
const flat = data.dim === 2;
const opened = (item) => Object.fromEntries(Object.entries(item).map(([name, value]) => [name, value.type ? unpack(value) : value]));
const bodies = data.bodies.map((body) => ({...opened(body), values: opened(body.values), shown: true, corners: body.inside.shape[1]}));
const contacts = data.contacts.map((pair) => ({...opened(pair), states: opened(pair.states), shown: true, corners: 4, inside: [], cut_cells: []}));
const CONTACT = {
  pressure: ["pressure", STRESS], traction: ["size of the tangential traction", STRESS], status: ["stick, slip, open", ""],
  gap: ["gap", LENGTH], slip: ["size of the slip", LENGTH],
};
const STATUS = ["open", "stick", "slip"];
const now = {field: "von_mises", scale: data.scale, contact: "pressure", state: data.states - 1, arrows: true, clear: false, edges: true, lines: false, whole: true, cut: "", place: 0.5, probe: null, box: data.near, zoom: 1};
const view = document.getElementById("view");
const control = (name) => document.getElementById(name);

function label(name) {
  if (name === "von_mises") return `von Mises stress [${STRESS}]`;
  if (name.startsWith("stress_")) return `stress ${name.slice(7)} [${STRESS}]`;
  return (name === "size" ? "size of the displacement" : `displacement ${name.slice(5)}`) + ` [${LENGTH}]`;
}

const count = (item) => item.points.length / 3;

function at(values, length) {  // those of the state shown, of all that there are
  return values.length === length ? values : values.subarray(now.state * length, (now.state + 1) * length);
}

const state = (pair, name) => at(pair.states[name], count(pair) * (name === "vector" ? 3 : 1));
const bodyNames = bodies.length ? ["von_mises", "size", ...data.axes.map((axis) => `move_${axis}`), ...Object.keys(bodies[0].values).filter((name) => name.startsWith("stress_"))] : [];

function values(body, name, every = false) {  // at the nodes of a body, in the state shown or in every state
  if (body.values[name]) return every ? body.values[name] : at(body.values[name], count(body));
  const dim = data.dim, move = every ? body.move : at(body.move, dim * count(body)), c = data.axes.indexOf(name.slice(5));
  return Float32Array.from({length: move.length / dim}, (_, i) => (name === "size" ? Math.hypot(...move.subarray(dim * i, dim * i + dim)) : move[dim * i + c]));
}

// An image is the list of the planes at which it is mirrored; the first one is the model itself.
const images = data.mirrors.reduce((made, plane) => [...made, ...made.map((own) => [...own, plane])], [[]]);
const shownImages = () => (now.whole ? images : images.slice(0, 1));

function sign(name, image) {  // by which a component changes in an image; those along r, z and the circle do not
  if (data.ring) return 1;
  const letters = name.startsWith("stress_") ? name.slice(7) : name.startsWith("move_") ? name.slice(5) : "";
  return image.reduce((found, [axis]) => found * ([...letters].filter((letter) => letter === data.axes[axis]).length % 2 ? -1 : 1), 1);
}

function placed(item) {  // places of the nodes of all images shown, one image after the other
  const length = count(item), dim = data.dim, move = at(item.move, dim * length), all = shownImages(), xyz = [0, 1, 2].map(() => new Float32Array(length * all.length));
  all.forEach((image, k) => {
    for (let c = 0; c < 3; c++) {
      const plane = image.find(([axis]) => axis === c), turn = plane ? -1 : 1, shift = plane ? 2 * plane[1] : 0;
      for (let i = 0; i < length; i++) xyz[c][k * length + i] = shift + turn * (item.points[3 * i + c] + (c < dim ? now.scale * move[dim * i + c] : 0));
    }
  });
  return xyz;
}

const whole = (item, name) => (now.whole ? item[name] : Int32Array.from([...item[name], ...item[`cut_${name}`]]));  // with what lies in the planes of symmetry

function lifted(xyz, cells) {  // places a little outside the surface, so that lines on it are not hidden
  const size = Math.max(...data.box[0].map((low, c) => data.box[1][c] - low)), up = xyz.map((x) => new Float64Array(x.length));
  if (flat) return [xyz[0], xyz[1], xyz[2].map(() => LIFT * size)];
  for (let i = 0; i < cells.length; i += 3) {
    const [a, b, d] = [cells[i], cells[i + 1], cells[i + 2]], e = xyz.map((x) => x[b] - x[a]), f = xyz.map((x) => x[d] - x[a]);
    const normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]], length = Math.hypot(...normal) || 1;
    for (const node of [a, b, d]) for (let c = 0; c < 3; c++) up[c][node] += normal[c] / length;
  }
  return xyz.map((x, c) => x.map((value, i) => value + (LIFT * size * up[c][i]) / (Math.hypot(up[0][i], up[1][i], up[2][i]) || 1)));
}

const repeated = (values, name = "") => (shownImages().length === 1 ? values : Float32Array.from(shownImages().flatMap((image) => [...values].map((value) => sign(name, image) * value))));
const numbered = (cells, length) => (shownImages().length === 1 ? cells : Int32Array.from(shownImages().flatMap((_, k) => [...cells].map((node) => node + k * length))));

function facing(cells, length) {  // triangles of all images: those of a mirror image turn the other way round
  const made = numbered(cells, length);
  shownImages().forEach((image, k) => {
    if (image.length % 2) for (let i = k * cells.length; i < (k + 1) * cells.length; i += 3) [made[i + 1], made[i + 2]] = [made[i + 2], made[i + 1]];
  });
  return made;
}

const TETRAHEDRA = [[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [3, 4, 6, 7], [1, 4, 5, 6]];  // of a hexahedron

function shaped(item, quantity) {  // what is drawn of an item: places, values, triangles, the node behind each place, and lines
  const xyz = placed(item), length = count(item), cells = facing(whole(item, "cells"), length);
  const made = {xyz, values: repeated(...quantity), cells, from: null, lines: (pairs) => lines(lifted(xyz, cells), numbered(pairs, length))};
  return now.cut === "" ? made : cut(item, made, length);
}

function knifeAt() {  // axis of the section, its place, and a function that is positive on what is cut off: the side of the eye at first
  const axis = Number(now.cut), [low, high] = data.box, place = low[axis] + now.place * (high[axis] - low[axis]), turn = axis < 2 ? -1 : 1;
  return {axis, place, beyond: (x) => turn * (x - place)};
}

function cut(item, whole, length) {  // what lies on one side of a plane, closed by the section through the elements
  const {axis, beyond} = knifeAt(), xyz = whole.xyz.map((x) => [...x]), found = [...whole.values], from = [...found.keys()], cells = [], height = (i) => beyond(xyz[axis][i]);
  const split = (made, a, b) => {  // the place on the line from a to b where the plane cuts it, made once
    const key = a < b ? a * from.length + b : b * from.length + a;
    if (!made.known.has(key)) {
      const share = height(a) / (height(a) - height(b));
      for (let c = 0; c < 3; c++) xyz[c].push(xyz[c][a] + share * (xyz[c][b] - xyz[c][a]));
      found.push(found[a] + share * (found[b] - found[a]));
      made.origins.push(share < 0.5 ? a : b);
      made.known.set(key, xyz[0].length - 1);
    }
    return made.known.get(key);
  };
  const origins = [], skin = {known: new Map(), origins}, section = {known: new Map(), origins};
  for (let i = 0; i < whole.cells.length; i += 3) {
    const corner = [...whole.cells.slice(i, i + 3)], kept = corner.map((node) => height(node) <= 0), inside = kept.filter(Boolean).length;
    if (inside === 3) cells.push(...corner);
    if (inside === 0 || inside === 3) continue;
    const odd = kept.indexOf(inside === 1), [a, b, c] = [0, 1, 2].map((step) => corner[(odd + step) % 3]), ab = split(skin, a, b), ac = split(skin, a, c);
    if (inside === 1) cells.push(a, ab, ac); else cells.push(b, c, ab, c, ac, ab);
  }
  const inner = numbered(item.inside, length), parts = item.corners === 8 ? TETRAHEDRA : [[0, 1, 2, 3]];
  for (let i = 0; i < inner.length; i += item.corners) {
    let some = false, all = true;
    for (let k = 0; k < item.corners; k++) if (height(inner[i + k]) <= 0) some = true; else all = false;
    if (!some || all) continue;
    for (const part of parts) {
      const corner = part.map((k) => inner[i + k]), low = corner.filter((node) => height(node) <= 0), high = corner.filter((node) => height(node) > 0);
      if (!low.length || !high.length) continue;
      const ring = low.length === 2 ? [[0, 0], [0, 1], [1, 1], [1, 0]].map(([a, b]) => split(section, low[a], high[b])) : low.flatMap((a) => high.map((b) => split(section, a, b)));
      cells.push(ring[0], ring[1], ring[2]);
      if (ring.length === 4) cells.push(ring[0], ring[2], ring[3]);
    }
  }
  const drawn = (pairs) => {
    const numbers = numbered(pairs, length), left = [];
    for (let i = 0; i < numbers.length; i += 2) {
      const [a, b] = [numbers[i], numbers[i + 1]], one = height(a) <= 0, other = height(b) <= 0;
      if (one && other) left.push(a, b); else if (one || other) left.push(one ? a : b, split(skin, a, b));
    }
    return lines(lifted(xyz, cells), left);
  };
  return {xyz, values: found, cells, from: [...from, ...origins], lines: drawn};
}

const corners = (cells, offset) => Int32Array.from({length: cells.length / 3}, (_, i) => cells[3 * i + offset]);

function lines(xyz, pairs) {
  const made = [[], [], []];
  for (let i = 0; i < pairs.length; i += 2)
    for (let c = 0; c < 3; c++) made[c].push(xyz[c][pairs[i]], xyz[c][pairs[i + 1]], null);
  return made;
}

function span(arrays) {
  let low = Infinity, high = -Infinity;
  for (const array of arrays) for (const value of array) { if (value < low) low = value; if (value > high) high = value; }
  return low < high ? [low, high] : [low - 0.5, high + 0.5];
}

function bodyTraces() {
  const shown = bodies.filter((body) => body.shown);
  const [low, high] = shown.length ? span(shown.map((body) => values(body, now.field, true))) : [0, 1];
  const top = now.field === "von_mises" ? Math.min(high, data.top) : high;
  return shown.flatMap((body, index) => {
    const shape = shaped(body, [values(body, now.field), now.field]), [x, y, z] = shape.xyz;
    const made = [{
      type: "mesh3d", name: plain(body.name), x, y, z, i: corners(shape.cells, 0), j: corners(shape.cells, 1), k: corners(shape.cells, 2),
      intensity: shape.values, colorscale: "Viridis", cmin: now.field === "von_mises" ? 0 : low, cmax: top,
      showscale: index === 0, opacity: now.clear ? 0.3 : 1, hoverinfo: "none", meta: {body: bodies.indexOf(body), from: shape.from},
      lighting: flat ? {ambient: 1, diffuse: 0, specular: 0} : {ambient: 0.75, diffuse: 0.4, specular: 0},
      colorbar: {orientation: "h", y: -0.02, yanchor: "top", thickness: 12, len: 0.9, title: {text: plain(label(now.field) + (data.moving && now.field.startsWith("stress_") ? ", last state" : "")), side: "top"}},
    }];
    for (const [name, width, shade] of [["lines", 1, "rgba(0,0,0,0.35)"], ["edges", 2, "rgba(0,0,0,0.8)"]]) {
      if (!now[name]) continue;
      const [ex, ey, ez] = shape.lines(name === "edges" ? whole(body, name) : body[name]);
      made.push({type: "scatter3d", mode: "lines", x: ex, y: ey, z: ez, line: {color: shade, width}, hoverinfo: "skip", showlegend: false});
    }
    return made;
  });
}

function contactTraces() {
  const shown = contacts.filter((pair) => pair.shown);
  if (!shown.length) return [];
  const [low, high] = now.contact === "status" ? [-0.5, 2.5] : span(shown.map((pair) => pair.states[now.contact]));
  const scale = now.contact === "status"
    ? [[0, COLOURS.grey], [1 / 3, COLOURS.grey], [1 / 3, COLOURS.blue], [2 / 3, COLOURS.blue], [2 / 3, COLOURS.orange], [1, COLOURS.orange]] : "Cividis";
  const [name, unit] = CONTACT[now.contact];
  const bar = {orientation: "h", y: 1.0, yanchor: "bottom", thickness: 12, len: 0.9, title: {text: plain(`contact: ${name}` + (unit ? ` [${unit}]` : "")), side: "top"}};
  if (now.contact === "status") Object.assign(bar, {tickvals: [0, 1, 2], ticktext: STATUS});
  return shown.flatMap((pair, index) => {
    const shape = shaped(pair, [state(pair, now.contact)]), [x, y, z] = shape.xyz, made = [], meta = {contact: contacts.indexOf(pair), from: shape.from};
    const look = {colorscale: scale, cmin: low, cmax: high, showscale: index === 0, colorbar: bar};
    if (pair.cells.length) {
      made.push({
        type: "mesh3d", name: plain(pair.name), x, y, z, i: corners(shape.cells, 0), j: corners(shape.cells, 1), k: corners(shape.cells, 2), intensity: shape.values, ...look,
        hoverinfo: "none", meta, lighting: {ambient: 1, diffuse: 0, specular: 0},
      });
    } else {
      made.push({
        type: "scatter3d", mode: "markers", name: plain(pair.name), x, y, z, hoverinfo: "none", meta,
        marker: {size: 4, color: shape.values, ...look, line: {width: 0}},
      });
    }
    if (now.arrows) made.push(...arrows(pair));
    return made;
  });
}

function arrows(pair) {
  const xyz = placed(pair), length = count(pair), force = state(pair, "vector"), status = state(pair, "status"), every = pair.states.vector, all = shownImages();
  const touching = [...status.keys()].filter((i) => status[i] > 0), step = Math.ceil((touching.length * all.length) / (flat ? 30 : 400));
  let largest = 1e-300;
  for (let i = 0; i < every.length; i += 3) largest = Math.max(largest, Math.hypot(every[i], every[i + 1], every[i + 2]));
  const arrowLength = 0.15 * Math.max(...now.box[0].map((low, c) => now.box[1][c] - low));
  const made = [[], [], []], tips = [[], [], []];
  all.forEach((image, k) => {
    for (let n = 0; n < touching.length; n += step) {
      const i = touching[n];
      if (now.cut !== "" && knifeAt().beyond(xyz[Number(now.cut)][k * length + i]) > 0) continue;
      for (let c = 0; c < 3; c++) {
        const turn = image.some(([axis]) => axis === c) ? -1 : 1, foot = xyz[c][k * length + i], tip = foot + (turn * arrowLength * force[3 * i + c]) / largest;
        made[c].push(foot, tip, null);
        tips[c].push(tip);
      }
    }
  });
  const common = {hoverinfo: "skip", showlegend: false, type: "scatter3d"};
  return [
    {...common, mode: "lines", x: made[0], y: made[1], z: made[2], line: {color: "#000", width: 3}},
    {...common, mode: "markers", x: tips[0], y: tips[1], z: tips[2], marker: {size: 2.5, color: "#000"}},
  ];
}

function probeTrace() {
  if (!now.probe) return [];
  const item = now.probe.body === undefined ? contacts[now.probe.contact] : bodies[now.probe.body];
  const [x, y, z] = placed(item), i = now.probe.node;
  return [{type: "scatter3d", mode: "markers", x: [x[i]], y: [y[i]], z: [z[i]], hoverinfo: "skip", showlegend: false,
    marker: {size: 8, color: "rgba(0,0,0,0)", line: {color: "#d00", width: 4}, symbol: "circle-open"}}];
}

const axis = (name) => ({title: {text: plain(`${name} [${LENGTH}]`)}, showbackground: false, zeroline: false, showspikes: false, nticks: flat ? 5 : 8, ...(flat ? {tickangle: 0} : {})});
const HOME = flat ? {eye: {x: 0, y: -0.07, z: 2.2}, up: {x: 0, y: 1, z: 0}, center: {x: 0, y: -0.07, z: 0}} : {eye: {x: -1.1, y: -1.5, z: 0.7}, up: {x: 0, y: 0, z: 1}, center: {x: 0, y: 0, z: 0}};
const MARGIN = 0.05;  // of the size of the box, about it
const FRONT = flat ? 0.54 : 0.42;
const ROUNDING = 1e-12;  // of the size of the bodies, below which a gap or a slip is what rounding leaves of zero
const LIFT = 0.002;  // of the size of the box, by which lines stand off the surface

function axesOfView() {  // unit vectors to the right and up in the first picture of solids
  const {x, y, z} = HOME.eye, size = Math.hypot(x, y, z), flatSize = Math.hypot(x, y);
  return [[-y / flatSize, x / flatSize, 0], [(-x * z) / flatSize / size, (-y * z) / flatSize / size, flatSize / size]];
}

function boxed() {  // ranges of the axes, and the size of the picture: in a parallel projection that of the aspect ratio
  const [low, high] = now.box, size = Math.max(...low.map((value, c) => high[c] - value)), rim = MARGIN * size, made = {"scene.aspectmode": "manual"};
  // One unit of the aspect ratio is about FRONT of the height between the colour bars.
  const height = view.clientHeight - 120, share = low.map((value, c) => (high[c] - value) / size + 2 * MARGIN);
  const room = flat ? [0.72, 0.78] : [0.75, 0.78], [right, up] = flat ? [[1, 0, 0], [0, 1, 0]] : axesOfView();
  const [across, tallest] = [right, up].map((way) => share.reduce((sum, value, c) => sum + Math.abs(way[c]) * value, 0));
  const tall = Math.min(room[1] / tallest, (room[0] * view.clientWidth) / height / across) / FRONT;
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

function deepen() {  // plotly's depth buffer reaches 1000 units either way; a picture of a few units needs a finer one to tell lines from surfaces
  const plot = view._fullLayout?.scene?._scene?.glplot, {x, y, z} = view.layout.scene.aspectratio || {x: 1, y: 1, z: 1};
  if (!plot || !plot.zFar) return;
  plot.zFar = 8 * Math.max(x, y, z);
  plot.redraw?.();
}

function draw() {
  Plotly.react(view, [...bodyTraces(), ...contactTraces(), ...probeTrace()], layout, config);
}

const rounded = (length) => (Math.abs(length) < ROUNDING * Math.max(...data.box[0].map((low, c) => data.box[1][c] - low)) ? 0 : length);

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
    for (const [name, [words, unit]] of Object.entries(CONTACT)) add(words, name === "status" ? STATUS[state(item, name)[i]] : unit === LENGTH ? rounded(state(item, name)[i]) : state(item, name)[i], unit);
  } else {
    for (const name of bodyNames) {
      const words = label(name), end = words.lastIndexOf(" [");
      add(words.slice(0, end), values(item, name)[i], words.slice(end + 2, -1));
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
    const [name, unit] = CONTACT[now.contact], x = pair.place.subarray(0, count(pair)), y = pair.place.subarray(count(pair));
    const trace = {
      type: "scatter", mode: "markers", x, y, text: words, meta: {contact: contacts.indexOf(pair)},
      marker: {color: state(pair, now.contact), colorscale: now.contact === "status" ? [[0, COLOURS.grey], [0.5, COLOURS.blue], [1, COLOURS.orange]] : "Cividis", showscale: now.contact !== "status", size: 7, symbol: "square"},
      hovertemplate: `x %{x:.4g}, y %{y:.4g} ${plain(LENGTH)}<br>${name} %{marker.color:.4g} ${plain(unit)}<br>%{text}<extra></extra>`,
    };
    Plotly.react(chart, [trace], {...common, xaxis: {title: {text: plain(`x on the surface [${LENGTH}]`)}, constrain: "domain"}, yaxis: {title: {text: plain(`y on the surface [${LENGTH}]`)}, scaleanchor: "x", constrain: "domain"}}, config);
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

if (bodies.length) choices("field", bodyNames.map((name) => [name, label(name)]), now.field, (value) => { now.field = value; });
choices("contact", Object.entries(CONTACT).map(([name, [words]]) => [name, words]), now.contact, (value) => { now.contact = value; });
choices("pair", contacts.map((pair, i) => [i, pair.name]), 0, () => {});
for (const [id, list] of [["bodies", bodies], ["pairs", contacts]]) for (const item of list) {
  const box = element("input", "", {type: "checkbox"}), line = element("label");
  box.checked = true;
  box.addEventListener("change", () => { item.shown = box.checked; draw(); });
  line.append(box, ` ${item.name}`);
  control(id).append(line);
}
for (const name of ["arrows", "clear", "edges", "lines", "whole"]) {
  control(name).checked = now[name];
  control(name).addEventListener("change", () => { now[name] = control(name).checked; draw(); });
}
control("whole-control").hidden = !data.mirrors.length;
control("cut-control").hidden = flat || !bodies.length;
const knife = control("cut-place"), cutWords = () => {
  const {axis, place} = knifeAt();
  control("cut-words").textContent = now.cut === "" ? "" : `${axis < 2 ? "from" : "up to"} ${data.axes[axis]} = ${number(place)} ${LENGTH}` + (bodies.some((body) => body.inside.length) ? "" : "; the inside is too large for this page");
  knife.disabled = now.cut === "";
};
choices("cut", [["", "nothing"], ...data.axes.map((name, axis) => [axis, name])], "", (value) => { now.cut = value; cutWords(); });
knife.value = now.place;
knife.addEventListener("input", () => { now.place = Number(knife.value); cutWords(); draw(); });
cutWords();
const slider = control("scale");
slider.max = data.most_scale; slider.step = data.most_scale / 100; slider.value = data.scale;
const times = () => { control("scale-words").textContent = `displacements x ${number(now.scale)}`; };
slider.addEventListener("input", () => { now.scale = Number(slider.value); times(); draw(); });
times();
if (data.history) {
  const steps = control("state");
  steps.max = data.states - 1; steps.value = now.state;
  steps.addEventListener("input", () => { now.state = Number(steps.value); everything(); if (now.probe) probe(now.probe); });
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
  bodies.forEach((body, index) => { if (body.shown) values(body, now.field).forEach((value, node) => { if (!best || value > best.value) best = {value, body: index, node}; }); });
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
view.on("plotly_relayout", deepen);
deepen();
view.on("plotly_click", ({points: [point]}) => {
  if (!point.data.meta) return;
  const {from, ...place} = point.data.meta, item = place.body === undefined ? contacts[place.contact] : bodies[place.body];
  probe({...place, node: (from ? from[point.pointNumber] : point.pointNumber) % count(item)});
  draw();
});
control("contact-chart").on("plotly_click", ({points: [point]}) => {
  const {contact, order} = point.data.meta;
  probe({contact, node: order ? order[point.pointNumber] : point.pointNumber});
  draw();
});
