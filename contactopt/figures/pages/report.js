const data = JSON.parse(await unsqueezed("data"));
const get = (id) => document.getElementById(id);
const GREY = "#bbbbbb", MOST = 500;  // rows of a table at a time
const runs = data.points.map((row) => ({...Object.fromEntries(data.columns.map((name, i) => [name, row[i]])), method: data.methods[row[1]], problem: data.problems[row[0]].name}));
const short = (value) => typeof value === "boolean" ? (value ? "yes" : "no") : typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(3))) : String(value ?? "-");
const plainly = (value) => typeof value === "number" ? value.toExponential(0) : value;
const leaders = () => data.leaders.find((one) => one.group === get("group").value && String(one.accuracy) === get("accuracy").value);
const index = () => data.accuracies.findIndex((value) => String(value) === get("accuracy").value);

function colour(method) {  // the first leaders of these problems have a colour, the others are grey
  const place = leaders().rows.findIndex((row) => row.method === method);
  return place < data.colours.length ? data.colours[place] : GREY;
}

const RUN = [["method", "method", "solver"], ["asked", "tolerance"], ["certificate", "residual"], ["claimed", "claimed"], ["status", "status"], ["CPU [s]", "cpu"], ["lower quartile", "low"], ["upper quartile", "high"], ["wall [s]", "wall"], ["memory [MB]", "memory"], ["repeats", "repeats"]];
const LOGS = {x: "log", y: "log"}, look = (method) => ({name: method, ink: colour(method), wide: colour(method) === GREY ? 1.2 : 2});

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
  const chosen = leaders(), ranked = !data.busy;
  if (!chosen) return;
  table("leaders", [
    ...(ranked ? [["rank", "rank"], ["95 %", "interval", "", "ranks that resampling the problems leaves likely"]] : []), ["method", "method", "solver"], ["solved", "solved"], ["of", "of"],
    ["takes", "takes", "", "problems of this group that the method does not refuse; it is compared on those that all methods take"], ["CPU [s]", "mean", "", "shifted geometric mean, 1 ms; a failure counts as the time limit"],
    ["over the least", "over the least"], ["wall [s]", "wall mean"], ["memory [MB]", "memory", "", "most that a run added"], ["certificate / asked", "over claim", "", "median over claimed successes"],
  ], chosen.rows.map((row) => ({...row, interval: `${row.best} to ${row.worst}`, takes: `${row.taken} of ${row.problems}`})));
  const members = chosen.compared, times = data.times[index()];
  const best = members.map((p) => Math.min(...times[p].map((t) => t ?? Infinity)));
  const solvable = members.map((p, i) => [p, best[i]]).filter(([, t]) => Number.isFinite(t));
  const most = Math.max(2, ...solvable.flatMap(([p, t]) => times[p].filter((s) => s !== null).map((s) => s / t)));
  chart(get("profile"), chosen.rows.map((row) => {
    const m = data.methods.indexOf(row.method), ratios = solvable.map(([p, t]) => times[p][m] === null ? Infinity : times[p][m] / t).filter(Number.isFinite).sort((a, b) => a - b);
    return {...look(row.method), steps: true, x: [1, ...ratios, most], y: [0, ...ratios.map((_, i) => (i + 1) / solvable.length), ratios.length / solvable.length]};
  }), "CPU time over the best method's [-]", "share of the problems solved", {x: "log", y: "share"});
}

function drawSolver(name) {
  const m = data.methods.indexOf(name), times = data.times[index()];
  if (m < 0) return;
  get("choose-solver").value = name;
  table("of-solver", [["problem", "problem", "problem"], ["CPU [s]", "seconds"], ["best [s]", "best"], ["over the best", "ratio"], ["best method", "by", "solver"]], data.problems.map((problem, p) => {
    const known = times[p].filter((t) => t !== null), best = known.length ? Math.min(...known) : null;
    return {problem: problem.name, seconds: times[p][m], best, ratio: times[p][m] === null ? null : times[p][m] / best, by: best === null ? "" : data.methods[times[p].indexOf(best)]};
  }).filter((row) => leaders().problems.includes(data.problems.findIndex((problem) => problem.name === row.problem))));
}

function drawProblem(name) {
  const p = data.problems.findIndex((problem) => problem.name === name), own = runs.filter((run) => run.problem === name);
  if (p < 0) return;
  get("choose-problem").value = name;
  get("tags").textContent = Object.entries(data.problems[p].tags).map(([key, value]) => `${key} ${short(value)}`).join(", ");
  const named = data.order.filter((method) => own.some((run) => run.method === method));
  chart(get("speed"), named.map((method) => { const same = own.filter((run) => run.method === method); return {...look(method), x: same.map((run) => run.cpu), y: same.map((run) => run.residual ?? 0), dots: (i) => ({words: `${method}: ${short(same[i].residual)} after ${short(same[i].cpu)} s`})}; }), "CPU time [s]", "certificate [-]", LOGS);
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
options("group", [...new Set(data.leaders.map((one) => one.group))], everything);
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
