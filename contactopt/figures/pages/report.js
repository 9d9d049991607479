const data = JSON.parse(await unsqueezed("data"));
const get = (id) => document.getElementById(id);
const GREY = "#bbbbbb", SHIFT = 1e-3, BINS = 6, MOST = 500;  // seconds; groups of a tag; rows of a table at a time
const runs = data.points.map((row) => ({...Object.fromEntries(data.columns.map((name, i) => [name, row[i]])), method: data.methods[row[1]], problem: data.problems[row[0]].name}));
const short = (value) => typeof value === "boolean" ? (value ? "yes" : "no") : typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(3))) : String(value ?? "-");
const plainly = (value) => typeof value === "number" ? value.toExponential(0) : value;
const index = () => data.accuracies.findIndex((value) => String(value) === get("accuracy").value);
const KEYS = Object.keys(Object.assign({}, ...data.problems.map((one) => one.tags))).filter((key) => {
  const values = new Set(data.problems.map((one) => one.tags[key]));
  return values.size > 1 && values.size < 40 && (key === "dim" || [...values].every((value) => typeof value !== "number"));
});
const ours = new Set(data.ours);
let ranks = {};

function ranked() {  // the methods that take some of the chosen problems, compared on those that all of them take
  const seconds = data.times[index()], all = data.problems.map((_, p) => p);
  const chosen = all.filter((p) => KEYS.every((key) => !get(`by-${key}`).value || String(data.problems[p].tags[key]) === get(`by-${key}`).value));
  const entrants = data.methods.map((_, m) => m).filter((m) => chosen.some((p) => data.takes[p][m]));
  const compared = chosen.filter((p) => entrants.every((m) => data.takes[p][m])), solvable = compared.filter((p) => entrants.some((m) => seconds[p][m] !== null));
  const logs = entrants.map((m) => solvable.map((p) => Math.log((seconds[p][m] ?? data.limits[p]) + SHIFT)));
  const order = (means) => means.map((mean) => 1 + means.filter((other) => other < mean).length);
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const means = logs.map(mean), first = order(means), drawn = entrants.map(() => []);
  let seed = 1;
  const next = () => (seed = (seed * 16807) % 2147483647) / 2147483647;  // Park and Miller
  for (let k = 0; k < data.resamples && solvable.length; k++) {
    const at = solvable.map(() => Math.floor(next() * solvable.length));
    order(logs.map((own) => mean(at.map((i) => own[i])))).forEach((rank, i) => drawn[i].push(rank));
  }
  const rows = entrants.map((m, i) => {
    const own = runs.filter((run) => run.method === data.methods[m] && compared.includes(run["problem number"]));
    const middle = (values) => values.filter(Number.isFinite).sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? null, spread = drawn[i].sort((a, b) => a - b);
    return {
      method: data.methods[m], m, rank: first[i], interval: spread.length ? `${spread[Math.floor(0.025 * spread.length)]} to ${spread[Math.ceil(0.975 * spread.length) - 1]}` : "-",
      solved: solvable.filter((p) => seconds[p][m] !== null).length, of: solvable.length, takes: `${chosen.filter((p) => data.takes[p][m]).length} of ${chosen.length}`, mean: Math.exp(means[i]) - SHIFT,
      over: Math.exp(means[i]) - SHIFT, bridge: middle(own.map((run) => run.bridge ?? NaN)), memory: Math.max(...own.map((run) => run.memory ?? 0)), claim: middle(own.filter((run) => run.claimed && run.residual !== null).map((run) => run.residual / run.tolerance)),
    };
  }).sort((a, b) => a.rank - b.rank);
  const least = Math.min(...rows.map((row) => row.mean));
  for (const row of rows) row.over = row.mean / least;
  return {rows, chosen, solvable};
}

function look(method) {  // the first external solvers have colours, the first methods of this project are dashed
  const own = ours.has(method), place = ranks.rows.filter((row) => ours.has(row.method) === own).findIndex((row) => row.method === method);
  const ink = place < 0 ? GREY : own ? ["#000000", "#666666"][place] ?? GREY : data.colours[place] ?? GREY;
  return {name: method, ink, dash: own && ink !== GREY, wide: ink === GREY ? 1 : 2, quiet: ink === GREY};
}

const RUN = [["method", "method", "solver"], ["asked", "tolerance"], ["certificate", "residual"], ["claimed", "claimed"], ["status", "status"], ["CPU [s]", "cpu"], ["lower quartile", "low"], ["upper quartile", "high"], ["wall [s]", "wall"], ["bridge [s]", "bridge"], ["memory [MB]", "memory"], ["repeats", "repeats"]];
const LOGS = {x: "log", y: "log"};

function link(kind, name) {
  const made = element("a", name, {href: `#${kind}=${encodeURIComponent(name)}`});
  return made;
}

