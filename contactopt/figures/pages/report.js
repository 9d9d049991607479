await plotly();
const data = JSON.parse(document.getElementById("data").textContent);
const names = Object.keys(data.columns);
const MARKS = ["circle", "square", "diamond", "triangle-up", "triangle-down", "pentagon", "x", "star", "triangle-left", "triangle-right", "hexagon", "cross", "hexagram", "bowtie", "hourglass", "star-diamond"];
const WORDS = {cpu_seconds: "CPU time of the call [s]", solve_seconds: "time of the method [s]", call_seconds: "time of the call [s]"};
const MOST = 500;  // rows of the table at a time
const FLOOR = 0.01;  // of the tolerance, below which a residual answers no question
const get = (id) => document.getElementById(id);
const methods = [...new Set(data.rows.map((row) => row.method))].sort();
const look = (method) => { const i = methods.indexOf(method); return {color: data.colours[i % data.colours.length], symbol: MARKS[i % MARKS.length], dash: i % 16 < 8 ? "solid" : "dash"}; };
data.rows.forEach((row, i) => { row.number = i; });
let sorted = "problem", falling = false, chosen = [];

const median = (values) => { const s = [...values].sort((a, b) => a - b), n = s.length; return n ? (s[(n - 1) >> 1] + s[n >> 1]) / 2 : NaN; };

function grouped(rows, key) {
  const made = new Map();
  for (const row of rows) { const name = key(row); if (!made.has(name)) made.set(name, []); made.get(name).push(row); }
  return made;
}

function filtered() {
  const words = get("words").value.toLowerCase();
  return data.rows.filter((row) => ["setting", "start", "family", "method", "status"].every((name) => !get(`filter-${name}`).value || String(row[name]) === get(`filter-${name}`).value)
    && (!words || `${row.problem} ${row.method} ${row.message}`.toLowerCase().includes(words)));
}

function chart(id, traces, x, y) {
  const layout = {
    margin: {l: 65, r: 15, t: 32, b: 50}, hovermode: "closest", showlegend: true, legend: {orientation: "h", y: get(id).clientHeight < 350 ? -0.5 : -0.22, yanchor: "top", font: {size: 11}}, uirevision: "kept",
    xaxis: {title: {text: x.title}, type: x.type, exponentformat: "power", nticks: 6, range: x.range}, yaxis: {title: {text: y.title}, type: y.type, exponentformat: "power", range: y.range},
  };
  Plotly.react(get(id), traces, layout, {responsive: true, displaylogo: false});
}

const type = (axis) => (get(`log-${axis}`).checked ? "log" : "linear");

function drawSpeed(rows, time) {
  const traces = [];
  for (const [method, own] of grouped(rows.filter((row) => row.residual !== null && row.law === "coulomb"), (row) => row.method)) {
    const points = [...grouped(own, (row) => row.tolerance)].sort((a, b) => b[0] - a[0]).map(([tolerance, same]) => ({
      x: median(same.map((row) => row[time])), y: median(same.map((row) => Math.max(row.residual, FLOOR * tolerance))),
      good: same.filter((row) => row.success).length / same.length, text: `${same.length} runs to ${tolerance.toExponential(0)}`,
    }));
    const style = look(method);
    traces.push({
      type: "scatter", mode: "lines+markers", name: plain(method), x: points.map((p) => p.x), y: points.map((p) => p.y), text: points.map((p) => `${p.text}, ${Math.round(100 * p.good)} % kept it`),
      line: {color: style.color, dash: style.dash}, marker: {size: 9, symbol: points.map((p) => style.symbol + (p.good >= 0.5 ? "" : "-open")), color: style.color},
      hovertemplate: "%{text}<br>%{x:.3g} s, residual %{y:.2g}<extra>%{fullData.name}</extra>",
    });
  }
  chart("speed", traces, {title: `${WORDS[time]}, median`, type: type("x")}, {title: "certified residual [-], median", type: type("y")});
}

function drawProfile(rows, time) {
  const instances = grouped(rows.filter((row) => row.law === "coulomb"), (row) => `${row.problem}|${row.setting}|${row.start}`), ratios = new Map();
  for (const same of instances.values()) {
    const times = [...grouped(same, (row) => row.method)].map(([method, own]) => [method, own.every((row) => row.success) ? median(own.map((row) => row[time])) : Infinity]);
    const best = Math.min(...times.map(([, value]) => value));
    for (const [method, value] of times) {
      if (!ratios.has(method)) ratios.set(method, []);
      if (Number.isFinite(value)) ratios.get(method).push(best > 0 ? value / best : 1);
    }
  }
  const largest = 1.3 * Math.max(2, ...[...ratios.values()].flat());
  const traces = [...ratios].map(([method, found]) => {
    const x = [...found].sort((a, b) => a - b), style = look(method);
    return {
      type: "scatter", mode: "lines", name: plain(`${method} (${x.length})`), x: [1, ...x, largest], y: [0, ...x.map((_, i) => (i + 1) / instances.size), x.length / instances.size],
      line: {shape: "hv", color: style.color, dash: style.dash}, hovertemplate: "%{y:.0%} within %{x:.3g} times the best<extra>%{fullData.name}</extra>",
    };
  });
  const log = type("x") === "log";
  chart("profile", traces, {title: "ratio: time / the best method's [-]", type: type("x"), range: log ? [0, Math.log10(largest)] : [1, largest]},
    {title: `share of ${instances.size} instances solved`, type: "linear", range: [0, 1.03]});
}

