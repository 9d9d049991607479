"""Derivatives of certified solutions.

A solution (r, lambda) of an interface problem solves the equations of Newton's method
(contactopt.methods.kernels.semismooth),

    F(r, lambda; theta) = r - P(y; mu) = 0,   y = r - rho u,   u = Q r + V lambda + q,
    G(r, lambda; theta) = V' r + s = 0,

with P the map of the law of contact and mu its parameter at each contact. Let D be the derivative
of P by y, block diagonal, and P_mu that by mu. The data theta = (q, mu, s, Q, V) move the
displacement at fixed forces by du = dq + dQ r + dV lambda and the balance by ds + dV' r.
Differentiating both equations gives one linear system,

    M (dr, dlambda) = (P_mu dmu - D rho du,  -ds - dV' r),       M = [[I - D + D rho Q,  D rho V],
                                             [V', 0]].

M is the matrix of Newton's last step. Factors of it, or another such system, serve its transpose
(contactopt.derivatives.linear).

    forward   dr and dlambda for given changes of the data: J v, one solve for each direction v;
    adjoint   for a function f(r, lambda): solve M' (a, b) = (df/dr, df/dlambda) once. With z = D'
              rho a df/dq = -z,   df/dmu = P_mu . a,   df/ds = -b,   df/dQ = -z r',   df/dV = -z
              lambda' - r b'.

Contacts whose y lies on an edge of the pieces of P, between open and closed or between stick and
slip, are weakly active. There P has one-sided derivatives only, and so has the solution: dr solves
the complementarity problem

    dr = P'(y, mu; dr - rho (Q dr + V dlambda + du), dmu),   V' dr = -ds - dV' r,

in which P' is the directional derivative of P, a choice of pieces (contactopt.derivatives.kinks).

Sources: Robinson (1980), Strongly regular generalized equations; Outrata, Kocvara, Zowe (1998),
Nonsmooth approach to optimization problems with equilibrium constraints; Luo, Pang, Ralph (1996),
Mathematical programs with equilibrium constraints.
"""
