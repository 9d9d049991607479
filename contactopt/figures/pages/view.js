const data = JSON.parse(await unsqueezed("data"));
const [LENGTH, STRESS, FORCE] = data.units;
const flat = data.dim === 2;
const opened = (item) => Object.fromEntries(Object.entries(item).map(([name, value]) => [name, value?.type ? unpack(value) : value]));
const bodies = data.bodies.map((body) => ({...opened(body), values: opened(body.values), shown: true, corners: body.inside.shape[1]}));
const contacts = data.contacts.map((pair) => ({...opened(pair), states: opened(pair.states), shown: !pair.hidden, corners: 4, inside: [], cut_cells: []}));
bodies.forEach((body, index) => { body.values.body ??= new Float32Array(body.points.length / 3).fill(index); });
const CONTACT = data.words ?? {  // those of a scene that nobody has solved yet, or of a result
  pressure: ["pressure", STRESS], traction: ["size of the tangential traction", STRESS], status: ["stick, slip, open", ""],
  gap: ["gap", LENGTH], slip: ["size of the slip", LENGTH],
};
const STATUS = ["open", "stick", "slip"];
const now = {field: "body", scale: data.scale, contact: Object.keys(CONTACT)[0], state: data.states - 1, arrows: flat || Boolean(data.words), clear: true, edges: true, lines: false, whole: true, cut: "", place: 0.5, probe: null, focus: 0};
const view = document.getElementById("view");
let charted = false;
const control = (name) => document.getElementById(name);

function label(name) {
  if (name === "body") return "bodies";
  if (name === "von_mises") return `von Mises stress [${STRESS}]`;
  if (name.startsWith("stress_")) return `stress ${name.slice(7)} [${STRESS}]`;
  return (name === "size" ? "size of the displacement" : `displacement ${name.slice(5)}`) + ` [${LENGTH}]`;
}

const count = (item) => item.points.length / 3;

function at(values, length) {  // those of the state shown, of all that there are
  return values.length === length ? values : values.subarray(now.state * length, (now.state + 1) * length);
}

const state = (pair, name) => at(pair.states[name], count(pair) * (/vector|held/.test(name) ? 3 : 1));
const bodyNames = data.words ? ["body"] : bodies.length ? ["body", "von_mises", "size", ...data.axes.map((axis) => `move_${axis}`), ...Object.keys(bodies[0].values).filter((name) => name.startsWith("stress_"))] : [];

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

function placed(item) {  // nodes of all images shown, one after the other
  const length = count(item), dim = data.dim, move = at(item.move, dim * length), more = Math.max(0, now.scale - 1), all = shownImages(), xyz = [0, 1, 2].map(() => new Float32Array(length * all.length));
  all.forEach((image, k) => {
    for (let c = 0; c < 3; c++) {
      const plane = image.find(([axis]) => axis === c), turn = plane ? -1 : 1, shift = plane ? 2 * plane[1] : 0;
      for (let i = 0; i < length; i++) xyz[c][k * length + i] = shift + turn * (item.points[3 * i + c] + (c < dim ? now.scale * move[dim * i + c] + (item.lift ? more * item.lift[dim * i + c] : 0) : 0));
    }
  });
  return xyz;
}

const whole = (item, name) => (now.whole ? item[name] : Int32Array.from([...item[name], ...item[`cut_${name}`]]));  // with what lies in the planes of symmetry

function imaged(numbers, change) {  // those of all images: factor * number + shift
  const all = shownImages(), many = numbers.length, made = new numbers.constructor(many * all.length);
  if (all.length === 1) return numbers;
  all.forEach((image, k) => { const [factor, shift] = change(image, k); for (let i = 0; i < many; i++) made[k * many + i] = factor * numbers[i] + shift; });
  return made;
}

const repeated = (values, name = "") => imaged(values, (image) => [sign(name, image), 0]);
const numbered = (cells, length) => imaged(cells, (_, k) => [1, k * length]);

