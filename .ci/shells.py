#!/usr/bin/env python3
"""Tests completions of glimt in bash, zsh and fish by typing command lines in a pseudo-terminal.

A stand-in for glimt records the arguments with which the shell finally calls it; the completions come from the real program. Shells that
are not installed are reported and skipped, unless they are named on the command line:

    python3 .ci/shells.py target/release/glimt
    python3 .ci/shells.py target/release/glimt bash zsh fish
"""

import os
import pathlib
import pty
import select
import shutil
import signal
import sys
import tempfile
import time

# Seconds that a busy machine may take for one line.
TIMEOUT = 120
PROMPT = "ready to type"
SCENE = """[camera]
position = [0, 1, 4]
look_at = [0, 1, 0]

[materials.wall]
[materials.window]
type = "glass"
[materials."sp ace"]
[materials."$(touch HACKED)"]
[materials."`touch HACKED`"]

[[sphere]]
name = "ball"
center = [0, 1, 0]
radius = 0.5
material = "wall"
"""
# Typed keys, and the resulting arguments; `\t` completes.
LINES = [
    ("glimt compl\t", ["completions"]),
    ("glimt ba\t", ["ball.toml"]),
    ("glimt check ba\t", ["check", "ball.toml"]),
    ("glimt kn\t", ["knot.obj"]),
    ("glimt ball.toml --integ\tp\t", ["ball.toml", "--integrator", "path"]),
    ("glimt ball.toml --integrator=wh\t", ["ball.toml", "--integrator=whitted"]),
    ("glimt ball.toml --set materials.wall.spec\ttomat\t", ["ball.toml", "--set", "materials.wall.specular=tomato"]),
    ("glimt ball.toml --set render.integ\tp\t", ["ball.toml", "--set", "render.integrator=path"]),
    ("glimt ball.toml --set=photons.en\tt\t", ["ball.toml", "--set=photons.enabled=true"]),
    ("glimt ball.toml --set sphere.ball.mate\twi\t", ["ball.toml", "--set", "sphere.ball.material=window"]),
    ("glimt explain materials.metal.anis\t", ["explain", "materials.metal.anisotropy"]),
]
# File names with special characters, by the keys that complete to them.
NAMES = {
    "My": "My scene.toml",
    "X": "X$(touch HACKED).toml",
    "Y": "Y`touch HACKED`.toml",
    "W": "W;touch HACKED;.toml",
    "T": "T'q.toml",
    "R": 'R"q.toml',
    "K": "K*.toml",
}
LINES += [(f"glimt check {keys}\t", ["check", name]) for keys, name in NAMES.items()]
LINES += [("glimt ball.toml --set sphere.ball.material=sp\t", ["ball.toml", "--set", "sphere.ball.material=sp ace"])]
# Quoted words, which the scripts for zsh and fish do not complete.
QUOTED = [
    ("glimt check F\tin\t", ["check", "F older/in side.toml"]),
    ("glimt check My\\ s\t", ["check", "My scene.toml"]),
    ("glimt check 'My s\t", ["check", "My scene.toml"]),
    ('glimt check "My s\t', ["check", "My scene.toml"]),
    ("glimt check 'X\t", ["check", NAMES["X"]]),
    ('glimt check "X\t', ["check", NAMES["X"]]),
    ('glimt check "Y\t', ["check", NAMES["Y"]]),
    ("glimt check 'T\t", ["check", NAMES["T"]]),
    ('glimt check "R\t', ["check", NAMES["R"]]),
    ("glimt ball.toml --set=sphere.ball.material=\\$\t", ["ball.toml", "--set=sphere.ball.material=$(touch HACKED)"]),
    ("glimt ball.toml --set sphere.ball.material=\\`\t", ["ball.toml", "--set", "sphere.ball.material=`touch HACKED`"]),
]
# Typed keys, and the words that the shell must list.
LISTS = [
    ("glimt ball.toml --integrator \t\t", ["whitted", "path"]),
    ("glimt ball.toml --set render.integrator=\t\t", ["whitted", "path"]),
]
FAKE_GLIMT = """#!/bin/sh
if [ -n "$GLIMT_COMPLETE" ] || [ "$1" = completions -a -n "$2" ]; then exec {program} "$@"; fi
printf '%s\\n' "$@" > "$GLIMT_CALL.new"
mv "$GLIMT_CALL.new" "$GLIMT_CALL"
"""


