"""Hertz's line contact in Kratos: mortar contact with an augmented Lagrangian. Settings are the
default ones, but for four steps of the depth and for the radius of the search, whose default finds
no pair. Run by the Python that has Kratos, with no package of this project: given.npz answer.npz.

Source: Kratos Multiphysics, ContactStructuralMechanicsApplication, alm_contact_process.py.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

TURN = [0, 3, 2, 1]  # corners, counterclockwise


def block(kind: str, lines: Any) -> str:
    return f"Begin {kind}\n" + "\n".join(lines) + f"\nEnd {kind.split()[0]}\n"


def rows(items: Any, first: int) -> list[str]:
    return [f"{i} {item}" for i, item in enumerate(items, first)]


def element_rows(corners: np.ndarray, first: int, material: int) -> list[str]:
    return rows([f"{material} " + " ".join(map(str, c)) for c in corners.T], first)


def part(name: str, nodes: Any, elements: Any = (), conditions: Any = ()) -> str:
    inside = zip(("Nodes", "Elements", "Conditions"), (nodes, elements, conditions), strict=True)
    lists = [block(f"SubModelPart{kind}", map(str, own)) for kind, own in inside]
    return block(f"SubModelPart {name}", lists)


def mesh_text(given: Any) -> str:
    """The file of nodes, elements, boundaries and sets that Kratos reads."""
    p, t, tip, cells = given["p"], given["t"][TURN], given["indenter"], given["cells"][TURN]
    nodes, elements = p.shape[1], t.shape[1]
    everything = np.hstack([p, tip])
    points = everything.shape[1]
    surfaces = {  # with the outward normal on the right
        "Slave": given["contact"][np.argsort(-p[0, given["contact"]])] + 1,
        "Master": given["tip"][np.argsort(tip[0, given["tip"]])] + 1 + nodes,
    }
    edges = [pair for own in surfaces.values() for pair in pairwise(own)]
    faces = len(surfaces["Slave"]) - 1
    total = elements + cells.shape[1]
    return "".join(
        [block(f"Properties {i}", []) for i in range(3)]
        + [block("Nodes", rows([f"{x[0]:.15e} {x[1]:.15e} 0" for x in everything.T], 1))]
        + [block("Elements SmallDisplacementElement2D4N",
                 element_rows(t + 1, 1, 1) + element_rows(cells + 1 + nodes, elements + 1, 2))]
        + [block("Conditions LineCondition2D2N", rows([f"0 {a} {b}" for a, b in edges], 1))]
        + [part("All", range(1, points + 1), range(1, total + 1))]
        + [part("Block", range(1, nodes + 1), range(1, elements + 1))]
        + [part("Indenter", range(nodes + 1, points + 1), range(elements + 1, total + 1))]
        + [part("Slave", surfaces["Slave"], (), range(1, faces + 1))]
        + [part("Master", surfaces["Master"], (), range(faces + 1, len(edges) + 1))]
        + [part("Axis", given["axis"] + 1), part("Bottom", given["bottom"] + 1)]
    )  # fmt: skip


def material(given: Any, number: int, name: str) -> dict[str, Any]:
    law: dict[str, Any] = {
        "constitutive_law": {"name": "LinearElasticPlaneStrain2DLaw"},
        "Tables": {},
    }
    constants = {"YOUNG_MODULUS": float(given["E"]), "POISSON_RATIO": float(given["nu"])}
    law["Tables"] = {}
    law["Variables"] = constants | {"DENSITY": 0.0, "THICKNESS": 1.0}
    return {"model_part_name": f"Structure.{name}", "properties_id": number, "Material": law}


def held(name: str, which: list[bool], values: list[Any]) -> dict[str, Any]:
    where = {"model_part_name": f"Structure.{name}", "variable_name": "DISPLACEMENT"}
    return {
        "python_module": "assign_vector_variable_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": where | {"constrained": which, "value": values, "interval": [0.0, "End"]},
    }


def settings(depth: float) -> dict[str, Any]:
    """The settings of the analysis."""
    contact = {
        "python_module": "alm_contact_process",
        "kratos_module": "KratosMultiphysics.ContactStructuralMechanicsApplication",
        "Parameters": {
            "model_part_name": "Structure",
            "contact_model_part": {"0": ["Slave", "Master"]},
            "assume_master_slave": {"0": ["Slave"]},
            "contact_type": "Frictionless",
            "search_parameters": {"type_search": "in_radius", "search_factor": 10.0},
        },
    }
    solver = {
        "model_part_name": "Structure",
        "solver_type": "Static",
        "echo_level": 0,
        "domain_size": 2,
        "analysis_type": "non_linear",
        "model_import_settings": {"input_type": "mdpa", "input_filename": "hertz"},
        "material_import_settings": {"materials_filename": "materials.json"},
        "time_stepping": {"time_step": 0.25},
        "contact_settings": {"mortar_type": "ALMContactFrictionless"},
        "convergence_criterion": "contact_residual_criterion",
        "residual_relative_tolerance": 1e-8,
        "residual_absolute_tolerance": 1e-10,
        "max_iteration": 40,
        "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
        "rotation_dofs": False,
        "volumetric_strain_dofs": False,
    }
    names = {"problem_name": "hertz", "parallel_type": "OpenMP", "echo_level": 0}
    return {
        "problem_data": names | {"start_time": 0.0, "end_time": 1.0},
        "solver_settings": solver,
        "processes": {
            "constraints": [
                held("Bottom", [True, True, True], [0.0, 0.0, 0.0]),
                held("Axis", [True, False, True], [0.0, None, 0.0]),
                held("Indenter", [True, True, True], [0.0, f"-{depth}*t", 0.0]),
            ],
            "contact": [contact],
        },
    }


def main() -> None:
    import KratosMultiphysics as Kratos
    import KratosMultiphysics.ContactStructuralMechanicsApplication as Contact
    import KratosMultiphysics.LinearSolversApplication  # its sparse factors
    from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import (
        StructuralMechanicsAnalysis,
    )

    given, answer = np.load(sys.argv[1]), Path(sys.argv[2]).resolve()
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("hertz.mdpa").write_text(mesh_text(given))
        materials = {"properties": [material(given, 1, "Block"), material(given, 2, "Indenter")]}
        Path("materials.json").write_text(json.dumps(materials))
        model = Kratos.Model()
        StructuralMechanicsAnalysis(
            model, Kratos.Parameters(json.dumps(settings(float(given["depth"]))))
        ).Run()
        seconds = time.process_time() - start
        found = {node.X0: node.GetSolutionStepValue(Contact.LAGRANGE_MULTIPLIER_CONTACT_PRESSURE)
                 for node in model["Structure.Slave"].Nodes}  # fmt: skip
        scale = model["Structure"].ProcessInfo[Kratos.SCALE_FACTOR]
        pressure = -scale * np.array([found[x] for x in sorted(found)])
        os.chdir(answer.parent)
    np.savez(answer, pressure=pressure, seconds=seconds)


if __name__ == "__main__":
    main()
