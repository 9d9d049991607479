"""Laws of contact and friction: one file each, one row here.

A law says which forces a contact can carry and how they go with its displacement. It is a frozen
dataclass whose fields are its parameters, one number per contact, and an InterfaceProblem carries
it. Every law here can be written in De Saxce's form with a closed convex set K_i of forces per
contact and an opening g_i that slip adds to the gap:

    r_i = proj_{K_i} (r_i - rho (u_i + g_i(u_t) n)),      for one and then every rho > 0.

    law            K, forces that a contact can carry                  g, added to the gap
    coulomb        |r_t| <= mu r_n                                     mu |u_t|
    orthotropic    |M^-1 r_t| <= r_n,  M = diag(mu_1, mu_2)            |M u_t|
    frictionless   r_n >= 0, r_t = 0                                   0
    associated     |r_t| <= mu r_n                                     0: slip itself opens the gap
                                                                       by mu |u_t|
    tresca         r_n >= 0, |r_t| <= bound                            0
    bilateral      |r_t| <= mu |r_n|, the bound taken as given         0
    tied           all                                                 0

Sources: De Saxce, Feng (1998), The bipotential method; Alart, Curnier (1991), A mixed formulation
for frictional contact problems prone to Newton like solution methods.
"""

from importlib import import_module

import numpy as np

from contactopt.checks import real_array
from contactopt.errors import InputError
from contactopt.problem.laws.associated import Associated
from contactopt.problem.laws.bilateral import Bilateral
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.laws.frictionless import Frictionless
from contactopt.problem.laws.law import Law
from contactopt.problem.laws.mixed import Mixed, join
from contactopt.problem.laws.orthotropic import Orthotropic
from contactopt.problem.laws.place import Place
from contactopt.problem.laws.tied import Tied
from contactopt.problem.laws.tresca import Tresca

__all__ = [
    "LAWS",
    "Associated",
    "Bilateral",
    "Coulomb",
    "Frictionless",
    "Law",
    "Mixed",
    "Orthotropic",
    "Place",
    "Tied",
    "Tresca",
    "find_law",
    "join",
    "make_law",
]

# name -> (module, class, what it is)
LAWS = {
    "coulomb": (
        "contactopt.problem.laws.coulomb",
        "Coulomb",
        "contact that may open; Coulomb friction",
    ),
    "orthotropic": (
        "contactopt.problem.laws.orthotropic",
        "Orthotropic",
        "Coulomb friction with two coefficients, along and across a direction",
    ),
    "bilateral": (
        "contactopt.problem.laws.bilateral",
        "Bilateral",
        "no separation; friction bound mu |r_n|",
    ),
    "tresca": (
        "contactopt.problem.laws.tresca",
        "Tresca",
        "contact that may open; friction bound given beforehand",
    ),
    "associated": (
        "contactopt.problem.laws.associated",
        "Associated",
        "Coulomb's cone; slip opens the gap by mu |u_t|",
    ),
    "frictionless": (
        "contactopt.problem.laws.frictionless",
        "Frictionless",
        "contact that may open; no friction",
    ),
    "tied": ("contactopt.problem.laws.tied", "Tied", "surfaces glued to each other"),
}


def find_law(name: str) -> type[Law]:
    """Find the class of a law by its name.

    Parameters
    ----------
    name : A name in LAWS.

    Returns
    -------
    The subclass of Law.

    Raises
    ------
    InputError : If there is no law of that name.
    """
    if not isinstance(name, str) or name not in LAWS:
        raise InputError(f"unknown law {name!r}; choose from {', '.join(LAWS)}.")
    module, cls, _ = LAWS[name]
    law: type[Law] = getattr(import_module(module), cls)
    return law


def make_law(name: str, value: object, place: Place, positions: np.ndarray) -> Law:
    """Make the law that a scene means at its contacts.

    Parameters
    ----------
    name : A name in LAWS.
    value : What the law reads: a friction coefficient, or for `tresca` a traction bound [stress].
        One number, an array (k,), or a function of the positions that gives either; for
        `orthotropic` two of them.
    place : Where the contacts are.
    positions : (dim, k) of the contacts.

    Returns
    -------
    The law, with one parameter for each contact.

    Raises
    ------
    InputError : On an unknown name and on values that are not numbers, negative, or of another
        shape.
    """
    values = real_array("the friction of a scene", value(positions) if callable(value) else value)
    return find_law(name).of_place(values, place).spread(len(place.areas))