class Shell:
    """A shell with the completions loaded, at its prompt."""

    def __init__(self, name, folder):
        self.call = folder / "call"
        home = folder / f"home-of-{name}".replace(" ", "-")
        home.mkdir(exist_ok=True)
        begin = {
            "bash": f"PS1='{PROMPT} '\nsource <(glimt completions bash)\n",
            "zsh": f"PS1='{PROMPT} '\nautoload -U compinit\ncompinit -u -d {home}/dump\nsource <(glimt completions zsh)\n",
            # As packages install it: a file in a folder of fpath.
            "zsh of a package": f"PS1='{PROMPT} '\nglimt completions zsh > {home}/_glimt\nfpath+=({home})\n"
            f"autoload -U compinit\ncompinit -u -d {home}/dump\n",
            "fish": f"function fish_prompt; echo '{PROMPT} '; end\nglimt completions fish | source\n",
        }[name]
        (home / ".zshrc").write_text(begin)
        words = {
            "bash": ["bash", "--noprofile", "--rcfile", str(home / ".zshrc"), "-i"],
            "zsh": ["zsh", "-i"],
            "zsh of a package": ["zsh", "-i"],
            "fish": ["fish", "--no-config", "--init-command", begin, "-i"],
        }[name]
        environment = dict(
            os.environ, HOME=str(home), ZDOTDIR=str(home), TERM="xterm", GLIMT_CALL=str(self.call), LC_ALL="C.UTF-8",
            PATH=f"{folder / 'bin'}:{os.environ['PATH']}", XDG_CONFIG_HOME=str(home), XDG_DATA_HOME=str(home),
        )
        self.screen = ""
        self.child, self.end = pty.fork()
        if self.child == 0:
            os.chdir(folder)
            os.execvpe(words[0], words, environment)
        self.wait(lambda: PROMPT in self.screen, "its prompt")

    def wait(self, holds, what):
        """Reads the screen until a condition holds."""
        deadline = time.monotonic() + TIMEOUT
        while not holds():
            if time.monotonic() > deadline:
                raise TimeoutError(f"timed out waiting for {what}; the screen shows {self.screen[-400:]!r}")
            if select.select([self.end], [], [], 0.05)[0]:
                try:
                    self.screen += os.read(self.end, 65536).decode(errors="replace")
                except OSError:
                    raise TimeoutError(f"the shell exited before {what}: {self.screen[-400:]!r}") from None

    def type(self, keys):
        self.screen = ""
        os.write(self.end, keys.encode())

    def close(self):
        os.close(self.end)
        try:
            os.kill(self.child, signal.SIGKILL)
        except ProcessLookupError:
            pass
        os.waitpid(self.child, 0)


def words_of(name, folder, keys):
    """The arguments of the call that typed keys make."""
    shell = Shell(name, folder)
    try:
        shell.call.unlink(missing_ok=True)
        shell.type(keys + "\r")
        shell.wait(shell.call.exists, "a call")
        return shell.call.read_text().split("\n")[:-1]
    finally:
        shell.close()


def shows(name, folder, keys, wanted):
    """Waits until the shell lists words after typed keys."""
    shell = Shell(name, folder)
    try:
        shell.type(keys)
        shell.wait(lambda: all(word in shell.screen for word in wanted), f"a list of {wanted}")
    finally:
        shell.close()


def main():
    program, wanted = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2:]
    faults = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        (folder / "bin").mkdir()
        (folder / "bin" / "glimt").write_text(FAKE_GLIMT.format(program=f"'{program}'"))
        (folder / "bin" / "glimt").chmod(0o755)
        (folder / "ball.toml").write_text(SCENE)
        (folder / "F older").mkdir()
        for other in ["knot.obj", "bark.txt", "known.png", "F older/in side.toml", *NAMES.values()]:
            (folder / other).write_text("")
        for shell in wanted or ["bash", "zsh", "zsh of a package", "fish"]:
            if not shutil.which(shell.split()[0]):
                print(f"{shell}: not installed")
                faults += [f"{shell} is not installed"] if wanted else []
                continue
            before = len(faults)
            lines = LINES + (QUOTED if shell == "bash" else [])
            for keys, expected in lines:
                try:
                    found = words_of(shell, folder, keys)
                except TimeoutError as error:
                    found = str(error)
                if (folder / "HACKED").exists():
                    (folder / "HACKED").unlink()
                    found = f"{found}, and executed code from a file name"
                if found != expected:
                    faults.append(f"{shell}: {keys!r} gives {found}, expected {expected}")
            for keys, listed in LISTS:
                try:
                    shows(shell, folder, keys, listed)
                except TimeoutError as error:
                    faults.append(f"{shell}: {keys!r}: {error}")
            right = len(lines) + len(LISTS) - (len(faults) - before)
            print(f"{shell}: {right} of {len(lines) + len(LISTS)} lines complete")
    print("\n".join(faults), end="\n" if faults else "")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