const TETRAHEDRA = [[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [3, 4, 6, 7], [1, 4, 5, 6]];  // of a hexahedron

function shaped(item, quantity) {  // what is drawn of an item: places, values, triangles, the node behind each place, and lines
  const xyz = placed(item), length = count(item), cells = numbered(whole(item, "cells"), length);
  const made = {xyz, values: repeated(...quantity), cells, from: null, lines: (pairs) => numbered(pairs, length)};
  return now.cut === "" ? made : cut(item, made, length);
}

function knifeAt() {  // axis and place of the section; positive on what is cut off: the side of the eye at first
  const axis = Number(now.cut), [low, high] = data.box, place = low[axis] + now.place * (high[axis] - low[axis]), turn = axis < 2 ? -1 : 1;
  return {axis, place, beyond: (x) => turn * (x - place)};
}

function cut(item, whole, length) {  // one side of a plane, closed by the section
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
    return left;
  };
  return {xyz, values: found, cells, from: [...from, ...origins], lines: drawn};
}

const TABLES = {bodies: palette(PALETTES.viridis), contact: palette(PALETTES.heat), status: palette(["666666", "0072B2", "D55E00"], true), body: palette((bodies.length ? bodies : [0]).map((_, i) => ["dcd8d0", "c5d3e0", "d5e0c5", "e3cfc8"][i % 4]), true), role: palette((data.roles || [0]).map((_, i) => ["999999", "0072B2", "009E73", "CC79A7", "D55E00", "E69F00", "56B4E9", "F0E442"][i % 8]), true)};
const BIN = 16;  // pixels, the side of a square of the picture that shows at most one arrow
const painter = new Painter(view);
let owners = [];  // [first number, item, node behind the corners of its triangles or its dots]

function bodyColours() {
  if (now.field === "body") return {table: TABLES.body, low: -0.5, high: bodies.length - 0.5, names: bodies.map((body) => body.name)};
  const shown = bodies.filter((body) => body.shown), [low, high] = shown.length ? span(shown.map((body) => values(body, now.field, true))) : [0, 1], mises = now.field === "von_mises";
  return {table: TABLES.bodies, low: mises ? 0 : low, high: mises ? Math.min(high, data.top) : high};
}

function contactColours() {
  if (now.contact === "role") return {table: TABLES.role, low: -0.5, high: data.roles.length - 0.5, names: data.roles, shown: [...new Set(contacts.filter((pair) => pair.shown).map((pair) => state(pair, "role")[0]))].sort((a, b) => a - b)};
  if (now.contact === "status") return {table: TABLES.status, low: -0.5, high: 2.5, names: STATUS};
  const [low, high] = span(contacts.filter((pair) => pair.shown).map((pair) => pair.states[now.contact]));
  return {table: TABLES.contact, low: now.contact === "gap" ? low : Math.min(low, 0), high};
}

function own(item, meta, cells) {  // numbers for the triangles of an item, or for its dots
  const last = owners.at(-1), first = last ? last.first + last.length : 0;
  owners.push({first, length: cells ? cells.length / 3 : meta.places[0].length, cells, ...meta});
  return first;
}

function hides(body) {  // whether it may stand between the eye and the contact looked at: all but the body behind that
  if (flat || !now.clear || now.cut !== "") return false;
  const {normal, bodies: names} = contacts[now.focus] ?? {}, eye = painter.axes[2];
  return !normal || body.name !== names[normal.reduce((sum, value, c) => sum + value * eye[c], 0) > 0 ? 1 : 0];
}

function paintBody(body, colours) {
  const shape = shaped(body, [values(body, now.field), now.field]), drawn = [["lines", 90, 1], ["edges", 20, 1.6]].filter(([name]) => now[name]).map(([name, ...look]) => [shape.lines(name === "edges" ? whole(body, name) : body[name]), ...look]);
  const places = painter.places(shape.xyz), first = own(body, {body: bodies.indexOf(body), from: shape.from, places}, shape.cells);
  painter.triangles(places, shape.cells, shape.values, {...colours, lit: !flat, sheer: hides(body), first});
  for (const [pairs, ...look] of drawn) painter.lines(places, pairs, ...look);
}

