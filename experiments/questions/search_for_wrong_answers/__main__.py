"""Does another way say the same? `python -m experiments.questions.search_for_wrong_answers [SEEDS | FIRST LAST]`."""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import logging  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402

import numpy as np  # noqa: E402

from experiments.questions.search_for_wrong_answers.compare import judge  # noqa: E402
from experiments.questions.search_for_wrong_answers.families import FAMILIES  # noqa: E402

if __name__ == "__main__":
    logging.disable(logging.WARNING)
    first, last = map(int, sys.argv[1:3])
    for seed in range(first, last):
        begin = time.process_time()
        name = list(FAMILIES)[seed % len(FAMILIES)]
        verdict = judge(seed, FAMILIES[name](np.random.default_rng(seed)))
        print(seed, verdict.family, f"{time.process_time()-begin:.1f} s", f"{np.median(verdict.widths or [0]):.1e}", *verdict.wrong, sep="\n   " if verdict.wrong else " ", flush=True)
