"""python -m contactopt"""

import os
import sys

INTERRUPTED = 130


def main() -> int:
    """The command line; Ctrl-C while it is still being loaded ends with one line, too."""
    try:
        from contactopt.cli import main

        code = main()
    except KeyboardInterrupt:
        print("contactopt: interrupted", file=sys.stderr)
        code = INTERRUPTED
    if code == INTERRUPTED:
        # CPython ends itself by SIGINT instead, if the interrupt came within exec() of a text, as dataclasses use it.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