function paintContact(pair, colours) {
  const shape = shaped(pair, [state(pair, now.contact)]), places = painter.places(shape.xyz), meta = {contact: contacts.indexOf(pair), from: shape.from, places}, look = {lit: false, bare: now.contact === "pressure"};
  if (pair.lines?.length) {
    const {places: corners, cells, from} = painter.ribbon(places, shape.lines(pair.lines), 8);
    painter.triangles(corners, cells, from.map((node) => shape.values[node]), {...colours, ...look, towards: 7, first: own(pair, {...meta, places: corners, from}, cells)});
  } else if (pair.cells.length) painter.triangles(places, shape.cells, shape.values, {...colours, ...look, towards: painter.dense, first: own(pair, meta, shape.cells)});
  else painter.dots(places, shape.values, 3, {...colours, first: own(pair, meta)});
}

function held(pair) {  // at marked places a triangle along each axis along which they are held, its tip on the place; 2: full
  const xyz = placed(pair), length = count(pair), ways = state(pair, "held"), marked = state(pair, "status"), [right, up] = painter.axes;
  shownImages().forEach((image, k) => {
    for (let i = 0; i < length; i++) for (let c = 0; c < data.dim; c++) {
      const own = ways[3 * i + c], way = 15 * Math.sign(own) * (image.some(([axis]) => axis === c) ? -1 : 1), [dx, dy] = [way * right[c], -way * up[c]], size = Math.hypot(dx, dy);
      if (!marked[i] || size < 3) continue;
      const [x, y] = painter.place(...xyz.map((own) => own[k * length + i])).map((value) => value / painter.dense), [a, b] = [(-dy * 6) / size, (dx * 6) / size];
      painter.stroke([[x, y], [x + dx + a, y + dy + b], [x + dx - a, y + dy - b], [x, y]], COLOURS.blue, 1.5, Math.abs(own) > 1 ? COLOURS.blue : "#fff");
      painter.stroke([[x + dx + 1.6 * a, y + dy + 1.6 * b], [x + dx - 1.6 * a, y + dy - 1.6 * b]], COLOURS.blue, 3);
    }
  });
}

function arrows(pair) {  // the largest force of each square
  const xyz = placed(pair), length = count(pair), force = state(pair, "vector"), status = state(pair, "status"), every = pair.states.vector, best = new Map();
  let largest = 1e-300;
  for (let i = 0; i < every.length; i += 3) largest = Math.max(largest, Math.hypot(every[i], every[i + 1], every[i + 2]));
  shownImages().forEach((image, k) => {
    for (let i = 0; i < length; i++) {
      const n = k * length + i, foot = painter.place(xyz[0][n], xyz[1][n], xyz[2][n]).map((value) => value / painter.dense), size = Math.hypot(...force.subarray(3 * i, 3 * i + 3));
      if (!(status[i] > 0) || (now.cut !== "" && knifeAt().beyond(xyz[Number(now.cut)][n]) > 0)) continue;
      const key = `${Math.floor(foot[0] / BIN)},${Math.floor(foot[1] / BIN)}`;
      if (!(best.get(key)?.size >= size)) best.set(key, {size, foot, way: [0, 1, 2].map((c) => (image.some(([axis]) => axis === c) ? -1 : 1) * force[3 * i + c])});
    }
  });
  const [right, up] = painter.axes, longest = reach() / largest, along = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  for (const {size, foot, way} of best.values()) if (size > 0.01 * largest) painter.arrow(foot, [longest * along(way, right), -longest * along(way, up)]);
}

