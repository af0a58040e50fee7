#!/usr/bin/env python3
"""Saves a screenshot of glimt in a tmux terminal as an image.

    python3 benches/terminal/screen.py [SCENE] [--columns N] [--rows N] [--keys KEYS] [-o FILE] [--glimt BINARY]

Defaults: scenes/cornell_glass.toml, 120 by 36 cells, with photons (p), assets/pictures/screen.png. The script waits until the image is
done, types the keys, and waits for the result. Needs tmux, Pillow, and the font DejaVu Sans Mono.
"""

import argparse
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent.parent
FONT = "/usr/share/fonts/truetype/dejavu/DejaVuSansMono.ttf"
# Pixels per cell.
WIDTH, HEIGHT = 9, 18
PLAIN = ((204, 204, 204), (16, 18, 22))
PALETTE = [(16, 18, 22), (222, 84, 84), (96, 190, 96), (214, 178, 74), (88, 138, 222), (188, 110, 200), (84, 186, 190), (204, 204, 204)]
# The filled quarters of a cell: top left, top right, bottom left, bottom right.
QUARTERS = dict(zip("▀▄█▌▐▘▝▖▗▚▞▛▜▙▟", ["1100", "0011", "1111", "1010", "0101", "1000", "0100", "0010", "0001", "1001", "0110", "1110", "1101", "1011", "0111"]))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, default=Path("scenes/cornell_glass.toml"))
    parser.add_argument("--columns", type=int, default=120)
    parser.add_argument("--rows", type=int, default=36)
    parser.add_argument("--keys", default="p")
    parser.add_argument("-o", dest="output", type=Path, default=ROOT / "assets" / "pictures" / "screen.png")
    parser.add_argument("--glimt", type=Path, default=ROOT / "target" / "release" / "glimt")
    return parser.parse_args()


def shown(args):
    """Returns the text of the terminal, with color sequences."""
    with tempfile.TemporaryDirectory() as folder:
        tmux = ["tmux", "-S", f"{folder}/socket", "-f", "/dev/null"]

        def call(*words):
            return subprocess.run([*tmux, *words], check=True, capture_output=True, text=True).stdout

        size = ["-x", str(args.columns), "-y", str(args.rows)]
        for name in ("scenes", "assets"):
            os.symlink(ROOT / name, f"{folder}/{name}")
        program = f"cd {folder} && COLORTERM=truecolor {args.glimt.absolute()} {args.scene}"
        call("new-session", "-d", *size, program)
        try:
            call("set", "-g", "status", "off")
            wait(call)
            for key in args.keys:
                call("send-keys", "-l", key)
                wait(call)
            return call("capture-pane", "-e", "-N", "-p")
        finally:
            call("kill-server")


def wait(call):
    """Waits until the screen shows that the image is done, and no longer changes."""
    before = None
    while "done" not in (now := call("capture-pane", "-p")) or now != before:
        before = now
        time.sleep(0.5)


def color(words):
    """Returns the color encoded in an SGR sequence, and how many numbers encode it."""
    if words[1] == 2:
        return tuple(words[2:5]), 5
    index = words[2]
    if index < 16:
        return PALETTE[index % 8], 3
    if index < 232:
        level = [0, 95, 135, 175, 215, 255]
        return tuple(level[(index - 16) // step % 6] for step in (36, 6, 1)), 3
    return (8 + 10 * (index - 232),) * 3, 3


def styled(text):
    """Yields characters with their colors, which persist from line to line."""
    ink, paper, is_bold, is_turned = *PLAIN, False, False
    for piece in re.split(r"(\x1b\[[0-9;]*m)", text):
        if not piece.startswith("\x1b["):
            for character in piece:
                yield character, *((paper, ink) if is_turned else (ink, paper)), is_bold
            continue
        words = [int(word or 0) for word in piece[2:-1].split(";")]
        while words:
            word, used = words[0], 1
            if word in (38, 48):
                chosen, used = color(words)
                ink, paper = (chosen, paper) if word == 38 else (ink, chosen)
            elif word == 0:
                ink, paper, is_bold, is_turned = *PLAIN, False, False
            elif word == 1:
                is_bold = True
            elif word == 2:
                ink = tuple(value * 6 // 10 for value in ink)
            elif word == 7:
                is_turned = True
            elif 30 <= word <= 37 or 90 <= word <= 97:
                ink = PALETTE[word % 10]
            elif 40 <= word <= 47:
                paper = PALETTE[word % 10]
            elif word in (39, 49):
                ink, paper = (PLAIN[0], paper) if word == 39 else (ink, PLAIN[1])
            words = words[used:]


def drawn(text, columns, rows):
    image = Image.new("RGB", (columns * WIDTH, rows * HEIGHT), PLAIN[1])
    draw = ImageDraw.Draw(image)
    fonts = [ImageFont.truetype(FONT.replace("Mono.", f"Mono{kind}."), 15) for kind in ("", "-Bold")]
    row = column = 0
    for character, ink, paper, is_bold in styled(text):
        if character == "\n":
            row, column = row + 1, 0
            continue
        left, top = column * WIDTH, row * HEIGHT
        column += 1
        draw.rectangle((left, top, left + WIDTH - 1, top + HEIGHT - 1), fill=paper)
        if character in QUARTERS:
            for index, is_ink in enumerate(QUARTERS[character]):
                x, y = left + index % 2 * (WIDTH // 2), top + index // 2 * (HEIGHT // 2)
                if is_ink == "1":
                    right = left + WIDTH - 1 if index % 2 else x + WIDTH // 2 - 1
                    draw.rectangle((x, y, right, y + HEIGHT // 2 - 1), fill=ink)
        elif character != " ":
            draw.text((left, top), character, fill=ink, font=fonts[is_bold])
    return image


def main():
    args = arguments()
    drawn(shown(args), args.columns, args.rows).save(args.output, optimize=True)


if __name__ == "__main__":
    main()
