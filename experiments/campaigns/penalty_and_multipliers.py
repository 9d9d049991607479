"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    penalty = table[(table["name"] == "penalty") & (table["method.factor"] <= 1e6)]
    slope = np.polyfit(np.log10(penalty["method.factor"]), np.log10(penalty["error"]), 1)[0]
    size = table["problem.elements"]
    ten = table[(table["name"] == "penalty") & (table["method.factor"] == 1e3)]
    exact = table[(table["name"] == "augmented_lagrangian") & ~_true(table)]
    uzawa = table[(table["name"] == "augmented_lagrangian") & _true(table)]
    good = exact[exact["success"]].groupby("method.rho")["iterations"].max()
    steps = uzawa.set_index("problem.elements")["iterations"]
    errors = [
        float(ten["error"][ten["problem.elements"] == n].iloc[0]) for n in (size.min(), size.max())
    ]
    conditions = [float(table["condition"][size == n].iloc[0]) for n in (size.min(), size.max())]
    return [
        (
            f"The error of the penalty method falls like factor^{slope:.2f} (fit over factors up to"
            f" 1e6 and all meshes). At a factor of 1e3 it is {errors[0]:.1e} on the coarsest and"
            f" {errors[1]:.1e} on the finest mesh, while the condition number of Q goes from"
            f" {conditions[0]:.0f} to {conditions[1]:.0f}."
        ),
        (
            "With multipliers the answer is exact whatever the factor. Exact minimisation is"
            f" certified in {_share(exact)} runs. From rho = {good.index[0]:.0e} to"
            f" {good.index[-1]:.0e} the largest number of iterations on any mesh goes from"
            f" {good.iloc[0]:.0f} to {good.iloc[-1]:.0f}."
        ),
        (
            f"One Uzawa step per iteration is certified in {_share(uzawa)} runs. Its iterations go"
            f" from {steps[size.min()]:.0f} to {steps[size.max()]:.0f} as the mesh is refined from"
            f" {size.min()} to {size.max()} elements. Lagrangian multipliers with a QP for the"
            " normal problem need no factor. They are certified in"
            f" {_share(table[table['name'] == 'lagrangian'])} runs."
        ),
    ]


def _true(table):  # type: ignore[no-untyped-def]
    return table["method.explicit"].eq(True)


def _share(rows) -> str:  # type: ignore[no-untyped-def]
    return f"{int(rows['success'].sum())} of {len(rows)}"