function room() {  // left, right, top and bottom of the picture between the colour bars and the labels
  return [flat ? 64 : 20, view.clientWidth - 20, contacts.length ? 62 : 20, view.clientHeight - (bodies.length ? 56 : 8) - (flat ? 34 : 14)];
}

const reach = () => (data.words ? 0.08 : 0.13) * Math.min(view.clientWidth, view.clientHeight);  // length of the longest arrow

function aim() {  // turns the model, and makes the box fit
  const {angle, height} = now, [c, s, h, v] = [Math.cos(angle), Math.sin(angle), Math.cos(height), Math.sin(height)];
  const axes = flat ? [[1, 0, 0], [0, 1, 0], [0, 0, 1]] : [[-s, c, 0], [-c * v, -s * v, h], [c * h, s * h, v]];
  const [low, high] = now.box, [left, right, top, bottom] = room(), rim = data.words ? 2 * reach() : 0;  // for the arrows of loads
  const [wide, tall] = axes.map((way) => low.reduce((sum, value, i) => sum + Math.abs(way[i]) * (high[i] - value), 0));
  const scale = (0.94 * now.zoom) / Math.max(wide / (right - left - rim), tall / (bottom - top - rim), 1e-300);
  painter.look(axes, low.map((value, i) => (value + high[i]) / 2 + now.shift[i]), scale, [(left + right) / 2, (top + bottom) / 2]);
}

function rulers() {  // along the rim of a plane picture, in space along edges of the box
  const [left, right, top, bottom] = room(), name = (c) => `${data.axes[c]} [${LENGTH}]`, pixel = painter.scale / painter.dense, centre = painter.centre;
  if (flat) {
    const middle = [(left + right) / 2, (top + bottom) / 2], ends = [[left, right].map((x) => centre[0] + (x - middle[0]) / pixel), [bottom, top].map((y) => centre[1] - (y - middle[1]) / pixel)];
    painter.stroke([[left, top], [left, bottom], [right, bottom]], "#888", 1);
    for (const value of ticks(...ends[0], right - left > 500 ? 8 : 4)) { const x = middle[0] + (value - centre[0]) * pixel; painter.stroke([[x, bottom], [x, bottom + 4]], "#888", 1); painter.text(short(value), x, bottom + 12); }
    for (const value of ticks(...ends[1], 6)) { const y = middle[1] - (value - centre[1]) * pixel; painter.stroke([[left - 4, y], [left, y]], "#888", 1); painter.text(short(value), left - 7, y, "right"); }
    painter.text(name(0), middle[0], bottom + 28); painter.text(name(1), left - 50, top - 8, "left");
    return;
  }
  const [low, high] = now.box, at = (...p) => painter.place(...p).slice(0, 2).map((value) => value / painter.dense);
  for (let c = 0; c < 3; c++) {  // the lowest one of its four edges, and of upright ones the leftmost
    if (!(high[c] > low[c])) continue;
    const others = [0, 1, 2].filter((axis) => axis !== c), edges = [0, 1, 2, 3].map((corner) => { const p = [0, 0, 0]; others.forEach((axis, bit) => { p[axis] = [low, high][(corner >> bit) & 1][axis]; }); return p; });
    const along = (p, value) => at(...p.map((x, axis) => (axis === c ? value : x))), middle = (low[c] + high[c]) / 2, rank = (p) => { const [x, y] = along(p, middle); return c === 2 ? -x : y; };
    const edge = edges.reduce((a, b) => (rank(b) > rank(a) ? b : a)), [start, end] = [along(edge, low[c]), along(edge, high[c])], [mx, my] = along(edge, middle);
    const side = c === 2 || mx < painter.middle[0] / painter.dense ? -1 : 1, align = side < 0 ? "right" : "left", long = Math.hypot(end[0] - start[0], end[1] - start[1]);
    if (long < 30) continue;
    painter.stroke([start, end], "#888", 1);
    for (const value of ticks(low[c], high[c], Math.max(1, Math.min(6, long / 45)))) { const [x, y] = along(edge, value); painter.stroke([[x, y], [x + 4 * side, y + (c === 2 ? 0 : 3)]], "#888", 1); painter.text(short(value), x + 7 * side, y + (c === 2 ? 0 : 8), align); }
    painter.text(name(c), mx + (c === 2 ? 42 : 36) * side, my + (c === 2 ? -16 : 26), "center");
  }
}