function drawSize(rows, time) {
  const traces = [...grouped(rows.filter((row) => row.success), (row) => row.method)].map(([method, own]) => {
    const points = [...grouped(own, (row) => row.contacts)].sort((a, b) => a[0] - b[0]), style = look(method);
    return {
      type: "scatter", mode: "lines+markers", name: plain(method), x: points.map(([size]) => size), y: points.map(([, same]) => median(same.map((row) => row[time]))),
      line: {color: style.color, dash: style.dash}, marker: {symbol: style.symbol, size: 8}, hovertemplate: "%{x} contacts: %{y:.3g} s<extra>%{fullData.name}</extra>",
    };
  });
  chart("size", traces, {title: "contacts", type: type("x")}, {title: `${WORDS[time]}, median`, type: type("y")});
}

function drawConvergence() {
  const traces = chosen.map((i) => data.rows[i]).filter((row) => row.history).map((row) => ({
    type: "scatter", mode: "lines+markers", name: plain(`${row.method}, ${row.problem}, ${row.setting}, ${row.start}`), x: row.history[2], y: row.history[0], customdata: row.history[1],
    line: {color: look(row.method).color}, hovertemplate: "iteration %{x}: residual %{y:.2g} after %{customdata:.3g} s<extra>%{fullData.name}</extra>",
  }));
  chart("convergence", traces, {title: "outer iteration", type: "linear"}, {title: "natural-map residual [-]", type: type("y")});
}

function choose(number) {
  chosen = chosen.includes(number) ? chosen.filter((other) => other !== number) : [...chosen, number];
  document.querySelectorAll("#runs tbody tr").forEach((row) => row.classList.toggle("chosen", chosen.includes(Number(row.dataset.number))));
  drawConvergence();
}

function compare(a, b) {
  const x = a[sorted], y = b[sorted];
  if (x === y) return a.number - b.number;
  if (x === null || y === null) return x === null ? 1 : -1;
  return (x < y ? -1 : 1) * (falling ? -1 : 1);
}

function drawTable(rows) {
  const body = document.querySelector("#runs tbody");
  body.replaceChildren();
  for (const row of [...rows].sort(compare).slice(0, MOST)) {
    const line = element("tr", "", {tabindex: 0, "data-number": row.number});
    if (chosen.includes(row.number)) line.className = "chosen";
    for (const name of names) line.append(element("td", row[name] === null ? "" : typeof row[name] === "boolean" ? (row[name] ? "yes" : "no") : String(row[name])));
    line.addEventListener("click", () => choose(row.number));
    line.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { choose(row.number); event.preventDefault(); } });
    body.append(line);
  }
  const good = rows.filter((row) => row.success).length;
  get("count").textContent = `${rows.length} of ${data.rows.length} runs, ${good} of them kept their tolerance` + (rows.length > MOST ? `; the first ${MOST} are shown` : "");
}

function everything() {
  const rows = filtered(), time = get("time").value;
  drawSpeed(rows, time); drawProfile(rows, time); drawSize(rows, time); drawConvergence(); drawTable(rows);
}

const head = element("tr");
for (const name of names) {
  const cell = element("th", "", {scope: "col", title: data.columns[name]}), button = element("button", name.replaceAll("_", " "), {type: "button"});
  button.addEventListener("click", () => {
    falling = sorted === name && !falling;
    sorted = name;
    document.querySelectorAll("#runs th").forEach((other) => other.removeAttribute("aria-sort"));
    cell.setAttribute("aria-sort", falling ? "descending" : "ascending");
    drawTable(filtered());
  });
  cell.append(button);
  head.append(cell);
}
document.querySelector("#runs thead").append(head);
for (const name of ["setting", "start", "family", "method", "status"]) {
  for (const value of [...new Set(data.rows.map((row) => String(row[name])))].sort()) get(`filter-${name}`).append(element("option", value, {value}));
  get(`filter-${name}`).addEventListener("change", everything);
}
for (const id of ["time", "log-x", "log-y"]) get(id).addEventListener("change", everything);
get("words").addEventListener("input", everything);
get("forget").addEventListener("click", () => { chosen = []; everything(); });
everything();
