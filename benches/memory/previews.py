#!/usr/bin/env python3
"""Measures the memory that previews use in large terminals: maximum resident memory for each kind of preview and window size.

    python3 benches/memory/previews.py [--program target/release/glimt]

The terminal is a pseudo-terminal that answers queries immediately and draws nothing. Half blocks show the memory without pixels.
"""

import argparse
import fcntl
import os
import pty
import select
import struct
import subprocess
import tempfile
import termios
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
SECONDS = 12
# Columns, rows, width and height of a cell in pixels.
WINDOWS = [(120, 40, 8, 16), (400, 120, 20, 40), (600, 200, 20, 40)]
ANSWERS = [(b"\x1b[5n", b"\x1b[0n"), (b"\x1b[c", b"\x1b[?62;4;22c")]


def max_memory(process):
    """The maximum resident memory so far, in bytes; 0 after the process has ended."""
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    return max((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), default=0)


def watched(program, preview, window, folder):
    """Returns the maximum memory, and the bytes sent during the first seconds of a render."""
    columns, rows, width, height = window
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, columns * width, rows * height))
    environment = {name: value for name, value in os.environ.items() if name not in ("TMUX", "TERM_PROGRAM", "SSH_CONNECTION")}
    environment |= {"TERM": "xterm-256color", "COLORTERM": "truecolor"}
    command = [program, ROOT / "scenes" / "cornell_glass.toml", "--samples", "64", "-o", Path(folder) / "x.png", "--preview", preview]
    process = subprocess.Popen([str(word) for word in command], stdin=slave, stdout=slave, stderr=slave, env=environment,
                               start_new_session=True)
    begin, tail, most, sent = time.monotonic(), b"", 0, 0
    while time.monotonic() < begin + SECONDS:
        if select.select([master], [], [], 0.05)[0]:
            came = os.read(master, 1 << 16)
            sent += len(came)
            for question, answer in ANSWERS:
                # Queries in the tail were already answered.
                for _ in range((tail + came).count(question) - tail.count(question)):
                    os.write(master, answer)
            tail = (tail + came)[-8:]
        most = max(most, max_memory(process))
    process.kill()
    process.wait()
    os.close(master)
    os.close(slave)
    return most, sent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=str(ROOT / "target" / "release" / "glimt"))
    args = parser.parse_args()
    print(f"{'columns × rows of cells':32}{'preview':12}{'MB':>8}{'MB sent':>10}")
    for window in WINDOWS:
        for preview in ["halfblock", "kitty", "sixel"]:
            with tempfile.TemporaryDirectory() as folder:
                most, sent = watched(args.program, preview, window, folder)
            name = "{} × {} of {} × {} pixels".format(*window)
            print(f"{name:32}{preview:12}{most / 1e6:8.0f}{sent / 1e6:10.1f}", flush=True)


if __name__ == "__main__":
    main()