function draw(moving = false) {
  const body = bodyColours(), contact = contactColours(), pairs = contacts.filter((pair) => pair.shown);
  owners = [];
  painter.begin(moving); aim();
  for (const item of bodies) if (item.shown) paintBody(item, body);
  for (const pair of pairs) paintContact(pair, contact);
  painter.end(room());
  rulers();
  if (now.arrows) pairs.forEach((pair) => (pair.states.held ? held : arrows)(pair));
  const [name, unit] = CONTACT[now.contact];
  for (const [id, on] of [["mesh", now.lines], ["forces", now.arrows], ["slice", now.cut !== ""]]) control(id).setAttribute("aria-pressed", on);
  if (pairs.length) painter.bar((data.words || contacts.length > 1 ? name : `${name} between the bodies`) + (unit ? ` [${unit}]` : ""), contact, 20);
  if (bodies.length) {
    painter.bar(label(now.field), body, view.clientHeight - 32);
    if (!data.words) painter.text(now.scale === 1 ? "displacements to scale" : `displacements drawn x ${number(now.scale)}`, view.clientWidth - 8, room()[2] - 8, "right");
  }
  if (now.probe) {
    const item = now.probe.body === undefined ? contacts[now.probe.contact] : bodies[now.probe.body], xyz = placed(item), [x, y] = painter.place(...xyz.map((own) => own[now.probe.node])).map((value) => value / painter.dense);
    painter.stroke(Array.from({length: 33}, (_, i) => [x + 7 * Math.cos((i * Math.PI) / 16), y + 7 * Math.sin((i * Math.PI) / 16)]), "#d00", 2.5);
  }
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
    for (const [name, [words, unit]] of Object.entries(CONTACT)) { const value = state(item, name)[i]; add(words, {status: STATUS, role: data.roles}[name]?.[value] ?? value, unit); }
  } else {
    for (const name of bodyNames) {
      const words = label(name), end = words.lastIndexOf(" [");
      add(words.slice(0, end), values(item, name)[i], words.slice(end + 2, -1));
    }
  }
}

function pan(x, y) {  // by so many pixels of the page
  const [right, up] = painter.axes, pixel = painter.dense / painter.scale;
  now.shift = now.shift.map((value, c) => value + (-x * right[c] + y * up[c]) * pixel);
}

function turn(about, up, closer) {
  if (flat) pan(-40 * about, 40 * up);
  else { now.angle += (about * Math.PI) / 12; now.height = Math.max(-1.5, Math.min(1.5, now.height + (up * Math.PI) / 12)); }
  now.zoom /= closer;
  draw();
}

function show(box, look = {}) {
  Object.assign(now, {box, zoom: 1, shift: [0, 0, 0], angle: -2.2, height: 0.38, ...look});
  for (const name of ["field", "clear", "arrows", "lines", "cut"]) { const own = control(name); if (own.type === "checkbox") own.checked = now[name]; else own.value = now[name]; }
  cutWords();
  draw();
}

function face(index) {  // the contact of a pair, the eye beside its normal and above
  const {box, normal} = contacts[index], plain = {field: "body", clear: true, cut: ""};
  now.focus = index;
  if (!normal || flat) return show(box ?? data.contact, plain);
  const [x, y, z] = normal.map((value) => (normal[2] < -0.01 ? -value : value));
  show(box, {...plain, ...(z > 0.8 ? {height: 0.85} : {angle: Math.atan2(y, x) + 0.55, height: Math.min(1.2, Math.asin(Math.min(1, z)) + 0.35)})});
}

