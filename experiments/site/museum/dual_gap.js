const NODES = 4, MOST = 40;
function problemOf(p) {
  const G = stringCompliance(NODES), pair = [[1, p.coupling], [p.coupling, 1]];
  const Q = range(2 * NODES).map((i) => range(2 * NODES).map((j) => G[i >> 1][j >> 1] * pair[i % 2][j % 2]));
  const q = range(2 * NODES).map((i) => {
    const x = ((i >> 1) + 1) / (NODES + 1);
    return i % 2 === 0 ? 0.02 - p.press * x * (1 - x) : p.push * x;
  });
  return { Q, q };
}

/* Forces, displacements and both values at all iterations. */
function iterate(p) {
  const { Q, q } = problemOf(p), step = p.step / largestEigenvalue(Q);
  let r = q.map(() => 0);
  const found = [];
  for (let i = 0; i <= MOST; i++) {
    const u = add(times(Q, r), q), v = u.map((x, j) => (j % 2 === 0 ? Math.max(x, 0) : x));
    const w = add(v, q, -1), friction = v.reduce((sum, x, j) => sum + (j % 2 ? p.g * Math.abs(x) : 0), 0);
    const primal = dot(w, solveLinear(Q, w)) / 2 + friction;
    const dual = -dot(r, times(Q, r)) / 2 - dot(q, r);
    found.push({ r, v, primal, dual });
    r = r.map((x, j) => {
      const y = x - step * u[j];
      return j % 2 === 0 ? Math.max(y, 0) : Math.min(p.g, Math.max(-p.g, y));
    });
  }
  return found;
}

const room = {
  sliders: {
    step: ["Step ω, in units of 1/L [-]", 0.1, 2.6, 0.01, 1],
    iterations: ["Iterations shown in numbers", 0, MOST, 1, 10],
    g: ["Friction bound g [N]", 0, 1, 0.001, 0.3],
    coupling: ["Coupling of n and t [-]", -0.8, 0.8, 0.001, 0.3],
    press: ["Press [mm]", 0, 2, 0.001, 1],
    push: ["Push [mm]", -1, 1, 0.001, 0.5],
  },
  breaks: [["Steps that are too long", { step: 2.6 }], ["Good steps", { step: 1.8 }]],
  answers(p) {
    const all = iterate(p), { r, v, primal, dual } = all[p.iterations];
    return { r, v, primal, dual, gap: primal - dual, last: all[MOST].primal - all[MOST].dual, best: Math.max(...all.map((one) => one.dual)) };
  },
  show(p, a) {
    const all = iterate(p), values = all.map((one) => [one.primal, one.dual]);
    const log = all.map((one, i) => [i, Math.log10(Math.max(one.primal - one.dual, 1e-17))]);
    const at = (k) => values.map((pair, i) => [i, pair[k]]);
    const left = plot(
      { x: [0, MOST], y: limits(values.slice(2).flat()), xlabel: "iteration", ylabel: "value [N mm]", alt: `Both values over ${MOST} iterations. At iteration ${p.iterations} the primal value is ${show(a.primal)} and the dual value ${show(a.dual)} N mm.` },
      [{ line: at(0), kind: "one" }, { line: at(1), kind: "two" }, { line: [[p.iterations, -1e9], [p.iterations, 1e9]], kind: "thin" }],
    );
    const right = plot(
      { x: [0, MOST], y: limits(log.map((pair) => pair[1])), xlabel: "iteration", ylabel: "log10 of the gap", alt: `The gap over ${MOST} iterations; at the end it is ${show(a.last)} N mm.` },
      [{ line: log, kind: "three" }, { dot: log[p.iterations], kind: "ink" }],
    );
    const short = p.step < 2, small = a.last <= 1e-3 * Math.max(Math.abs(a.best), 1e-12);
    return {
      verdict: `${short ? "The hypothesis holds: ω < 2." : "The hypothesis is broken: ω ≥ 2."} After ${MOST} iterations the gap is ${show(Math.max(a.last, 0), 3)} N mm, ${small ? "small" : "not small"} against the value ${show(a.best, 3)} N mm. It is never negative.`,
      fails: !short,
      figures: [[left, [["one", "cost of the displacement"], ["two", "minus the cost of the force"]]], [right, [["three", "gap"], ["ink", "chosen iteration"]]]],
      rows: [[`Value of the displacement, iteration ${p.iterations} [N mm]`, show(a.primal, 8)], ["Value of the force [N mm]", show(a.dual, 8)], ["Gap [N mm]", show(a.gap, 4)], ["Normal forces [N]", a.r.filter((_, i) => i % 2 === 0).map((x) => show(x)).join(", ")]],
    };
  },
};
