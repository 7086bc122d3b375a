"""Every command of `bayesid` with its own help text, from the tree of commands. Runs none of them."""

from __future__ import annotations

from typing import Any

from _generate.markdown import code, fenced, plain, table
from bayesid.cli.main import command

WIDTH = 100


def tree(found: Any = None, words: tuple[str, ...] = ("bayesid",)) -> list[tuple[tuple[str, ...], Any]]:
    """(words, command) of every command that does something, in the order of the help."""
    found = command() if found is None else found
    below = getattr(found, "commands", None)
    if below is None:
        return [(words, found)]
    return [leaf for name, part in below.items() for leaf in tree(part, (*words, name))]


def help_text(words: tuple[str, ...], leaf: Any) -> str:
    """What `--help` prints."""
    context, group = None, command()
    for word in words[:-1]:
        context = group.context_class(group, info_name=word, parent=context)
        group = group.commands.get(words[1], group)
    settings = {"terminal_width": WIDTH, "max_content_width": WIDTH, "help_option_names": ["-h", "--help"]}
    return leaf.get_help(leaf.context_class(leaf, info_name=words[-1], parent=context, **settings))


def commands() -> str:
    """A table of all commands, then the help of each."""
    leaves = tree()
    rows = [
        [f"[`{' '.join(words)}`](#{'-'.join(words)})", plain((leaf.help or "").strip().split("\n\n")[0])]
        for words, leaf in leaves
    ]
    out = [table(("command", "what it does"), rows)]
    for words, leaf in leaves:
        out += [f"({'-'.join(words)})=", f"## {code(' '.join(words))}", fenced(help_text(words, leaf))]
    return "\n\n".join(out)


def exit_codes() -> str:
    """The codes by which a script knows how a command ended."""
    rows = [
        ["0", "ok; a check that a prediction failed is in its first lines"],
        ["1", "a fault of the program, or a worker process was killed"],
        ["2", "usage or bad input; the message says what, where and what to do"],
        [
            "3",
            "not converged, not determined by data and prior, a failed check of a diagnosis, a vehicle that "
            "`vehicle check` finds unphysical, or a question",
        ],
        [
            "4",
            "the log does not say what its header says: `trial check`, `fit`, `sample`, `predict`, verdict "
            "`input` of `diagnose`",
        ],
        ["130, 143", "stopped; what was done is kept, and the same command goes on from there"],
    ]
    return table(("code", "meaning"), rows)
