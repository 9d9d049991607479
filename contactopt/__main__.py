"""python -m contactopt"""

import sys

from contactopt.cli import main

if __name__ == "__main__":
    sys.exit(main())
