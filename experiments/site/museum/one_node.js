const problemOf = (p) => ({ Q: [[1, p.coupling], [p.coupling, 1]], q: [p.q_n, p.q_t], mu: p.mu });

const room = {
  sliders: {
    mu: ["Friction coefficient μ [-]", 0, 3, 0.001, 0.5],
    coupling: ["Coupling Qₙₜ [mm/N]; Qₙₙ = Qₜₜ = 1", -0.95, 0.95, 0.001, 0.8],
    q_n: ["Load qₙ [mm]; negative presses", -2, 2, 0.001, 0.2],
    q_t: ["Load qₜ [mm]", -2, 2, 0.001, -0.3],
  },
  breaks: [
    ["Three solutions", { mu: 2, coupling: 0.8, q_n: 0.2, q_t: 0.5 }],
    ["One again: less friction", { mu: 1, coupling: 0.8, q_n: 0.2, q_t: 0.5 }],
  ],
  answers(p) {
    const found = solutions(problemOf(p));
    return {
      forces: found.map((one) => one.r),
      states: found.map((one) => STATES[one.states[0]]),
      threshold: p.coupling ? 1 / Math.abs(p.coupling) : null,
    };
  },
  show(p, a) {
    const { Q } = problemOf(p), k = a.forces.length, far = 6;
    const cone = (from, to, kind) => ({ area: [[0, 0], from, add(from, to), to].map(([n, t]) => [t * far, n * far]), kind });
    const minus = (r) => times(Q, r).map((x) => -x);
    const [edge, other] = [minus([1, -p.mu]), minus([1, p.mu])];
    const loads = plot(
      { x: [-2.5, 2.5], y: [-2.2, 2.2], xlabel: "load qₜ [mm]", ylabel: "load qₙ [mm]", alt: `The load lies in ${k} of the four cones: ${a.states.join(", ")}.` },
      [
        { area: [[-far, 0], [far, 0], [far, far], [-far, far]], kind: "one" },
        cone(edge, other, "three"), cone(edge, [0, 1], "two"), cone(other, [0, -1], "four"),
        { dot: [p.q_t, p.q_n], kind: "ink" },
      ],
    );
    const high = Math.max(1, ...a.forces.map((r) => r[0])) * 1.2, wide = Math.max(1, ...a.forces.map((r) => Math.abs(r[1]))) * 1.3;
    const forces = plot(
      { x: [-wide, wide], y: [-0.1 * high, high], xlabel: "friction rₜ [N]", ylabel: "normal force rₙ [N]", alt: `Forces (normal, friction) of the solutions: ${a.forces.map((r) => `(${r.map((x) => show(x))})`).join(", ")} N.` },
      [{ area: [[0, 0], [-p.mu * high, high], [p.mu * high, high]], kind: "ink" }, ...a.forces.map((r) => ({ dot: [r[1], r[0]], kind: "two" }))],
    );
    const below = p.mu * Math.abs(p.coupling) < 1 - 1e-12;
    return {
      verdict: `${counted(problemOf(p), a.forces.map((r) => ({ r })))}: ${a.states.join("; ")}. ` + (below ? "The hypothesis holds: μ |Qₙₜ| < Qₙₙ." : "The hypothesis is broken: μ |Qₙₜ| ≥ Qₙₙ."),
      fails: !below,
      figures: [
        [loads, [["one", "open"], ["three", "stick"], ["two", "slips forwards"], ["four", "slips backwards"], ["ink", "the load"]]],
        [forces, [["ink", "Coulomb's cone"], ["two", "solutions"]]],
      ],
      rows: [
        ["Threshold Qₙₙ / |Qₙₜ|", show(a.threshold ?? Infinity)],
        ...a.forces.map((r, i) => [`Solution ${i + 1}, ${a.states[i]}: normal force, friction [N]`, `${show(r[0])}, ${show(r[1])}`]),
      ],
    };
  },
};