function table(id, columns, rows) {  // columns: [title, key, kind of link]
  const head = element("tr"), body = get(id).tBodies[0];
  const fill = (shown) => {
    body.replaceChildren();
    for (const row of shown.slice(0, MOST)) {
      const line = element("tr");
      for (const [, key, kind] of columns) {
        const cell = element("td", kind ? "" : short(row[key]));
        if (kind) cell.append(link(kind, row[key]));
        line.append(cell);
      }
      body.append(line);
    }
  };
  let falling = false, sorted = null;
  for (const [title, key, , what] of columns) {
    const cell = element("th", "", {scope: "col", title: what ?? ""}), button = element("button", title, {type: "button"});
    button.addEventListener("click", () => {
      falling = sorted === key && !falling; sorted = key;
      [...head.children].forEach((other) => other.removeAttribute("aria-sort"));
      cell.setAttribute("aria-sort", falling ? "descending" : "ascending");
      const gone = (value) => value === null || value === undefined;
      fill([...rows].sort((a, b) => gone(a[key]) || gone(b[key]) ? gone(a[key]) - gone(b[key]) : (a[key] < b[key] ? -1 : a[key] > b[key] ? 1 : 0) * (falling ? -1 : 1)));
    });
    cell.append(button); head.append(cell);
  }
  get(id).tHead.replaceChildren(head);
  fill(rows);
}

function drawLeaders() {
  ranks = ranked();
  const {rows, chosen, solvable} = ranks, times = data.times[index()];
  table("leaders", [
    ...(data.busy ? [] : [["rank", "rank"], ["95 %", "interval", "", "ranks that resampling the problems leaves likely"]]), ["method", "method", "solver"], ["solved", "solved"], ["of", "of"],
    ["takes", "takes", "", "problems that the method does not refuse; it is compared on those that all methods take"], ["CPU [s]", "mean", "", "shifted geometric mean, 1 ms; a failure counts as the time limit"],
    ["over the least", "over"], ["bridge [s]", "bridge", "", "median time to bring the problem to an external solver and back, not counted"], ["memory [MB]", "memory", "", "most that a run added"], ["certificate / asked", "claim", "", "median over claimed successes"],
  ], rows);
  const best = solvable.map((p) => Math.min(...rows.map(({m}) => times[p][m] ?? Infinity)));
  const most = Math.max(2, ...solvable.flatMap((p, i) => rows.map(({m}) => (times[p][m] ?? 0) / best[i])));
  chart(get("profile"), rows.map(({method, m}) => {
    const ratios = solvable.map((p, i) => (times[p][m] ?? Infinity) / best[i]).filter(Number.isFinite).sort((a, b) => a - b);
    return {...look(method), steps: true, x: [1, ...ratios, most], y: [0, ...ratios.map((_, i) => (i + 1) / solvable.length), ratios.length / solvable.length]};
  }), "CPU time over the best method's [-]", "share of the problems solved", {x: "log", y: "share"});
  for (const key of ["mu", "condition"]) chart(get(`over-${key}`), rows.filter(({method}) => !look(method).quiet).map(({method, m}) => {
    const known = chosen.filter((p) => data.takes[p][m] && data.problems[p].tags[key] > 0).sort((a, b) => data.problems[a].tags[key] - data.problems[b].tags[key]);
    const bins = Array.from({length: BINS}, (_, i) => known.slice(Math.floor((i * known.length) / BINS), Math.floor(((i + 1) * known.length) / BINS))).filter((bin) => bin.length);
    return {...look(method), x: bins.map((bin) => data.problems[bin[Math.floor(bin.length / 2)]].tags[key]), y: bins.map((bin) => bin.filter((p) => times[p][m] !== null).length / bin.length)};
  }), {mu: "friction coefficient [-]", condition: "condition number of Q [-]"}[key], "share of the problems solved", {x: "log", y: "share"});
  const families = [...new Set(chosen.map((p) => data.problems[p].tags.family))];
  table("families", [["method", "method", "solver"], ...families.map((family) => [family, family])], rows.map(({method, m}) => ({method, ...Object.fromEntries(families.map((family) => {
    const own = chosen.filter((p) => data.problems[p].tags.family === family && data.takes[p][m]);
    return [family, own.length ? `${own.filter((p) => times[p][m] !== null).length} of ${own.length}` : ""];
  }))})));
}

