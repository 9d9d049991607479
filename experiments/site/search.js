// Pages about a subject come before the reference, unless the query looks like a symbol.
var Scorer = {
  score: ([page, , , , score]) => {
    const symbol = /[a-z][A-Z]|[_.]/.test(new URLSearchParams(location.search).get("q") ?? "");
    return page.startsWith("generated/api/") && !symbol ? score - 30 : score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
