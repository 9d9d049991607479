"""python -m contactopt"""

import atexit
import os
import signal
import sys

INTERRUPTED = 130
PRESSED: list[int] = []  # signals of Ctrl-C


def _interrupt(number: int, frame: object) -> None:
    """Ctrl-C, remembered: a module that it interrupts while being imported may fail otherwise."""
    PRESSED.append(number)
    raise KeyboardInterrupt


def main() -> int:
    """The command line; Ctrl-C while it is still being loaded ends with one line, too."""
    if signal.getsignal(signal.SIGINT) == signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        from contactopt.cli import main

        code = main()
    except (KeyboardInterrupt, ImportError) as error:
        if isinstance(error, ImportError) and not PRESSED:
            raise
        print("contactopt: interrupted", file=sys.stderr)
        code = INTERRUPTED
    # the program that reads the output, such as `head`, wants no more of it
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    if code == INTERRUPTED:
        # CPython ends itself by SIGINT instead, if the interrupt came within exec() of a text, as
        # dataclasses use it.
        atexit._run_exitfuncs()  # such as those that free what processes share
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
