"use strict";
/* Small dense linear algebra and exact contact for the rooms of the museum. Signs and letters are
   those of the site: u = Q r + V lambda + q, V'r + s = 0, the normal component of a contact first,
   r the force on the upper body, u_n the gap that remains. */

const range = (n) => Array.from({ length: n }, (_, i) => i);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const times = (A, x) => A.map((row) => dot(row, x));
const add = (a, b, factor = 1) => a.map((x, i) => x + factor * b[i]);
const largest = (a) => a.reduce((top, x) => Math.max(top, Math.abs(x)), 0);
const transposed = (A) => A[0].map((_, j) => A.map((row) => row[j]));

/* Gauss with partial pivoting: { x, det }, x null where A is singular. */
function eliminate(A, b) {
  const n = A.length;
  const M = A.map((row, i) => [...row, b[i]]);
  const scale = largest(A.flat());
  let det = 1;
  for (let k = 0; k < n; k++) {
    let p = k;
    for (let i = k + 1; i < n; i++) if (Math.abs(M[i][k]) > Math.abs(M[p][k])) p = i;
    if (p !== k) {
      [M[k], M[p]] = [M[p], M[k]];
      det = -det;
    }
    det *= M[k][k];
    if (Math.abs(M[k][k]) <= 1e-14 * scale) return { x: null, det };
    for (let i = k + 1; i < n; i++) {
      const f = M[i][k] / M[k][k];
      for (let j = k; j <= n; j++) M[i][j] -= f * M[k][j];
    }
  }
  const x = Array(n).fill(0);
  for (let i = n - 1; i >= 0; i--) {
    let rest = M[i][n];
    for (let j = i + 1; j < n; j++) rest -= M[i][j] * x[j];
    x[i] = rest / M[i][i];
  }
  return { x, det };
}
const solveLinear = (A, b) => eliminate(A, b).x;

const STATES = ["open", "stick", "slips forwards", "slips backwards"];
const OPEN = 0, STICK = 1, FORWARD = 2, BACKWARD = 3;

/* All combinations of the states 0 ... count - 1 of k contacts. */
function combinations(k, count = 4) {
  return range(count ** k).map((code) => range(k).map((i) => Math.floor(code / count ** i) % count));
}

/* The linear system in r of a combination of states. */
function system({ Q, q, mu }, states) {
  const A = [], b = [];
  for (let i = 0; i < Q.length; i++) {
    const state = states[i >> 1], slips = i % 2 === 1 && state >= FORWARD;
    const row = state === OPEN || slips ? Q.map((_, j) => (i === j ? 1 : 0)) : [...Q[i]];
    if (slips) row[i - 1] = state === FORWARD ? mu : -mu;
    A.push(row);
    b.push(state === OPEN || slips ? 0 : -q[i]);
  }
  return [A, b];
}

/* Every isolated solution of a small plane problem with Coulomb's law, and the ends of every line of
   solutions, by trying all states: [{r, u, states}], each point once, those with a small first normal
   force first. */
function solutions(problem) {
  const { Q, q, mu } = problem, found = [];
  for (const states of combinations(Q.length / 2)) {
    const r = solveLinear(...system(problem, states));
    if (!r) continue;
    const u = add(times(Q, r), q);
    const F = 1e-10 * largest(r), L = 1e-10 * Math.max(largest(u), largest(q));
    const holds = states.every((state, i) => {
      const [r_n, r_t, u_n, u_t] = [r[2 * i], r[2 * i + 1], u[2 * i], u[2 * i + 1]];
      if (state === OPEN) return u_n >= -L;
      if (r_n < -F) return false;
      if (state === STICK) return Math.abs(r_t) <= mu * r_n + F;
      return state === FORWARD ? u_t >= -L : u_t <= L;
    });
    const same = (one) => largest(add(one.r, r, -1)) <= 1e-8 * Math.max(largest(r), largest(one.r));
    if (holds && !found.some(same)) found.push({ r, u, states });
  }
  return found.sort((a, b) => a.r[0] - b.r[0] || a.r[1] - b.r[1]);
}

