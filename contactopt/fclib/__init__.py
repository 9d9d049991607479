"""Problems of other codes in and out: the FCLib collection (HDF5) and the text format of Siconos.

`read` takes both formats and both forms of HDF5 files; `write` writes HDF5, local form. A matrix
that is mostly zeros stays sparse. Format of HDF5: FCLib 1.x,
https://frictionalcontactlibrary.github.io, which needs h5py (the extra `fclib`).
"""

from pathlib import Path

from contactopt.errors import InputError
from contactopt.fclib.hdf5 import MAGIC, read_hdf5, write
from contactopt.fclib.text import read_text
from contactopt.problem import InterfaceProblem

__all__ = ["read", "write"]

# what h5py and NumPy raise on malformed files, InputError among the ValueErrors
FAULTS = OSError, LookupError, ValueError, TypeError, RuntimeError, MemoryError, OverflowError


def read(path: str | Path) -> InterfaceProblem:
    """Read a problem from a file: FCLib's HDF5, local or global form, or Siconos' text format with
    any of its storages.

    Equality constraints are kept: V, s from `R, vectors/s` of the mixed form are the problem's
    balance. A stored solution is ignored. Sizes are compared with what the file holds before memory
    is taken for them; links to other files are not followed.

    Parameters
    ----------
    path : The file. Its first bytes tell the format, not its name.

    Returns
    -------
    The problem in the units of the file. Its Q is sparse where the matrix of the file is mostly
    zeros.

    Raises
    ------
    InputError : If the file is missing, no regular file, or malformed. The message names the file.
    """
    try:
        path = Path(path)
        if not path.exists():
            raise InputError("there is no such file")
        if not path.is_file():
            raise InputError("it is not a regular file")
        with open(path, "rb") as file:
            binary = file.read(len(MAGIC)) == MAGIC
        return read_hdf5(path) if binary else read_text(path)
    except FAULTS as error:
        raise InputError(
            f"'{path}' is not a usable FCLib file: {error or type(error).__name__}"
        ) from error
