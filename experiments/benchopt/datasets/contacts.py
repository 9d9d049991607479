"""Problems of contactopt's families and scenes, in the plane and in space."""

from typing import ClassVar

from benchopt import BaseDataset

from contactopt.benchmark.problems import ProblemSpec

PROBLEMS = {
    "punch-2d": ("scene", {"elements": 8, "mu": 0.3}),
    "sphere": ("scene", {"elements": 4}),
    "rigid_bodies": ("family", {"bodies": 6, "contacts": 12}),
    "half_plane": ("family", {}),
}


class Dataset(BaseDataset):
    """One problem, with Q as a matrix."""

    name = "contacts"
    parameters: ClassVar = {"problem": list(PROBLEMS)}

    def get_data(self):
        kind, given = PROBLEMS[self.problem]
        return {"problem": ProblemSpec(kind, self.problem, given).build({}).explicit()}