/* Whether two of these solutions are the ends of a line of solutions: then its middle is one, too. */
function continuum({ Q, q, mu }, found) {
  const obeys = (r) => {
    const u = add(times(Q, r), q), F = 1e-9 * largest(r), L = 1e-9 * Math.max(largest(u), largest(q));
    return range(r.length / 2).every((i) => {
      const [r_n, r_t, u_n, u_t] = [r[2 * i], r[2 * i + 1], u[2 * i], u[2 * i + 1]];
      const normal = r_n >= -F && u_n >= -L && (r_n <= F || u_n <= L);
      return normal && Math.abs(r_t) <= mu * r_n + F && (Math.abs(u_t) <= L || Math.abs(r_t + Math.sign(u_t) * mu * r_n) <= F);
    });
  };
  return found.some((a, i) => found.slice(0, i).some((b) => obeys(add(a.r, b.r).map((x) => x / 2))));
}

/* How many solutions there are, in words. */
function counted(problem, found) {
  if (continuum(problem, found)) return "Infinitely many solutions, a whole line of them";
  return `${found.length || "No"} solution${found.length === 1 ? "" : "s"}`;
}

/* One node under Tresca's law with the bound g: the minimum of r'Qr/2 + q'r over r_n >= 0 and
   |r_t| <= g, from the points at which faces of this set are stationary. */
function trescaNode(Q, q, g) {
  const cost = (r) => dot(r, times(Q, r)) / 2 + dot(q, r);
  const points = [];
  for (const t of [-g, g]) points.push([Math.max(0, -(q[0] + Q[0][1] * t) / Q[0][0]), t]);
  points.push([0, Math.min(g, Math.max(-g, -q[1] / Q[1][1]))]);
  const free = solveLinear(Q, [-q[0], -q[1]]);
  if (free && free[0] >= 0 && Math.abs(free[1]) <= g) points.push(free);
  return points.reduce((best, r) => (cost(r) < cost(best) ? r : best));
}

/* One node with the minimum of r'Qr/2 + q'r + mu sigma r_n over Coulomb's cone |r_t| <= mu r_n. */
function coneNode(Q, q, mu, sigma) {
  const c = [q[0] + mu * sigma, q[1]];
  const cost = (r) => dot(r, times(Q, r)) / 2 + dot(c, r);
  const points = [[0, 0]];
  for (const side of [-mu, mu]) {
    const d = [1, side], size = Math.max(0, -dot(c, d) / dot(d, times(Q, d)));
    points.push([size, size * side]);
  }
  const free = solveLinear(Q, [-c[0], -c[1]]);
  if (free && Math.abs(free[1]) <= mu * free[0]) points.push(free);
  return points.reduce((best, r) => (cost(r) < cost(best) ? r : best));
}

/* Compliance of a stretched string at k inner nodes, in units of its length over its tension. */
function stringCompliance(k) {
  return range(k).map((i) =>
    range(k).map((j) => ((Math.min(i, j) + 1) * (k - Math.max(i, j))) / (k + 1) / (k + 1)),
  );
}

/* Contact without friction by trying all sets of touching nodes: r >= 0, Qr + q >= 0, r'(Qr+q) = 0. */
function frictionless(Q, q) {
  for (const touching of combinations(Q.length, 2)) {
    const A = Q.map((row, i) => (touching[i] ? row : row.map((_, j) => (i === j ? 1 : 0))));
    const r = solveLinear(A, q.map((x, i) => (touching[i] ? -x : 0)));
    if (!r) continue;
    const u = add(times(Q, r), q);
    if (r.every((x) => x >= -1e-12 * largest(r)) && u.every((x) => x >= -1e-12 * largest(q))) return r;
  }
  return null;
}

/* Largest eigenvalue of a symmetric matrix with eigenvalues above zero, by squaring it. */
function largestEigenvalue(Q) {
  let A = Q, log = 0;
  for (let i = 0; i < 40; i++) {
    const size = largest(A.flat());
    A = A.map((row) => row.map((x) => x / size));
    log += Math.log(size) / 2 ** i;
    A = A.map((row) => times(transposed(A), row));
  }
  return Math.exp(log + Math.log(range(A.length).reduce((sum, i) => sum + A[i][i], 0)) / 2 ** 40);
}
