"""One question a file, or a folder where a question needs several.

`python -m experiments.questions.NAME` answers it.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")  # before numpy is imported: times are those of one thread
