const NEAR = 0.3;
function compliance({ own, cross }) {
  return [
    [1, own, NEAR, cross], [own, 1, -cross, NEAR],
    [NEAR, -cross, 1, own], [cross, NEAR, own, 1],
  ];
}
const problemOf = (p) => ({ Q: compliance(p), q: [p.q_n, p.q_t1, p.q_n, p.q_t2], mu: p.mu });

/* The smallest mu > 0 at which a determinant vanishes; each is a polynomial of degree two at most,
   known from three values. */
function thresholdOf(Q) {
  let least = Infinity;
  for (const states of combinations(2)) {
    const at = (mu) => eliminate(system({ Q, q: [0, 0, 0, 0], mu, V: Q.map(() => []), s: [] }, states)[0], [0, 0, 0, 0]).det;
    const [c, plus, minus] = [at(0), at(1), at(-1)];
    const b = (plus - minus) / 2, a = (plus + minus) / 2 - c, d = b * b - 4 * a * c;
    if (d < 0) continue;
    const s = b + (b < 0 ? -1 : 1) * Math.sqrt(d);
    for (const root of [(-2 * c) / s, -s / (2 * a)]) if (root > 1e-9 && root < 1e9) least = Math.min(least, root);
  }
  return least === Infinity ? null : least;
}

const room = {
  sliders: {
    mu: ["Friction coefficient μ [-]", 0, 6, 0.001, 1],
    own: ["Coupling of a node with itself, Qₙₜ [mm/N]", -0.45, 0.45, 0.001, 0.3],
    cross: ["Coupling across the nodes, Qₙₜ [mm/N]", -0.45, 0.45, 0.001, 0.2],
    q_n: ["Load qₙ of both nodes [mm]", -2, 2, 0.001, 0.1],
    q_t1: ["Load qₜ of node 1 [mm]", -2, 2, 0.001, 1],
    q_t2: ["Load qₜ of node 2 [mm]", -2, 2, 0.001, 0.8],
  },
  breaks: [
    ["Nine solutions", { mu: 6, own: 0.45, cross: 0, q_n: 0.1, q_t1: 1, q_t2: 1 }],
    ["Three solutions", { mu: 6, own: 0.3, cross: 0.2, q_n: 0.1, q_t1: 1, q_t2: 0.8 }],
  ],
  answers(p) {
    const found = solutions(problemOf(p));
    return { forces: found.map((one) => one.r), states: found.map((one) => one.states.map((s) => STATES[s]).join(" and ")), threshold: thresholdOf(compliance(p)) };
  },
  show(p, a) {
    const k = a.forces.length, below = a.threshold === null || p.mu < a.threshold;
    const sweep = range(121).flatMap((i) => solutions(problemOf({ ...p, mu: i / 20 })).map((one) => [i / 20, one.r]));
    const y = limits([0, ...sweep.map(([, r]) => r[0]), ...sweep.map(([, r]) => r[2])].map((x) => Math.min(x, 12)));
    const figure = (i) => plot(
      { x: [0, 6], y, xlabel: "friction coefficient μ [-]", ylabel: `normal force of node ${i + 1} [N]`, alt: `Normal force of node ${i + 1} in all solutions, for friction coefficients from 0 to 6. At the chosen one: ${a.forces.map((r) => show(r[2 * i])).join(", ")} N.` },
      [
        ...sweep.map(([mu, r]) => ({ line: [[mu - 0.02, r[2 * i]], [mu + 0.02, r[2 * i]]], kind: "one" })),
        ...(a.threshold ? [{ line: [[a.threshold, -99], [a.threshold, 99]], kind: "thin" }] : []),
        ...a.forces.map((r) => ({ dot: [p.mu, r[2 * i]], kind: "two" })),
      ],
    );
    const key = [["one", "all solutions"], ["thin", "threshold μ*"], ["two", "at the chosen μ"]];
    return {
      verdict: `${k} solution${k === 1 ? "" : "s"} of this load. ` + (below ? "The hypothesis holds: μ is below μ*." : "The hypothesis is broken: μ is above μ*."),
      fails: !below,
      figures: [[figure(0), key], [figure(1), key]],
      rows: [
        ["Threshold μ*", show(a.threshold ?? Infinity)],
        ...a.forces.map((r, i) => [`Solution ${i + 1}, ${a.states[i]}: normal forces [N]`, `${show(r[0])}, ${show(r[2])}`]),
      ],
    };
  },
};