const reset = () => (data.words ? show(data.box) : face(data.first));

function pick(x, y) {  // the node at a place of the picture [pixels of the page]
  const column = Math.floor(x * painter.dense), row = Math.floor(y * painter.dense), reach = Math.ceil(4 * painter.dense);
  let best = null;
  for (let b = -reach; b <= reach; b++) for (let a = -reach; a <= reach; a++) {
    if (row + b < 0 || row + b >= painter.height || column + a < 0 || column + a >= painter.width) continue;
    const number = painter.owner[(row + b) * painter.width + column + a], far = Math.hypot(a, b);
    if (number >= 0 && !(best?.far <= far)) best = {number, far};
  }
  if (!best) return null;
  const {first, cells, from, places, body, contact} = owners.findLast((one) => one.first <= best.number), k = best.number - first, away = (i) => Math.hypot(places[0][i] - column, places[1][i] - row);
  const corner = cells ? [0, 1, 2].map((c) => cells[3 * k + c]).reduce((a, b) => (away(b) < away(a) ? b : a)) : k, item = body === undefined ? contacts[contact] : bodies[body];
  return {body, contact, node: (from ? from[corner] : corner) % count(item)};
}

function listen() {  // to mouse, pen and fingers
  const fingers = new Map();
  let moved = 0;
  view.addEventListener("pointerdown", (event) => { view.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); moved = 0; });
  view.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const x = event.clientX - before.clientX, y = event.clientY - before.clientY, other = [...fingers.values()].find((one) => one.pointerId !== event.pointerId);
    moved += Math.hypot(x, y);
    fingers.set(event.pointerId, event);
    if (other) now.zoom *= Math.hypot(event.clientX - other.clientX, event.clientY - other.clientY) / (Math.hypot(before.clientX - other.clientX, before.clientY - other.clientY) || 1);
    if (flat || other || event.shiftKey || event.buttons === 2) pan(other ? x / 2 : x, other ? y / 2 : y);
    else { now.angle -= x / 150; now.height = Math.max(-1.5, Math.min(1.5, now.height + y / 150)); }
    requestDraw();
  });
  for (const name of ["pointerup", "pointercancel"]) view.addEventListener(name, (event) => {
    if (fingers.delete(event.pointerId) && name === "pointerup" && moved < 4) { const found = pick(event.offsetX, event.offsetY); if (found) { probe(found); draw(); } }
  });
  view.addEventListener("contextmenu", (event) => event.preventDefault());
  view.addEventListener("wheel", (event) => {  // towards the place of the pointer
    const [x, y] = [event.offsetX - painter.middle[0] / painter.dense, event.offsetY - painter.middle[1] / painter.dense], factor = Math.exp(-event.deltaY / 600);
    pan(x * (1 / factor - 1), y * (1 / factor - 1)); now.zoom *= factor;
    event.preventDefault(); requestDraw();
  }, {passive: false});
}

let asked = false, rest = 0;
function requestDraw() {  // at once as it moves, and in full when it rests
  clearTimeout(rest);
  rest = setTimeout(draw, 150);
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => { asked = false; draw(true); });
}

function sections(pair, c) {  // a line through the largest pressure, along one of the two axes nearest to the surface
  const length = count(pair), pressure = repeated(state(pair, "pressure")), cells = numbered(whole(pair, "cells"), length), peak = pressure.reduce((best, value, i) => (value > pressure[best] ? i : best), 0), force = state(pair, "vector").subarray(3 * peak);
  const ways = [0, 1, 2].sort((a, b) => Math.abs(force[a]) - Math.abs(force[b])).slice(0, 2).sort(), [x, y] = [c, 1 - c].map((own) => placed(pair)[ways[own]]), made = {x: [], y: [], pairs: true, name: `along ${data.axes[ways[c]]}`};
  const [low, high] = span([y]), level = y[peak] + 1e-4 * (y[peak] > (low + high) / 2 ? low - high : high - low);  // beside the nodes
  for (let t = 0; t < cells.length; t += 3) {
    const corners = [...cells.slice(t, t + 3)];
    if (corners.some((node) => pressure[node] > 1e-3 * pressure[peak])) corners.forEach((a, k) => {
      const b = corners[(k + 1) % 3], share = (level - y[a]) / (y[b] - y[a]);
      if (y[a] > level !== y[b] > level) { made.x.push(x[a] + share * (x[b] - x[a])); made.y.push(pressure[a] + share * (pressure[b] - pressure[a])); }
    });
  }
  return made;
}

