"""The reference of the command line, made from the commands.

``python docs/_site/commands.py`` writes docs/reference/commands.md anew.
"""

from __future__ import annotations

import inspect
from pathlib import Path

import click

from nldyn.app.cli import main

PAGE = Path(__file__).resolve().parents[1] / "reference" / "commands.md"
HEAD = """# Commands

Made from the commands themselves. Exit codes: 0 done, 1 no periodic orbit was found, 2 something in
the scene or on the command line is wrong, 3 a picture or an animation needs something that is not
installed, 130 stopped with Ctrl-C.
"""


def reference() -> str:
    """All commands with their arguments and options, as Markdown.

    Examples
    --------
    >>> reference().splitlines()[0]
    '# Commands'
    """
    return "\n".join([HEAD, *(command_text(name, main.commands[name]) for name in main.commands)])


def command_text(name: str, command: click.Command) -> str:
    """One command."""
    context = click.Context(command, info_name=f"nldyn {name}")
    usage = " ".join(command.collect_usage_pieces(context))
    options = [p for p in command.params if isinstance(p, click.Option)]
    told = [record for p in options if (record := p.get_help_record(context)) is not None]
    rows = [f"| `{flags}` | {cell(text)} |" for flags, text in told]
    table = ["| option | meaning |", "|---|---|", *rows, ""] if rows else []
    text = inspect.cleandoc(command.help or "")
    return "\n".join([f"## nldyn {name}\n", f"```\nnldyn {name} {usage}\n```\n", text, "", *table])


def cell(text: str) -> str:
    """A text in a cell of a table.

    Examples
    --------
    >>> cell("a | b")
    'a \\\\| b'
    """
    return text.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8")
