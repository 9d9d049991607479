"""CalculiX: the stiffness of a block of C3D4, as *FREQUENCY with matrix storage writes it."""

import subprocess
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import skfem
from host import COUNT, FILE, NU, E, give

DECK = f"""*MATERIAL, NAME=M\n*ELASTIC\n{E},{NU}\n*DENSITY\n1.
*SOLID SECTION, ELSET=BLOCK, MATERIAL=M\n*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n1\n*END STEP\n"""

x, z = np.linspace(-1, 1, COUNT + 1), np.linspace(-1, 0, COUNT // 2 + 1)
mesh, job = skfem.MeshTet.init_tensor(x, x, z), Path(FILE).with_suffix("")
cells = np.where((mesh.orientation() > 0)[:, None], mesh.t.T, mesh.t.T[:, [0, 2, 1, 3]])
with job.with_suffix(".inp").open("w") as deck:
    for head, rows in (("*NODE", mesh.p.T), ("*ELEMENT, TYPE=C3D4, ELSET=BLOCK", cells + 1)):
        form = ["%d", *["%.17g"] * rows.shape[1]]
        table = np.column_stack([1 + np.arange(len(rows)), rows])
        np.savetxt(deck, table, form, ",", header=head, comments="")
    deck.write(DECK)
subprocess.run(["ccx", job.name], cwd=job.parent, capture_output=True, check=False)
row, column, value = np.loadtxt(job.with_suffix(".sti"), unpack=True)
upper = sp.coo_matrix((value, (row.astype(int) - 1, column.astype(int) - 1))).tocsr()
known = [line.split(".") for line in job.with_suffix(".dof").read_text().split()]
order = np.lexsort(np.array(known, dtype=int).T[::-1]).reshape(-1, 3)
give(upper + sp.triu(upper, 1).T, mesh.p.T, cells, order)
