"""Where oneMKL is, which pypardiso installs."""

import os
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from typing import Any


@cache
def library() -> Any | None:
    """oneMKL, which pypardiso installs, or None.

    pypardiso walks through all installed packages for this library whenever one of its solvers is
    made, which takes longer than many a factorisation. It does not where its variable
    PYPARDISO_MKL_RT names the library, so that this function sets the variable, unless the user
    has.
    """
    if "PYPARDISO_MKL_RT" not in os.environ:
        try:
            found = [file for file in files("mkl") or () if "mkl_rt" in file.name]
        except PackageNotFoundError:
            found = []
        if found:
            os.environ["PYPARDISO_MKL_RT"] = os.path.realpath(found[0].locate())
    try:
        from pypardiso import PyPardisoSolver

        return PyPardisoSolver().libmkl
    except (ImportError, OSError):
        return None
