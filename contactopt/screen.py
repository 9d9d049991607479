"""What a terminal shows: the answer of a run in tables, and a bar while something long goes on."""

import re
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

PATIENCE = 2.0  # seconds of work for which no bar is shown
PAUSE = 10.0  # seconds between two lines about counted work, where there is no terminal
WIDE = 10_000  # columns of a file: nothing is wrapped
STEPS = re.compile(r"(?:state|mesh) (\d+)(?: of (\d+))?\b")  # sentences about what is done


def in_tables(title: str, table: Sequence[Sequence[str]], rows: Mapping[str, str]) -> str:
    """A table of numbers with a head, and rows of words below it; coloured on a terminal."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    terminal = sys.stdout.isatty()
    console = Console(width=None if terminal else WIDE, markup=False, highlight=False, emoji=False)
    look: dict[str, Any] = {"box": None, "pad_edge": False, "padding": (0, 2, 0, 0)}
    numbers, words = Table(**look, header_style="bold"), Table(**look, show_header=False)
    head, *body = table
    for number, name in enumerate(head):
        # the name of a pair may be cut into lines, numbers never
        numbers.add_column(name, justify="right" if number else "left", no_wrap=number > 0)
    for row in body:
        numbers.add_row(*row)
    words.add_column(style="dim", max_width=26, overflow="fold")
    for name, text in rows.items():
        words.add_row(name, Text(text, _style(name, text)))
    with console.capture() as shown:
        console.print(Text(title, "bold"), numbers, words, sep="\n")
    return "\n".join(line.rstrip() for line in shown.get().splitlines())


def _style(name: str, text: str) -> str:
    """The colour of a row: what is wrong or needs attention is seen at once."""
    if name == "status":
        return "green" if text.startswith("solved") else "bold red"
    return "yellow" if name.startswith("note ") else ""


class Lines:
    """Progress without a terminal: a line for each sentence, and sometimes one for counted work."""

    def __init__(self, title: str, total: int | None, done: int, quiet: bool = False) -> None:
        self.title, self.total, self.done, self.quiet = title, total, done, quiet
        self.said = time.monotonic()

    def note(self, text: str) -> None:
        """Say what is going on."""
        if not self.quiet:
            sys.stderr.write(f"  {text}\n")
            sys.stderr.flush()

    def count(self, words: str = "") -> None:
        """Another piece is done."""
        self.done += 1
        if time.monotonic() - self.said > PAUSE:
            self.said = time.monotonic()
            self.note(f"{self.title}: {self.done} of {self.total}{words and f', {words}'}")


class Bar(Lines):
    """Progress on a terminal: one line that changes, with the time and, if known, what is left."""

    def __init__(self, title: str, total: int | None, done: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.progress import TimeRemainingColumn as Remaining
        from rich.table import Column

        super().__init__(title, total, done)
        shown = BarColumn(20), TimeElapsedColumn(), Remaining(compact=True)
        room = Column(ratio=1, no_wrap=True)  # the words are cut, not the bar
        words = TextColumn("{task.description}", markup=False, table_column=room)
        look: dict[str, Any] = {"transient": True, "redirect_stdout": False, "expand": True}
        where = Console(stderr=True)
        self.drawn = Progress(*shown, words, console=where, refresh_per_second=4, **look)
        self.task = self.drawn.add_task(title, total=total, completed=done)
        self.late = threading.Timer(PATIENCE, self.drawn.start)
        self.late.daemon, self.step = True, ""
        self.late.start()

    def note(self, text: str) -> None:
        if step := STEPS.match(text):
            self.step = f"{text}; "
            if step[2]:
                self.drawn.update(self.task, completed=int(step[1]), total=int(step[2]))
        now = self.step.removesuffix("; ") if step else self.step + text
        self.drawn.update(self.task, description=f"{self.title}: {now}")

    def count(self, words: str = "") -> None:
        self.done += 1
        said = f"{self.title}: {self.done} of {self.total}{words and f', {words}'}"
        self.drawn.update(self.task, completed=self.done, description=said)

    def close(self) -> None:
        """Wipe the line."""
        self.late.cancel()
        self.late.join()
        self.drawn.stop()


@contextmanager
def progress(
    title: str, total: int | None = None, done: int = 0, quiet: bool = False, lines: bool = False
) -> Iterator[Lines]:
    """Show on the standard error how work goes on: as a bar on a terminal, else, or if that is
    wanted, in lines; nothing if it shall be quiet. Counted work has a total, of which some is done.
    """
    if lines or quiet or not sys.stderr.isatty():
        yield Lines(title, total, done, quiet)
        return
    bar = Bar(title, total, done)
    try:
        yield bar
    finally:
        bar.close()