function drawContact() {
  const box = control("contact-chart"), pair = contacts[Number(control("pair").value) || 0];
  if (!pair) return;
  if (!flat) {
    chart(box, [0, 1].map((c) => ({...sections(pair, c), ink: [COLOURS.green, COLOURS.orange][c]})), `place on the line [${LENGTH}]`, `pressure on lines through its largest value [${STRESS}]`);
    return;
  }
  const order = [...pair.place.keys()].sort((a, b) => pair.place[a] - pair.place[b]), sorted = (values) => order.map((i) => values[i]), x = sorted(pair.place);
  const status = sorted(state(pair, "status")), bound = sorted(state(pair, "bound")), choose = (i) => { probe({contact: contacts.indexOf(pair), node: order[i]}); draw(); };
  const series = (name, y, ink, fills) => ({name, x, y, ink, pick: choose, dots: fills && ((i) => ({words: `${number(x[i])} ${LENGTH}: ${number(y[i])} ${STRESS}, ${STATUS[status[i]]}`, ...fills[status[i]]}))});
  chart(box, [
    series("pressure", sorted(state(pair, "pressure")), COLOURS.green, [{r: 2}, {r: 2}, {r: 2}]),
    {...series("friction bound", bound, COLOURS.grey), dash: true},
    {...series("", bound.map((value) => -value), COLOURS.grey), dash: true},
    series("tangential traction (full: stick, hollow: slip)", sorted(state(pair, "along")), COLOURS.blue, [{r: 1.5}, {r: 3}, {r: 3, fill: "#fff", stroke: COLOURS.orange}]),
  ], `place on the surface [${LENGTH}]`, `traction [${STRESS}]`);
}

const columnLabel = (name) => data.columns[name] ?? name;

function drawPath() {
  if (!data.history) return;
  const h = data.history, i = now.state, [a, b] = [control("across").value, control("upward").value], steps = h[b].map((_, k) => k + 1), x = a === "state" ? steps : h[a];
  const choose = (k) => { control("state").value = k; control("state").dispatchEvent(new Event("input")); };
  chart(control("path-chart"), [
    {name: "", x: [x[i]], y: [h[b][i]], ink: COLOURS.orange, dots: () => ({r: 6, words: `state ${i + 1}`})},
    {name: "", x, y: h[b], ink: COLOURS.blue, pick: choose, dots: (k) => ({words: `state ${k + 1}: ${number(x[k])}, ${number(h[b][k])}`})},
  ], columnLabel(a), columnLabel(b));
}

function stateWords() {
  if (!data.history) return;
  const h = data.history, i = now.state, facts = [["stick_nodes", "contacts stick"], ["slip_nodes", "slip"]].filter(([name]) => h[name]).map(([name, words]) => `${h[name][i]} ${words}`).join(", ");
  control("state-words").textContent = `state ${i + 1} of ${data.states}` + (facts ? `: ${facts}` : "");
}

