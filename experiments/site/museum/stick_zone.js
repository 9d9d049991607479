const POINTS = 101;
const ellipse = (x, a, top) => (Math.abs(x) < a ? top * Math.sqrt(1 - (x / a) ** 2) : 0);

const room = {
  sliders: {
    T: ["Push T [N/mm]", -80, 80, 0.01, 20],
    mu: ["Friction coefficient μ [-]", 0.05, 1, 0.001, 0.5],
    P: ["Press P [N/mm]", 10, 100, 0.01, 60],
    R: ["Radius R [mm]", 5, 100, 0.01, 40],
    E: ["Contact modulus E* [MPa]", 100, 5000, 1, 1000],
  },
  breaks: [["The cylinders slide", { T: 40 }], ["Just before", { T: 29 }]],
  answers(p) {
    const a = Math.sqrt((4 * p.P * p.R) / (Math.PI * p.E)), peak = (2 * p.P) / (Math.PI * a);
    const ratio = Math.abs(p.T) / (p.mu * p.P), share = Math.abs(ratio - 1) < 1e-12 ? 1 : ratio, slides = share > 1;
    const c = slides ? null : a * Math.sqrt(1 - share);
    const x = range(POINTS).map((i) => 1.2 * a * ((2 * i) / (POINTS - 1) - 1));
    const shear = slides ? null : x.map((place) => Math.sign(p.T) * p.mu * (ellipse(place, a, peak) - (c > 0 ? ellipse(place, c, (peak * c) / a) : 0)));
    return { a, peak, c, x, pressure: x.map((place) => ellipse(place, a, peak)), shear, slides };
  },
  show(p, a) {
    const high = p.mu * a.peak, pair = (y) => a.x.map((place, i) => [place, y[i]]);
    const svg = plot(
      { x: [a.x[0], a.x[POINTS - 1]], y: [-1.2 * high, 1.2 * high], xlabel: "place x [mm]", ylabel: "traction [MPa]", alt: a.slides ? "The push is larger than all friction: there is no friction in balance with it." : `Friction over the contact. It reaches its bound at the edges and is smaller for x between ${show(-a.c)} and ${show(a.c)} mm.` },
      [
        ...(a.c ? [{ area: [[-a.c, -1.2 * high], [a.c, -1.2 * high], [a.c, 1.2 * high], [-a.c, 1.2 * high]], kind: "three" }] : []),
        { line: pair(a.pressure.map((y) => p.mu * y)), kind: "thin" }, { line: pair(a.pressure.map((y) => -p.mu * y)), kind: "thin" },
        ...(a.shear ? [{ line: pair(a.shear), kind: "two" }] : []),
      ],
    );
    return {
      verdict: a.slides ? `No solution: |T| is larger than μP = ${show(p.mu * p.P)} N/mm. The cylinders slide.` : a.c === 0 ? "|T| = μP: nothing sticks any more but the middle line. The cylinders are about to slide." : p.T === 0 ? "Everything sticks: without a push there is no friction." : `The middle sticks: c / a = ${show(a.c / a.a)}.`,
      fails: a.slides,
      figures: [[svg, [["two", "friction"], ["thin", "bound of friction"], ["three", "stick zone"]]]],
      rows: [["Half-width of the contact a [mm]", show(a.a)], ["Half-width of the stick zone c [mm]", show(a.c)], ["Peak pressure [MPa]", show(a.peak)], ["Largest friction force μP [N/mm]", show(p.mu * p.P)]],
    };
  },
};
