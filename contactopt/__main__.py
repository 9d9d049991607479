"""python -m contactopt"""

import sys


def main() -> int:
    """The command line; Ctrl-C while it is still being loaded ends with one line, too."""
    try:
        from contactopt.cli import main

        return main()
    except KeyboardInterrupt:
        print("contactopt: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