function everything() { draw(); if (charted) { drawContact(); drawPath(); } }

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
  box.checked = item.shown;
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
knife.addEventListener("input", () => { now.place = Number(knife.value); cutWords(); requestDraw(); });
cutWords();
const slider = control("scale");
slider.max = data.most_scale; slider.step = data.most_scale / 100; slider.value = data.scale;
const times = () => { control("scale-words").textContent = `displacements x ${number(now.scale)}`; };
slider.addEventListener("input", () => { now.scale = Number(slider.value); times(); requestDraw(); });
times();
if (data.history) {
  const columns = Object.keys(data.history), h = data.history, moves = (name) => h[name] && Math.max(...h[name]) - Math.min(...h[name]) > 1e-6 * (Math.max(...(h.approach || [1])) - Math.min(...(h.approach || [0])));
  const force = (name) => columns.find((own) => own.startsWith(name)), [across, upward] = moves("shift") ? ["shift", force("shear_force")] : h.approach && force("normal_force") ? ["approach", force("normal_force")] : ["state", columns[0]];
  for (const [id, chosen] of [["across", across], ["upward", upward]]) choices(id, [...(id === "across" ? [["state", "state"]] : []), ...columns.map((name) => [name, columnLabel(name)])], chosen, () => {});
  const steps = control("state");
  steps.max = data.states - 1; steps.value = now.state;
  steps.addEventListener("input", () => { now.state = Number(steps.value); stateWords(); requestDraw(); if (charted) { drawContact(); drawPath(); } if (now.probe) probe(now.probe); });
} else control("path").hidden = control("states").hidden = true;
if (!bodies.length) control("body-controls").hidden = true;
const flip = (name) => { control(name).checked = now[name] = !now[name]; draw(); }, places = contacts.flatMap((pair, i) => (pair.box ? [i] : []));
const PRESSED = {
  near: ["c", () => (data.words ? show(data.contact) : face(now.focus))], next: ["n", () => face(places[(places.indexOf(now.focus) + 1) % places.length])],
  home: ["b", () => show(data.box, data.words ? {} : {field: "von_mises", clear: false})], mesh: ["w", () => flip("lines")], forces: ["f", () => flip("arrows")],
  slice: ["x", () => { const ways = ["", ...data.axes.keys()].map(String), own = control("cut"); own.value = ways[(ways.indexOf(String(now.cut)) + 1) % ways.length]; own.dispatchEvent(new Event("change")); }], reset: ["r", reset],
};
for (const [id, [key, act]] of Object.entries(PRESSED)) {
  control(id).addEventListener("click", act);
  document.addEventListener("keydown", (event) => { if (event.key === key && !event.ctrlKey && !event.metaKey && !/INPUT|SELECT/.test(event.target.tagName)) act(); });
}
control("next").hidden = flat || places.length < 2;
control("slice").hidden = flat || !bodies.length;
const KEYS = {ArrowLeft: [-1, 0, 1], ArrowRight: [1, 0, 1], ArrowUp: [0, 1, 1], ArrowDown: [0, -1, 1], "+": [0, 0, 0.8], "=": [0, 0, 0.8], "-": [0, 0, 1.25]};
view.addEventListener("keydown", (event) => { if (KEYS[event.key]) { turn(...KEYS[event.key]); event.preventDefault(); } });
const seek = (id, list, of, kind) => control(id).addEventListener("click", () => {  // the largest of some values at all nodes
  let best = -Infinity;
  list.forEach((item, index) => item.shown && of(item).forEach((value, node) => { if (value > best) { best = value; now.probe = {[kind]: index, node}; } }));
  probe(now.probe); draw();
});
seek("largest", bodies, (body) => values(body, now.field === "body" ? "von_mises" : now.field), "body");
seek("peak", contacts, (pair) => state(pair, "pressure"), "contact");
listen();
control("pair-control").hidden = contacts.length < 2;
stateWords();
reset();
performance.mark("drawn");
new ResizeObserver(() => { if (!painter.fits()) requestDraw(); }).observe(view);  // it also calls at once
for (const id of ["charts", "scale-control", "most"]) control(id).hidden = Boolean(data.words);
if (data.words) return;
await new Promise((then) => requestAnimationFrame(() => setTimeout(then)));  // first the picture
charted = true;
drawContact();
drawPath();
performance.mark("charted");
