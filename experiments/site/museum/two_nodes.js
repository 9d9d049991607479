const NEAR = 0.3, MOST = 6;
function compliance({ own, cross }) {
  return [
    [1, own, NEAR, cross], [own, 1, -cross, NEAR],
    [NEAR, -cross, 1, own], [cross, NEAR, own, 1],
  ];
}
const problemOf = (p) => ({ Q: compliance(p), q: [p.q_n, p.q_t1, p.q_n, p.q_t2], mu: p.mu });
const named = (states) => states.map((s) => STATES[s]).join(", ");

/* The determinant of a combination of states as a polynomial [constant, linear, quadratic] in mu. */
function determinant(Q, states) {
  const [c, plus, minus] = [0, 1, -1].map((mu) => eliminate(system({ Q, q: [0, 0, 0, 0], mu }, states)[0], [0, 0, 0, 0]).det);
  return [c, (plus - minus) / 2, (plus + minus) / 2 - c];
}

/* The smallest mu > 0 at which the polynomial is zero. */
function firstRoot([c, b, a]) {
  const d = b * b - 4 * a * c, s = b + (b < 0 ? -1 : 1) * Math.sqrt(d);
  const roots = d < 0 ? [] : [(-2 * c) / s, -s / (2 * a)].filter((root) => root > 1e-9 && root < 1e9);
  return Math.min(Infinity, ...roots);
}

const room = {
  sliders: {
    mu: ["Friction coefficient μ [-]", 0, MOST, 0.001, 1],
    own: ["Coupling n-t within a node [mm/N]", -0.45, 0.45, 0.001, 0.3],
    cross: ["Coupling n-t between the nodes [mm/N]", -0.45, 0.45, 0.001, 0.2],
    q_n: ["Gap without forces, both nodes [mm]", -2, 2, 0.001, 0.1],
    q_t1: ["Pull on node 1 to the right [mm]", -2, 2, 0.001, 1],
    q_t2: ["Pull on node 2 to the right [mm]", -2, 2, 0.001, 0.8],
  },
  breaks: [
    ["Three solutions", { mu: 6, own: 0.3, cross: 0.2, q_n: 0.1, q_t1: 1, q_t2: 0.8 }],
    ["Nine solutions", { mu: 6, own: 0.45, cross: 0, q_n: 0.1, q_t1: 1, q_t2: 1 }],
  ],
  answers(p) {
    const Q = compliance(p), found = solutions(problemOf(p));
    const roots = combinations(2).map((states) => [firstRoot(determinant(Q, states)), states]);
    const [least, folds] = roots.reduce((best, one) => (one[0] < best[0] ? one : best), [Infinity, null]);
    return {
      forces: found.map((one) => one.r),
      states: found.map((one) => named(one.states)),
      threshold: folds ? least : null,
      folds: folds ? named(folds) : null,
    };
  },
  show(p, a) {
    const problem = problemOf(p), level = a.threshold ?? Infinity;
    const place = Math.abs(p.mu / level - 1) < 1e-9 ? "at" : p.mu < level ? "below" : "above";
    const sweep = range(121).flatMap((i) => solutions({ ...problem, mu: (i * MOST) / 120 }).map((one) => [(i * MOST) / 120, one.r[0]]));
    const y = limits([0, ...sweep.map(([, r]) => Math.min(r, 12)), ...a.forces.map((r) => Math.min(r[0], 12))]);
    const line = { line: [[level, -99], [level, 99]], kind: "thin" };
    const left = plot(
      { x: [0, MOST], y, xlabel: "coefficient μ [-]", ylabel: "normal force of node 1 [N]", alt: `Normal force of node 1 in all solutions. At the chosen μ: ${a.forces.map((r) => show(r[0])).join(", ")} N.` },
      [...sweep.map(([mu, r]) => ({ line: [[mu - 0.02, r], [mu + 0.02, r]], kind: "one" })), line, ...a.forces.map((r) => ({ dot: [p.mu, r[0]], kind: "two" }))],
    );
    const curves = combinations(2).map((states) => {
      const [c, b, d] = determinant(problem.Q, states);
      return { line: range(61).map((i) => [i / 10, 1 + (b / c) * (i / 10) + (d / c) * (i / 10) ** 2]), kind: named(states) === a.folds ? "two" : "ink" };
    });
    const right = plot(
      { x: [0, MOST], y: [-1, 3], xlabel: "coefficient μ [-]", ylabel: "determinant, 1 at μ = 0", alt: `The determinants of all 16 combinations of states. The first one that becomes zero is that of ${a.folds}, at ${show(level)}.` },
      [...curves, { line: [[0, 0], [MOST, 0]], kind: "thin" }, line],
    );
    return {
      verdict: `${counted(problem, a.forces.map((r) => ({ r })))} for this load. μ is ${place} the threshold μ* = ${show(level)}: ` + (place === "below" ? "every load has exactly one." : "some load has more than one."),
      fails: place !== "below",
      figures: [
        [left, [["one", "all solutions"], ["two", "at your μ"], ["thin", "μ*"]]],
        [right, [["ink", "16 determinants"], ["two", a.folds ? `first zero: ${a.folds}` : "no zero"], ["thin", "zero and μ*"]]],
      ],
      rows: a.forces.map((r, i) => [`${i + 1}: ${a.states[i]}`, `rₙ = ${show(r[0], 3)}, ${show(r[2], 3)} N`]),
    };
  },
};
