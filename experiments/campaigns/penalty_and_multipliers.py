"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np

from contactopt.benchmark.tables import select, told
from contactopt.errors import InputError


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    return told(table, penalty, exact_minimisation, uzawa, lagrangian)


def penalty(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, name="penalty")
    rows = rows[rows["method.factor"] <= 1e6]
    if rows["method.factor"].nunique() < 2:
        raise InputError("the slope of the error needs two factors up to 1e6.")
    slope = np.polyfit(np.log10(rows["method.factor"]), np.log10(rows["error"]), 1)[0]
    ten = select(rows, **{"method.factor": 1e3}).sort_values("problem.elements", kind="stable")
    errors, conditions = ten["error"].iloc[[0, -1]], ten["condition"].iloc[[0, -1]]
    return (
        f"The error of the penalty method falls like factor^{slope:.2f} (fit over factors up to"
        f" 1e6 and all meshes). At a factor of 1e3 it is {errors.iloc[0]:.1e} on the coarsest and"
        f" {errors.iloc[1]:.1e} on the finest mesh, while the condition number of Q goes from"
        f" {conditions.iloc[0]:.0f} to {conditions.iloc[1]:.0f}."
    )


def exact_minimisation(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, name="augmented_lagrangian")
    rows = select(rows, **{"method.explicit": [False, ""]})
    good = select(rows, success=True).groupby("method.rho")["iterations"].max()
    return (
        "With multipliers the answer is exact whatever the factor. Exact minimisation is"
        f" certified in {_share(rows)} runs. From rho = {good.index[0]:.0e} to"
        f" {good.index[-1]:.0e} the largest number of iterations on any mesh goes from"
        f" {good.iloc[0]:.0f} to {good.iloc[-1]:.0f}."
    )


def uzawa(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, name="augmented_lagrangian", **{"method.explicit": True})
    steps = rows.set_index("problem.elements")["iterations"].sort_index()
    return (
        f"One Uzawa step per iteration is certified in {_share(rows)} runs. Its iterations go"
        f" from {steps.iloc[0]:.0f} to {steps.iloc[-1]:.0f} as the mesh is refined from"
        f" {steps.index[0]} to {steps.index[-1]} elements."
    )


def lagrangian(table) -> str:  # type: ignore[no-untyped-def]
    return (
        "Lagrangian multipliers with a QP for the normal problem need no factor. They are"
        f" certified in {_share(select(table, name='lagrangian'))} runs."
    )


def _share(rows) -> str:  # type: ignore[no-untyped-def]
    return f"{int(rows['success'].sum())} of {len(rows)}"
