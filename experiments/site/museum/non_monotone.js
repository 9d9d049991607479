const pairOf = (p) => [[p.r_1, p.u_1], [p.r_2, p.u_2]].map(([r_n, slip]) => ({ r: [r_n, -Math.sign(slip) * p.mu * r_n], u: [0, slip] }));

const room = {
  sliders: {
    r_1: ["Normal force of state 1, rₙ [N]", 0, 12, 0.01, 10],
    u_1: ["Slip of state 1, uₜ [mm]", -2, 2, 0.01, 1],
    r_2: ["Normal force of state 2, rₙ [N]", 0, 12, 0.01, 1],
    u_2: ["Slip of state 2, uₜ [mm]", -2, 2, 0.01, 2],
    mu: ["Friction coefficient μ [-]", 0, 1, 0.01, 0.5],
  },
  breaks: [
    ["Equal normal forces: Tresca", { r_1: 5, r_2: 5, u_1: -1, u_2: 1.5 }],
    ["Opposite slips", { r_1: 10, r_2: 1, u_1: -1, u_2: 2 }],
    ["More slip, less force", { r_1: 10, r_2: 1, u_1: 1, u_2: 2 }],
  ],
  answers(p) {
    const [a, b] = pairOf(p), product = dot(add(a.r, b.r, -1), add(a.u, b.u, -1));
    return { shear: [a.r[1], b.r[1]], product, loop: p.u_1 * p.u_2 > 0 ? -product : null };
  },
  show(p, a) {
    const wide = 2.3, high = Math.max(0.5, p.mu * Math.max(p.r_1, p.r_2)) * 1.25;
    const law = (r_n, kind) => ({ line: [[-wide, p.mu * r_n], [0, p.mu * r_n], [0, -p.mu * r_n], [wide, -p.mu * r_n]], kind });
    const points = [[p.u_1, a.shear[0]], [p.u_2, a.shear[1]]];
    const rises = a.product > 1e-12;
    const left = plot(
      { x: [-wide, wide], y: [-high, high], xlabel: "slip uₜ [mm]", ylabel: "friction rₜ [N]", alt: `Friction over slip for both normal forces. The line from state 1 to state 2 ${rises ? "rises" : "does not rise"}.` },
      [law(p.r_1, "one"), law(p.r_2, "two"), { line: points, kind: rises ? "four" : "three" }, { dot: points[0], kind: "one" }, { dot: points[1], kind: "two" }],
    );
    const corners = [[p.u_1, p.r_1], [p.u_2, p.r_1], [p.u_2, p.r_2], [p.u_1, p.r_2], [p.u_1, p.r_1]];
    const right = plot(
      { x: [-wide, wide], y: [-0.5, 13], xlabel: "slip uₜ [mm]", ylabel: "normal force rₙ [N]", alt: a.loop === null ? "No closed loop: the two slips have opposite directions." : `A closed loop; friction does the work ${show(a.loop)} N mm on it.` },
      [{ line: [[0, 0], [0, 13]], kind: "thin" }, ...(a.loop === null ? [] : [{ area: corners, kind: "four" }, { line: corners, kind: "four" }]), { dot: [p.u_1, p.r_1], kind: "one" }, { dot: [p.u_2, p.r_2], kind: "two" }],
    );
    return {
      verdict: rises ? `The pair breaks monotonicity: the product is ${show(a.product)} N mm, and a convex energy needs 0 or less.` : `This pair agrees with a convex energy: the product is ${show(a.product)} N mm, not positive.`,
      fails: rises,
      figures: [
        [left, [["one", "state 1 and its law"], ["two", "state 2 and its law"], [rises ? "four" : "three", rises ? "this line rises" : "this line does not rise"]]],
        [right, [["four", "loop from state 1 to state 2 and back"]]],
      ],
      rows: [
        ["Friction of the two states [N]", a.shear.map((x) => show(x)).join(", ")],
        ["(r − r′)′(u − u′) [N mm]", show(a.product)],
        ["Work of friction round the loop [N mm]", a.loop === null ? "no loop" : show(a.loop)],
      ],
    };
  },
};