function drawSolver(name) {
  const m = data.methods.indexOf(name), times = data.times[index()];
  if (m < 0) return;
  get("choose-solver").value = name;
  const rows = ranks.chosen.map((p) => {
    const peers = data.methods.map((_, i) => i).filter((i) => i !== m && !ours.has(data.methods[i]) && times[p][i] !== null).sort((a, b) => times[p][a] - times[p][b]), known = times[p].filter((t) => t !== null), best = known.length ? Math.min(...known) : null;
    return {problem: data.problems[p].name, seconds: times[p][m], best, ratio: times[p][m] === null ? null : times[p][m] / best, by: best === null ? "" : data.methods[times[p].indexOf(best)], peer: peers.length ? times[p][peers[0]] : null};
  });
  const both = rows.filter((row) => row.seconds !== null && row.peer !== null), ends = [Math.min, Math.max].map((end) => end(...both.flatMap((row) => [row.seconds, row.peer])));
  const dotted = (shown, words) => ({ink: "none", dots: (i) => ({fill: data.colours[0], words: words(shown[i])})});
  chart(get("against"), both.length ? [{ink: GREY, x: ends, y: ends}, {...dotted(both, (row) => row.problem), x: both.map((row) => row.peer), y: both.map((row) => row.seconds)}] : [], "CPU time of the best other external solver [s]", "CPU time [s]", LOGS);
  const own = runs.filter((run) => run.method === name && run.repeats > 1 && run.low > 0 && ranks.chosen.includes(run["problem number"]));
  chart(get("spread"), own.length ? [{...dotted(own, (run) => `${run.problem}, ${run.tolerance}`), x: own.map((run) => run.cpu), y: own.map((run) => run.high / run.low)}] : [], "CPU time, median of the repeats [s]", "upper over lower quartile [-]", LOGS);
  table("of-solver", [["problem", "problem", "problem"], ["CPU [s]", "seconds"], ["best [s]", "best"], ["over the best", "ratio"], ["best method", "by", "solver"]], rows);
}

function drawProblem(name) {
  const p = data.problems.findIndex((problem) => problem.name === name), own = runs.filter((run) => run.problem === name);
  if (p < 0) return;
  get("choose-problem").value = name;
  get("tags").textContent = Object.entries(data.problems[p].tags).map(([key, value]) => `${key} ${short(value)}`).join(", ");
  const named = data.order.filter((method) => own.some((run) => run.method === method));
  chart(get("speed"), named.map((method) => { const same = own.filter((run) => run.method === method); return {...look(method), x: same.map((run) => run.cpu), y: same.map((run) => run.residual ?? 0), dots: (i) => ({...(same[i].residual <= same[i].tolerance && same[i].status === "solved" ? {} : {fill: "white", stroke: look(method).ink}), words: `${method}: ${short(same[i].residual)} after ${short(same[i].cpu)} s, asked ${same[i].tolerance}`})}; }), "CPU time [s]", "certificate [-]", LOGS);
  chart(get("convergence"), data.histories.filter((one) => one[0] === p).map((one) => ({...look(data.methods[one[1]]), x: one[3], y: one[2]})), "time [s]", "certificate [-]", LOGS);
  table("of-problem", RUN, own);
}

function drawRuns() {
  const words = get("words").value.toLowerCase();
  const shown = runs.filter((run) => ["method", "status", "tolerance"].every((name) => !get(`filter-${name}`).value || String(run[name]) === get(`filter-${name}`).value) && (!words || `${run.problem} ${run.method}`.toLowerCase().includes(words)));
  get("count").textContent = `${shown.length} of ${runs.length} runs, each with its repeats` + (shown.length > MOST ? `; the first ${MOST} are shown` : "");
  table("runs", [["problem", "problem", "problem"], ...RUN], shown);
}

function options(id, values, draw, first = null) {
  if (first !== null) get(id).append(element("option", first, {value: ""}));
  for (const value of values) get(id).append(element("option", plainly(value), {value: String(value)}));
  get(id).addEventListener("change", draw);
}

function follow() {
  const [kind, name] = decodeURIComponent(location.hash.slice(1)).split(/=(.*)/s);
  if (kind === "solver") drawSolver(name);
  if (kind === "problem") drawProblem(name);
  if (name && get(kind)) get(kind).scrollIntoView();
}

const everything = () => { drawLeaders(); drawSolver(get("choose-solver").value); drawProblem(get("choose-problem").value); };
for (const key of KEYS) {
  const made = element("label", `${key} `, {class: "inline"});
  made.append(element("select", "", {id: `by-${key}`}));
  get("filters").append(made);
  options(`by-${key}`, [...new Set(data.problems.map((one) => one.tags[key]))].filter((value) => value !== undefined && value !== null).sort(), everything, "all");
}
options("accuracy", data.accuracies, everything);
get("accuracy").value = String(data.accuracies[Math.floor(data.accuracies.length / 2)]);
options("choose-solver", data.order, () => { location.hash = `solver=${encodeURIComponent(get("choose-solver").value)}`; });
options("choose-problem", data.problems.map((problem) => problem.name), () => { location.hash = `problem=${encodeURIComponent(get("choose-problem").value)}`; });
for (const name of ["method", "status", "tolerance"]) options(`filter-${name}`, [...new Set(runs.map((run) => run[name]))].sort(), drawRuns, "all");
get("words").addEventListener("input", drawRuns);
window.addEventListener("hashchange", follow);
if (data.busy) { get("warning").hidden = false; get("warning").textContent = data.busy; }
get("protocol").textContent = data.protocol;
table("cards", Object.keys(data.cards[0]).map((name) => [name, name]), data.cards);
for (const [method, why] of data.absent) get("absent").append(element("li", `${method} was not there: ${why}`));
everything(); drawRuns(); follow();
