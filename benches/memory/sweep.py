#!/usr/bin/env python3
"""Runs the program with limits on its address space, headless and in a pseudo-terminal.

    python3 benches/memory/sweep.py [--program target/release/glimt] [--runs 200] [--csv FILE] [SCENE…]

Every run must end with exit code 0, 1 or 2 (127 if the loader itself runs out of memory) and a message if the code is not 0, and must restore
the terminal: keys are echoed, lines can be edited, the shell's screen is shown.
"""

import argparse
import collections
import csv
import os
import pty
import resource
import select
import signal
import subprocess
import sys
import tempfile
import termios
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
SCENES = ["cornell", "cornell_glass", "lamps", "mesh", "photons", "shapes", "textures", "million"]
MIN_BYTES, MAX_BYTES = 30e6, 1e9
SECONDS = 20
ALLOWED = {0, 1, 2}


def limited(size):
    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    return limit


def headless(program, scene, size, folder):
    command = [program, scene, "--once", "--width", "160", "--height", "120", "--samples", "4", "--progress", "none",
               "-o", os.path.join(folder, "x.png")]
    run = subprocess.run(command, preexec_fn=limited(size), capture_output=True, text=True, cwd=folder)
    faults = []
    if run.returncode not in ALLOWED and run.returncode != 127:
        faults.append(f"exit {run.returncode}")
    if run.returncode in (1, 2) and "error" not in run.stderr:
        faults.append("no error message")
    return run.returncode, faults, run.stderr.strip().splitlines()[-1:] or [""]


def in_terminal(program, scene, size, folder):
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    command = [program, scene, "--width", "160", "--height", "120", "--samples", "4", "-o", os.path.join(folder, "y.png")]
    child = subprocess.Popen(command, preexec_fn=lambda: (os.setsid(), limited(size)()), stdin=slave, stdout=slave,
                             stderr=slave, cwd=folder)
    seen, start, args = b"", time.monotonic(), False
    while child.poll() is None and time.monotonic() - start < SECONDS:
        if select.select([master], [], [], 0.05)[0]:
            seen += os.read(master, 1 << 16)
        # By now, an image or an error is shown: quit.
        if not args and time.monotonic() - start > 2.5:
            os.write(master, b"q")
            args = True
    faults = []
    if child.poll() is None:
        faults.append("hangs")
        child.send_signal(signal.SIGKILL)
    code = child.wait()
    while select.select([master], [], [], 0.1)[0]:
        seen += os.read(master, 1 << 16)
    after = termios.tcgetattr(slave)
    if code not in ALLOWED and code != 127:
        faults.append(f"exit {code}")
    if after[3] & (termios.ECHO | termios.ICANON) != before[3] & (termios.ECHO | termios.ICANON):
        faults.append("terminal left in raw mode")
    if seen.rfind(b"\x1b[?1049h") > seen.rfind(b"\x1b[?1049l"):
        faults.append("alternate screen left on")
    os.close(master)
    os.close(slave)
    return code, faults, [seen[-120:].decode("utf-8", "replace")]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=str(ROOT / "target/release/glimt"))
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--csv")
    parser.add_argument("scenes", nargs="*", default=[str(ROOT / f"scenes/{name}.toml") for name in SCENES])
    args = parser.parse_args()
    ways = {"once": headless, "terminal": in_terminal}
    each = max(1, args.runs // (len(args.scenes) * len(ways)))
    rows, wrong = [], 0
    with tempfile.TemporaryDirectory() as folder:
        for method, run in ways.items():
            for scene in map(os.path.abspath, args.scenes):
                for step in range(each):
                    size = int(MIN_BYTES * (MAX_BYTES / MIN_BYTES) ** ((step + 0.5) / each))
                    code, faults, said = run(os.path.abspath(args.program), scene, size, folder)
                    rows.append((method, Path(scene).stem, size, code, "; ".join(faults)))
                    wrong += bool(faults)
                    if faults:
                        print(method, Path(scene).stem, f"{size / 1e6:.0f} MB", code, faults, said, flush=True)
    for method in ways:
        codes = collections.Counter(row[3] for row in rows if row[0] == method)
        print(f"{method}: " + ", ".join(f"{count} × exit code {code}" for code, count in sorted(codes.items())))
    print(f"{len(rows)} runs, {wrong} wrong")
    if args.csv:
        with open(args.csv, "w", newline="") as file:
            csv.writer(file).writerows([("method", "scene", "bytes", "code", "faults"), *rows])
    sys.exit(1 if wrong else 0)


main()
