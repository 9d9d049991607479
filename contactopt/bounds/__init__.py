"""Guaranteed bounds of the discretisation error: of the displacement in the energy norm, and of
quantities. They cost as much as the solve or more, and are made only where they are asked for.
"""

from contactopt.bounds.guarantee import Guarantee as Guarantee
from contactopt.bounds.guarantee import bounded as bounded
