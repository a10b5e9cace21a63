"""The commands of the documentation: found, run in this process, and compared with the output that a page shows.

python -m tests.documented_commands docs/use/tutorial.md     # renew the outputs that a page shows
"""

import contextlib
import importlib
import io
import os
import re
import shlex
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import typer

ROOT = Path(__file__).parent.parent
TUTORIAL = ROOT / "docs" / "use" / "tutorial.md"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*/*.md"))]
MODULES = {
    "analyze": "flightpower.analysis.cli.analyze",
    "calibrate": "flightpower.analysis.cli.calibrate",
    "sim": "flightpower.simulate",
    "daq": "flightpower.daq.__main__",
    "flightpower": "flightpower.command",
}
SHELL = ("", "sh", "bash", "console")
OTHERS = {
    "python", "python3", "py", "pip", "uv", "make", "dask", "apt-get", "systemctl", "journalctl", "rsync", "i2cdetect",
    "install.sh", "uninstall.sh",
}  # fmt: skip
PROGRAM = re.compile(r"(?:sudo )?(?:[^\s\"'=]*[/\\])?([\w.-]+)( [^(].*)")  # with at least one more word
DRAWN = "──"  # a block that contains this is a drawing
COMPLETION = ("--install-completion", "--show-completion")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_BEFORE = re.compile(r"`([\w.-]+)`:\s*\Z")
UNCOMMENT = re.compile(r"In `([\w.-]+)` remove the `# ` before `([^`]+)`")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?")
VERSION = re.compile(r"(?<=\bsoftware )\S+")
LOOP = re.compile(r"for (\w+) in ([^;]+); do ([^;]+); done")
BORDER = re.compile(r"[─━]+")


class Step(NamedTuple):
    """Something that a page asks for: a command with its output, a file to write, or a line to uncomment."""

    command: str = ""
    shown: tuple[str, ...] = ()
    file: str = ""
    text: str = ""
    uncomment: str = ""


class Walk(NamedTuple):
    """What a reader of a page did: the folder, and each step with what it printed."""

    folder: Path
    steps: list[tuple[Step, list[str]]]


def commands_in(page: Path) -> list[str]:
    """Commands of our programs in the fenced blocks of a page."""
    blocks = [body for language, body in FENCE.findall(page.read_text("utf-8")) if language in SHELL]
    lines = [line.removeprefix("$ ").strip() for body in blocks if DRAWN not in body for line in body.splitlines()]
    commands = [item for line in lines for item in every_one_of(line)]
    return [command for command in commands if command.split() and command.split()[0] in MODULES]


def every_command_in(page: Path) -> list[str]:
    """Commands of any program in the fenced and indented blocks of a page, without folder, sudo and comment."""
    fenced, lines = False, []
    for line in page.read_text("utf-8").splitlines():
        fence = line.strip().startswith("```")
        fenced ^= fence
        if not fence and (fenced or line.startswith("    ")):
            lines += every_one_of(line.strip().removeprefix("$ "))
    matches = (PROGRAM.match(" ".join(line.split("  #")[0].split())) for line in lines)
    return [match[1] + match[2] for match in matches if match and match[1] in OTHERS | MODULES.keys()]


def mentions_in(page: Path) -> list[str]:
    """Commands of our programs in backticks, with at least a word after their name; they may lack arguments."""
    words = re.findall(r"`([^`\n]+ [^`\n]+)`", FENCE.sub("", page.read_text("utf-8")))
    return [command for command in words if command.split()[0] in MODULES and "…" not in command]


def arguments_of(command: str) -> list[str]:
    """The words of a command, without a comment."""
    return shlex.split(command, comments=True)


def every_one_of(command: str) -> list[str]:
    """The commands of a shell loop, or the command itself."""
    loop = LOOP.fullmatch(command)
    return [loop[3].replace(f"${loop[1]}", value) for value in loop[2].split()] if loop else [command]


def steps_in(page: Path) -> list[Step]:
    """What a page's reader does, in order."""
    text = page.read_text("utf-8")
    result: list[tuple[int, Step]] = []
    for block in FENCE.finditer(text):
        before = FILE_BEFORE.search(text[: block.start()])
        if block[1] == "console":
            result += [(block.start(), Step(command=c, shown=tuple(o))) for c, o in _sessions(block[2])]
        elif block[1] == "toml" and before:
            result.append((block.start(), Step(file=before[1], text=block[2])))
    result += [(edit.start(), Step(file=edit[1], uncomment=edit[2])) for edit in UNCOMMENT.finditer(text)]
    return [step for _, step in sorted(result, key=lambda item: item[0])]


def _sessions(body: str) -> list[tuple[str, list[str]]]:
    """Commands (after "$ ") with the lines that follow them."""
    sessions: list[tuple[str, list[str]]] = []
    for line in body.splitlines():
        if line.startswith("$ "):
            sessions.append((line.removeprefix("$ "), []))
        else:
            sessions[-1][1].append(line)
    return sessions


def run(command: str) -> tuple[int, list[str]]:
    """Exit code and lines of output of one of our commands, run in this process, 80 columns wide."""
    name, *arguments = arguments_of(command)
    main = importlib.import_module(MODULES[name]).main
    out, code = io.StringIO(), 0
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(out),
        mock.patch.object(sys, "argv", [name, *arguments]),
        mock.patch.dict(os.environ, {"COLUMNS": "80"}),
    ):
        try:
            main()
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, [line.rstrip() for line in out.getvalue().splitlines() if line.strip()]


def do(step: Step) -> list[str]:
    """Do a step in the working directory; return the output of its command, or of a loop's first and last commands."""
    if step.command:
        outputs = []
        for command in every_one_of(step.command):
            code, output = run(command)
            assert code == 0, f"{command}: exit code {code}: {output}"
            outputs.append(output)
        return outputs[0] if len(outputs) == 1 else [*outputs[0], "…", *outputs[-1]]
    path = Path(step.file)
    if step.uncomment:
        before = path.read_text("utf-8")
        assert f"# {step.uncomment}" in before, f"{path} has no line # {step.uncomment}"
        path.write_text(before.replace(f"# {step.uncomment}", step.uncomment), "utf-8")
    else:
        path.write_text(step.text, "utf-8")
    return []


def same(shown: str, printed: str) -> bool:
    """Whether words are equal and numbers are within 2 % or two units of their last digit; versions of software may
    differ."""
    shown, printed = VERSION.sub("x", shown), VERSION.sub("x", printed)
    if NUMBER.sub("#", BORDER.sub("-", shown)).split() != NUMBER.sub("#", BORDER.sub("-", printed)).split():
        return False
    return all(
        abs(float(a) - float(b)) <= 0.02 * abs(float(a)) + 2.1 * 10.0 ** -len(a.partition(".")[2])
        for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    )


def parse(command: str, *, complete: bool) -> None:
    """Check names and options of a command without running it, and also its arguments if it is `complete`.

    Raises typer's errors, or AssertionError for an unknown option.
    """
    name, *arguments = arguments_of(command)
    program: Any = typer.main.get_command(importlib.import_module(MODULES[name]).app)
    while hasattr(program, "resolve_command") and arguments and not arguments[0].startswith("-"):
        name, program, arguments = program.resolve_command(typer.Context(program), arguments)
    options = {option for parameter in program.params for option in (*parameter.opts, *parameter.secondary_opts)}
    unknown = [word for word in arguments if word.startswith("--") and word not in {*options, "--help", *COMPLETION}]
    assert not unknown, f"{command}: there is no option {unknown}"
    if complete:
        program.make_context(name, arguments)


def main(page: Path) -> None:
    """Do all steps of a page in a new folder, and put the outputs into the page."""
    text = page.read_text("utf-8")
    steps = steps_in(page)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        outputs = iter([do(step) for step in steps])
        commands = [output for step, output in zip(steps, outputs, strict=True) if step.command]
    queue = iter(commands)

    def renewed(block: re.Match[str]) -> str:
        if block[1] != "console":
            return block[0]
        lines = [line for command, _ in _sessions(block[2]) for line in (f"$ {command}", *next(queue))]
        return "```console\n" + "\n".join(lines) + "\n```"

    page.write_text(FENCE.sub(renewed, text), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
