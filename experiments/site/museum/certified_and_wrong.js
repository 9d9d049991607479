const Q = [[1, -1], [-1, 2]];
function problemOf(p) {
  const mu = 1 - 10 ** -p.digits;
  return { Q, q: [-(1 - mu), p.q_t], mu };
}

/* The certificate of one node without plates, as contactopt.problem.certificate defines it. */
function certificate({ Q, q, mu }, r) {
  const length = (x) => Math.hypot(...x), size = length(r), c = (Q[0][0] + Q[1][1]) / 2;
  const d = times(Q, r), u = add(d, q);
  const L = Math.max(size > 0 ? length(d) : 0, -q[0], Math.abs(q[0]), size > 0 ? 1e-6 * length(q) : 0);
  const F = Math.max(Math.min(size, L / c), (1e-5 * L) / c);
  const y = add(r, u, -F / L), n = Math.max(y[0], 0);
  const mapped = [n, Math.min(mu * n, Math.max(-mu * n, y[1]))];
  return Math.max(length(add(r, mapped, -1)) / F, (Math.abs(r[1]) - mu * Math.max(r[0], 0)) / F);
}

const room = {
  sliders: {
    digits: ["Nearness to the threshold: −log10 (1 − μ)", 0.3, 11, 0.01, 9],
    r_n: ["Normal force to be judged, rₙ [N]", 0, 2, 0.001, 0.87],
    q_t: ["Pull qₜ [mm]", -10, -3, 0.001, -5],
  },
  breaks: [["Certified and wrong", { digits: 9, r_n: 0.87 }], ["Well conditioned", { digits: 0.3, r_n: 0.87 }], ["The solution", { digits: 9, r_n: 1 }]],
  answers(p) {
    const problem = problemOf(p), { q, mu } = problem;
    return {
      mu,
      q_n: q[0],
      certificate: certificate(problem, [p.r_n, mu * p.r_n]),
      solution: -q[0] / (Q[0][0] + mu * Q[0][1]),
      derivative: -1 / (Q[0][0] + mu * Q[0][1]),
    };
  },
  show(p, a) {
    const problem = problemOf(p), judged = (x) => certificate(problem, [x, a.mu * x]);
    const points = range(201).map((i) => [i / 100, Math.log10(Math.max(judged(i / 100), 1e-14))]);
    const error = Math.abs(p.r_n - a.solution), accepted = a.certificate <= 1e-8, wrong = accepted && error > 0.01;
    const svg = plot(
      { x: [0, 2], y: [-14.5, 1], xlabel: "normal force rₙ [N]", ylabel: "log10 of the certificate", alt: `Certificate of all normal forces from 0 to 2 N. At ${show(p.r_n)} N it is ${show(a.certificate)}.` },
      [{ line: [[0, -8], [2, -8]], kind: "thin" }, { line: points, kind: "one" }, { line: [[1, -99], [1, 99]], kind: "three" }, { dot: [p.r_n, Math.log10(Math.max(a.certificate, 1e-14))], kind: "two" }],
    );
    return {
      verdict: `The certificate is ${show(a.certificate, 3)}: ${accepted ? "accepted" : "refused"} at a tolerance of 10⁻⁸. The error of the normal force is ${show(100 * error, 3)} percent.`,
      fails: wrong,
      figures: [[svg, [["one", "certificate"], ["three", "the only solution"], ["thin", "tolerance"], ["two", "judged forces"]]]],
      rows: [["Friction coefficient", show(a.mu, 13)], ["Threshold of uniqueness", "1"], ["The solution rₙ [N]", "1"], ["Derivative drₙ / dqₙ [N/mm]", show(a.derivative, 3)]],
    };
  },
};
