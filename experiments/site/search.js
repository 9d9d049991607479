// Pages about a subject come before the symbols of the reference.
var Scorer = {
  score: ([page, , , , score]) => (page.startsWith("generated/api/") ? score - 30 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
