const NODES = 6, MOST = 12;
function problemOf(p) {
  const Q = stringCompliance(NODES);
  return { Q, q: range(NODES).map((i) => {
    const x = (i + 1) / (NODES + 1);
    return p.gap - p.press * x * (1 - x);
  }) };
}

/* Forces of the penalty method and of the corrections after it. */
function corrected(p, count) {
  const { Q, q } = problemOf(p), kappa = 10 ** p.log;
  const soft = Q.map((row, i) => row.map((x, j) => x + (i === j ? 1 / kappa : 0)));
  const found = [q.map(() => 0)];
  for (let i = 0; i <= count; i++) found.push(frictionless(soft, add(q, found[i], -1 / kappa)));
  return found.slice(1);
}

const room = {
  sliders: {
    log: ["Stiffness of the penalty, log10 of κ in N/mm", 0, 7, 0.01, 1.5],
    corrections: ["Corrections of the multiplier", 0, MOST, 1, 4],
    press: ["Press [mm]", 0.1, 3, 0.001, 1],
    gap: ["Gap of the unloaded string [mm]", 0, 0.2, 0.001, 0.05],
  },
  breaks: [["A soft penalty alone", { log: 1, corrections: 0 }], ["The same κ, twelve corrections", { log: 1, corrections: 12 }], ["A stiff penalty", { log: 5, corrections: 0 }]],
  answers(p) {
    const { Q, q } = problemOf(p), all = corrected(p, p.corrections);
    const overlap = (r) => Math.max(0, ...add(times(Q, r), q).map((x) => -x));
    const exact = frictionless(Q, q), last = all[p.corrections];
    return { exact, penalty: all[0], multiplier: last, overlapPenalty: overlap(all[0]), overlapMultiplier: overlap(last), error: largest(add(last, exact, -1)) };
  },
  show(p, a) {
    const { Q, q } = problemOf(p), places = range(NODES).map((i) => (i + 1) / (NODES + 1));
    const shape = (r) => [[0, p.gap], ...add(times(Q, r), q).map((u, i) => [places[i], u]), [1, p.gap]];
    const shapes = plot(
      { x: [0, 1], y: limits([-0.01, p.gap, ...[a.penalty, a.multiplier].flatMap((r) => shape(r).map((s) => s[1]))]), xlabel: "place [-]", ylabel: "height over floor [mm]", alt: `The string over the floor. The penalty overlaps by ${show(a.overlapPenalty)} mm, the multiplier by ${show(a.overlapMultiplier)} mm.` },
      [{ line: [[0, 0], [1, 0]], kind: "thin" }, { line: shape(a.exact), kind: "ink" }, { line: shape(a.penalty), kind: "two" }, { line: shape(a.multiplier), kind: "one" }],
    );
    const all = corrected(p, MOST).map((r, i) => [i, Math.log10(Math.max(largest(add(r, a.exact, -1)), 1e-16))]);
    const fall = plot(
      { x: [0, MOST], y: limits(all.map((pair) => pair[1])), xlabel: "corrections", ylabel: "log10 of the error [N]", alt: `The error of the forces falls from ${show(10 ** all[0][1])} N to ${show(10 ** all[MOST][1])} N in ${MOST} corrections.` },
      [{ line: all, kind: "one" }, { dot: all[p.corrections], kind: "ink" }],
    );
    const touches = largest(a.exact) > 0;
    return {
      verdict: touches ? `The penalty overlaps by ${show(a.overlapPenalty, 3)} mm. With ${p.corrections} corrections the overlap is ${show(a.overlapMultiplier, 3)} mm and the error of the forces ${show(a.error, 3)} N.` : "There is no contact force, so that all methods agree.",
      fails: touches && p.corrections === 0,
      figures: [[shapes, [["ink", "exact"], ["two", "penalty"], ["one", "multiplier"], ["thin", "floor"]]], [fall, [["one", "error of the multiplier"], ["ink", "chosen"]]]],
      rows: ["exact", "penalty", "multiplier"].map((name) => [`Forces, ${name} [N]`, a[name].map((x) => show(x, 3)).join(", ")]),
    };
  },
};
