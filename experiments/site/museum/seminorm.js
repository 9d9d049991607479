/* The circulant matrix of the paper, equations (27): its first column, for 2m nodes. */
function column(m) {
  const top = Math.ceil(Math.log2(m) - 1e-12), c = Array(2 * m).fill(0);
  for (let i = 1; i <= top; i++) {
    let w = 0;
    for (let l = 2 ** (i - 1); l < 2 ** i; l++) w += 1 / l ** 2;
    const j = 2 ** i - 1;
    c[0] += 2 * w;
    if (j < m) {
      c[j] -= w;
      c[2 * m - j] -= w;
    }
  }
  return c;
}

/* The seminorm itself on 2m nodes: the double integral by the sum over all pairs of nodes. Its symbol
   is j (2m - j), times a factor; as in the paper the weight of near nodes is one over the distance
   squared. */
const weight = (m, l) => (Math.PI / (2 * m * Math.sin((Math.PI * l) / (2 * m)))) ** 2;

const room = {
  sliders: {
    m: ["Half the number of nodes, m", 2, 256, 1, 64],
    wave: ["Wave: periods around the circle, as a share of m", 0, 1, 0.001, 0.25],
  },
  breaks: [["No power of two", { m: 70 }], ["A larger power of two", { m: 256 }]],
  answers(p) {
    const c = column(p.m), j = Math.max(1, Math.round(p.wave * p.m));
    const symbol = range(p.m + 1).map((wave) => range(2 * p.m).reduce((sum, i) => sum + (c[i] ? c[i] * Math.cos((Math.PI * ((i * wave) % (2 * p.m))) / p.m) : 0), 0));
    const ratios = symbol.slice(1).map((x, i) => (x * p.m) / (Math.PI * (i + 1)));
    const full = range(p.m + 1).map((wave) => (Math.PI ** 2 * wave * (2 * p.m - wave)) / (2 * p.m ** 2));
    return { column: c, symbol, full, rowSum: c.reduce((sum, x) => sum + x, 0), j, at: symbol[j], low: Math.min(...ratios), high: Math.max(...ratios) };
  },
  show(p, a) {
    const power = Math.abs(a.rowSum) < 1e-9, log = (x) => Math.log2(x);
    const lumped = range(p.m - 1).map((i) => i + 1).filter((l) => a.column[l]);
    const left = plot(
      { x: [-0.3, log(p.m) + 0.3], y: [log(weight(p.m, p.m)) - 1, 1], xlabel: "log2 of the distance", ylabel: "log2 of the weight", alt: `Weights of pairs of nodes: all ${p.m} distances in the double integral, and ${lumped.length} in the sparse matrix.` },
      [
        { line: range(p.m).map((i) => [log(i + 1), log(weight(p.m, i + 1))]), kind: "one" },
        ...lumped.flatMap((l) => [{ line: [[log(l), -99], [log(l), log(-a.column[l])]], kind: "two" }, { dot: [log(l), log(-a.column[l])], kind: "two" }]),
      ],
    );
    const over = (values) => values.slice(1).map((x, i) => [(i + 1) / p.m, (x * p.m) / (Math.PI * (i + 1))]);
    const right = plot(
      { x: [0, 1], y: [0, Math.min(6, Math.max(a.high, 4)) * 1.1], xlabel: "periods j / m [-]", ylabel: "energy / (π j / m) [-]", alt: `Energy of a wave over that of the seminorm. That of the sparse matrix lies between ${show(a.low)} and ${show(a.high)}.` },
      [{ line: [[0, Math.PI], [1, Math.PI]], kind: "thin" }, { line: over(a.full), kind: "one" }, { line: over(a.symbol), kind: "two" }, { dot: over(a.symbol)[a.j - 1], kind: "ink" }],
    );
    return {
      verdict: power ? `m is a power of two: rows sum to zero. With the sparse matrix as preconditioner the condition number is ${show(a.high / a.low, 3)} instead of ${p.m}.` : `The hypothesis is broken: the rows sum to ${show(a.rowSum, 3)}, and a constant costs energy, which no seminorm allows.`,
      fails: !power,
      figures: [
        [left, [["one", "all distances"], ["two", "sparse: one per group"]]],
        [right, [["thin", "exactly |k|"], ["one", "all distances"], ["two", "sparse"], ["ink", "your wave"]]],
      ],
      rows: [
        ["Entries of a row: double integral", String(2 * p.m)],
        ["Entries of a row: sparse matrix", String(a.column.filter((x) => x).length)],
        ["Sum of a row", show(power ? 0 : a.rowSum)],
        ["Energy / (π j / m): smallest, largest", `${show(a.low)}, ${show(a.high)}`],
        [`Energy of the wave with ${a.j} periods`, show(a.at)],
      ],
    };
  },
};
