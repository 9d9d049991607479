const room = {
  sliders: {
    mu: ["Friction coefficient μ [-]", 0, 2, 0.001, 0.3],
    s: ["Pull on the slide, s [N]", -2, 2, 0.001, 0.5],
    q_n: ["Load qₙ [mm]; negative presses", -2, 2, 0.001, -1],
    coupling: ["Coupling Qₙₜ [mm/N]; Qₙₙ = Qₜₜ = 1", -0.95, 0.95, 0.001, 0],
  },
  breaks: [
    ["No solution", { mu: 0.3, s: 0.5, q_n: -1, coupling: 0 }],
    ["Held by more friction", { mu: 0.6, s: 0.5, q_n: -1, coupling: 0 }],
    ["Held by the coupling", { mu: 0.6, s: 0.9, q_n: -1, coupling: 0.7 }],
  ],
  answers(p) {
    const given = Math.max(0, p.coupling * p.s - p.q_n); // the balance gives the friction -s
    const held = p.mu * given >= Math.abs(p.s) * (1 - 1e-12);
    return { forces: held ? [given, -p.s] : null, needed: p.mu > 0 ? Math.abs(p.s) / p.mu : null, given };
  },
  show(p, a) {
    const high = Math.max(1, a.given * 1.3, Math.min(a.needed ?? 0, 8) * 1.2);
    const wide = Math.max(1, Math.abs(p.s) * 1.5);
    const line = [[-wide, (p.coupling * wide) - p.q_n], [wide, -p.coupling * wide - p.q_n]];
    const svg = plot(
      { x: [-wide, wide], y: [-0.1 * high, high], xlabel: "friction rₜ [N]", ylabel: "normal force rₙ [N]", alt: a.forces ? "The point of balance and closed gap lies in Coulomb's cone." : "The point of balance and closed gap lies outside Coulomb's cone." },
      [
        { area: [[0, 0], [-p.mu * high, high], [p.mu * high, high]], kind: "ink" },
        { line, kind: "one" }, { line: [[-p.s, -99], [-p.s, 99]], kind: "two" },
        { dot: [-p.s, p.coupling * p.s - p.q_n], kind: a.forces ? "three" : "two" },
      ],
    );
    return {
      verdict: a.forces ? `1 solution: r = (${show(a.forces[0])}, ${show(a.forces[1])}) N.` : "No solution: the normal force that closes the gap is too small to hold the slide.",
      fails: !a.forces,
      figures: [[svg, [["ink", "Coulomb's cone"], ["one", "forces that close the gap"], ["two", "forces that balance the slide"]]]],
      rows: [["Normal force that friction needs, |s| / μ [N]", show(a.needed ?? (p.s ? Infinity : 0))], ["Normal force that closes the gap [N]", show(a.given)]],
    };
  },
};
