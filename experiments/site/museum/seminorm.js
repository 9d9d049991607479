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

const room = {
  sliders: {
    m: ["Half the number of nodes, m", 2, 256, 1, 64],
    wave: ["Wave: periods around the contact, as a share of m", 0, 1, 0.001, 0.25],
  },
  breaks: [["No power of two", { m: 70 }], ["A larger power of two", { m: 256 }]],
  answers(p) {
    const c = column(p.m), j = Math.max(1, Math.round(p.wave * p.m));
    const symbol = range(p.m + 1).map((wave) => range(2 * p.m).reduce((sum, i) => sum + (c[i] ? c[i] * Math.cos((Math.PI * ((i * wave) % (2 * p.m))) / p.m) : 0), 0));
    const ratios = symbol.slice(1).map((x, i) => (x * p.m) / (Math.PI * (i + 1)));
    return { column: c, symbol, rowSum: c.reduce((sum, x) => sum + x, 0), j, at: symbol[j], low: Math.min(...ratios), high: Math.max(...ratios) };
  },
  show(p, a) {
    const points = a.symbol.map((x, j) => [j / p.m, x]), ratios = a.symbol.slice(1).map((x, i) => [(i + 1) / p.m, (x * p.m) / (Math.PI * (i + 1))]);
    const middle = Math.sqrt(a.low * a.high) * Math.PI, zero = Math.abs(a.rowSum) < 1e-9;
    const left = plot(
      { x: [0, 1], y: limits([0, ...a.symbol]), xlabel: "wave number j / m [-]", ylabel: "symbol [-]", alt: `The symbol over the wave number; at ${a.j} periods it is ${show(a.at)}.` },
      [{ line: [[0, 0], [1, middle]], kind: "thin" }, { line: points, kind: "one" }, { dot: points[a.j], kind: "ink" }],
    );
    const right = plot(
      { x: [0, 1], y: limits([0, Math.min(a.high, 10 * a.low + 5)]), xlabel: "wave number j / m [-]", ylabel: "symbol / (π j / m) [-]", alt: `The symbol over that of the half-plane lies between ${show(a.low)} and ${show(a.high)}.` },
      [{ line: ratios, kind: "two" }],
    );
    return {
      verdict: zero ? `m is a power of two: the rows sum to zero. The condition number falls from ${p.m} to ${show(a.high / a.low, 3)}.` : `The hypothesis is broken: the rows sum to ${show(a.rowSum, 3)}, and a constant has energy. The condition number on the other waves is ${show(a.high / a.low, 3)}, and ${p.m} without the matrix.`,
      fails: !zero,
      figures: [[left, [["one", "symbol of the matrix"], ["thin", "a multiple of j"], ["ink", "chosen wave"]]], [right, [["two", "symbol of the preconditioned compliance"]]]],
      rows: [["Entries in a row that are not zero", String(a.column.filter((x) => x).length)], ["Sum of a row", show(zero ? 0 : a.rowSum)], ["Smallest and largest ratio", `${show(a.low)}, ${show(a.high)}`], [`Symbol of ${a.j} periods`, show(a.at)]],
    };
  },
};
