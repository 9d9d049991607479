const STEPS = 24, LONG = 3000;
const problemOf = (p) => ({ Q: [[1, p.coupling], [p.coupling, p.q_tt]], q: [p.q_n, p.q_t], mu: p.mu });
const trescaStep = ({ Q, q, mu }, g) => mu * trescaNode(Q, q, g)[0];
const coneStep = ({ Q, q, mu }, sigma) => Math.abs(add(times(Q, coneNode(Q, q, mu, sigma)), q)[1]);

/* Points of an iteration x, f(x), f(f(x)), ... */
function iterates(f, x) {
  const found = [x];
  for (let i = 0; i < STEPS; i++) found.push(f(found[i]));
  return found;
}

/* Whether the iteration comes to rest at last. */
function converges(f, x) {
  for (let i = 0; i < LONG; i++) {
    const next = f(x);
    if (Math.abs(next - x) <= 1e-12 * Math.max(1, x)) return true;
    x = next;
  }
  return false;
}

const room = {
  sliders: {
    mu: ["Friction coefficient μ [-]", 0.05, 3, 0.001, 0.6],
    coupling: ["Coupling Qₙₜ [mm/N]; Qₙₙ = 1", -0.75, 0.75, 0.001, 0.5],
    q_tt: ["Tangential compliance Qₜₜ [mm/N]", 0.57, 3, 0.001, 1],
    q_n: ["Load qₙ [mm]", -2, 2, 0.001, -1],
    q_t: ["Load qₜ [mm]", -4, 4, 0.001, 3],
    start: ["Start of both iterations", 0, 4, 0.001, 0.5],
  },
  breaks: [
    ["Tresca cycles", { mu: 2, coupling: -0.75, q_tt: 1, q_n: -1, q_t: 3, start: 0.4 }],
    ["Acary-Cadoux cycles", { mu: 1, coupling: 0.75, q_tt: 0.6, q_n: -0.25, q_t: 0.85, start: 0.9 }],
    ["Three solutions: the start decides", { mu: 2.5, coupling: 0.7, q_tt: 1, q_n: 0.2, q_t: 0.6, start: 0.7 }],
  ],
  answers(p) {
    const problem = problemOf(p), found = solutions(problem);
    const slipping = found.find((one) => one.states[0] >= FORWARD && one.r[0] > 1e-9);
    const side = !slipping || slipping.states[0] === FORWARD ? 1 : -1;
    const b = side * p.mu * p.coupling, c = p.mu ** 2 * p.q_tt;
    return {
      forces: found.map((one) => one.r),
      nextBound: trescaStep(problem, p.start),
      nextSlip: coneStep(problem, p.start),
      slips: slipping ? side : 0,
      slopeTresca: slipping ? b : null,
      slopeCone: slipping ? (c - b) / (1 - 2 * b + c) : null,
    };
  },
  show(p, a) {
    const problem = problemOf(p);
    const cobweb = (f, letter, unit, name) => {
      const xs = iterates(f, p.start), top = Math.max(1, ...xs) * 1.15, last = xs.slice(-3);
      const path = xs.slice(0, -1).flatMap((x, i) => [[x, i ? x : 0], [x, xs[i + 1]]]);
      const still = converges(f, xs[STEPS]), words = still ? "converges" : "does not converge";
      return [words, still, plot(
        { x: [0, top], y: [0, top], xlabel: `${letter} ${unit}`, ylabel: `next ${letter} ${unit}`, alt: `Cobweb of the iteration of ${name}: it ${words}. Its numbers after ${STEPS} steps are ${last.map((x) => show(x)).join(", ")}.` },
        [{ line: [[0, 0], [top, top]], kind: "thin" }, { line: range(201).map((i) => [(i * top) / 200, f((i * top) / 200)]), kind: "one" }, { line: path, kind: "two" }],
      ), [["one", `one step of ${name}`], ["thin", "diagonal"], ["two", "the iteration"]]];
    };
    const [first, calm, left, leftKey] = cobweb((g) => trescaStep(problem, g), "bound g", "[N]", "Tresca");
    const [second, quiet, right, rightKey] = cobweb((s) => coneStep(problem, s), "slip σ", "[mm]", "Acary and Cadoux");
    return {
      verdict: `${counted(problem, a.forces.map((r) => ({ r })))}. Tresca's iteration ${first}. Acary and Cadoux's iteration ${second}.`,
      fails: !(calm && quiet),
      figures: [[left, leftKey], [right, rightKey]],
      rows: [
        ["A solution slips", ["backwards", "no", "forwards"][a.slips + 1]],
        ["Tresca's slope there", show(a.slopeTresca)],
        ["Slope of Acary and Cadoux there", show(a.slopeCone)],
        ...a.forces.map((r, i) => [`Solution ${i + 1}: normal force, friction [N]`, `${show(r[0])}, ${show(r[1])}`]),
      ],
    };
  },
};
