#!/usr/bin/env python3
"""Records an animation of glimt next to an editor: each save updates the preview.

    python3 benches/terminal/moving.py [-o FILE] [--glimt BINARY] [--frames FOLDER]

The default output is assets/pictures/save.png, an animated PNG. The scene is the one that `glimt new` writes, with 16 samples per pixel.
vim and glimt run in two panes of tmux; the script types into vim and captures both screens ten times per second. Delays after
a save are real; unchanged screens are cut to 1.6 s, and typed letters to 0.08 s. --frames also writes each frame as a file. Needs tmux, vim,
Pillow, and the font DejaVu Sans Mono.
"""

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

from PIL import Image, ImageChops

from screen import HEIGHT, PLAIN, ROOT, WIDTH, drawn

EDITOR, PICTURE, ROWS = 48, 72, 26
# Keys typed into vim before each save, and the text that glimt must then show.
EDITS = [
    ("/b5532e\rci\"seagreen\x1b", "done"),
    ("/0.9, 1.2\rci[0.9, 2.2, 0.9\x1b", "done"),
    ("?^radius\rcwraduis\x1b", "error"),
    ("u", "done"),
]
# Maximum seconds for a typed letter and for an unchanged screen.
TYPED, STILL = 0.08, 1.6


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", dest="output", type=Path, default=ROOT / "assets" / "pictures" / "save.png")
    parser.add_argument("--glimt", type=Path, default=ROOT / "target" / "release" / "glimt")
    parser.add_argument("--frames", type=Path)
    return parser.parse_args()


class Stage:
    """Two terminal panes, and their recorded screens."""

    def __init__(self, folder, glimt):
        self.tmux = ["tmux", "-S", f"{folder}/socket", "-f", "/dev/null"]
        self.taken = []
        size = ["-x", str(EDITOR + PICTURE + 1), "-y", str(ROWS)]
        settings = "set nowrap noswapfile noshowcmd laststatus=0 noruler incsearch shortmess+=sI"
        vim = f"vim -u NONE -i NONE -N -c '{settings}' -c 'syntax on' -c '/materials.clay' -c 'normal zt' first.toml"
        self.call("new-session", "-d", *size, f"cd {folder} && TERM=tmux-256color {vim}")
        self.call("set", "-g", "status", "off")
        run = f"cd {folder} && COLORTERM=truecolor {glimt.absolute()} first.toml --samples 16"
        self.call("split-window", "-h", "-l", str(PICTURE), run)

    def call(self, *words):
        return subprocess.run([*self.tmux, *words], check=True, capture_output=True, text=True).stdout

    def take(self, most):
        """Captures both screens, the editor's cursor, the time, and the maximum duration."""
        screens = [self.call("capture-pane", "-e", "-N", "-p", "-t", pane) for pane in ("0.0", "0.1")]
        x, y = self.call("display-message", "-p", "-t", "0.0", "#{cursor_x} #{cursor_y}").split()
        self.taken.append((time.monotonic(), most, (screens, int(x), int(y))))

    def watch(self, seconds, word=None):
        """Captures screens for `seconds`, and then until glimt shows `word`."""
        end = time.monotonic() + seconds
        while time.monotonic() < end or word and word not in self.call("capture-pane", "-p", "-t", "0.1"):
            self.take(STILL)
            time.sleep(0.05)

    def write(self, text):
        for character in text:
            self.call("send-keys", "-t", "0.0", "-l", character)
            time.sleep(0.03)
            self.take(TYPED)


def play(folder, glimt):
    subprocess.run([glimt.absolute(), "new", "first.toml"], cwd=folder, check=True, capture_output=True)
    stage = Stage(folder, glimt)
    try:
        stage.watch(0.5, "done")
        # The first screens show the programs starting.
        del stage.taken[:-1]
        stage.watch(1)
        for edit, word in EDITS:
            stage.write(edit)
            stage.watch(0.5)
            stage.write(":w\r")
            stage.watch(2.5, word)
        return stage.taken
    finally:
        stage.call("kill-server")


def frame(screens, x, y):
    """Draws both panes side by side, with the cursor's cell in reverse video."""
    panes = [drawn(text, columns, ROWS) for text, columns in zip(screens, (EDITOR, PICTURE))]
    place = (x * WIDTH, y * HEIGHT, (x + 1) * WIDTH, (y + 1) * HEIGHT)
    panes[0].paste(ImageChops.invert(panes[0].crop(place)), place)
    image = Image.new("RGB", ((EDITOR + PICTURE + 1) * WIDTH, ROWS * HEIGHT), PLAIN[1])
    image.paste(panes[0], (0, 0))
    image.paste((70, 74, 82), (EDITOR * WIDTH + WIDTH // 2, 0, EDITOR * WIDTH + WIDTH // 2 + 1, ROWS * HEIGHT))
    image.paste(panes[1], ((EDITOR + 1) * WIDTH, 0))
    return image


def distinct_frames(taken):
    """Returns the distinct frames and their durations in milliseconds."""
    frames, times = [], []
    for index, (at, most, seen) in enumerate(taken):
        image = frame(*seen)
        until = taken[index + 1][0] if index + 1 < len(taken) else at + STILL
        seconds = min(until - at, most)
        if frames and not ImageChops.difference(frames[-1], image).getbbox():
            times[-1] += seconds
        else:
            frames.append(image)
            times.append(seconds)
    return frames, [int(1000 * min(seconds, STILL)) for seconds in times]


def main():
    args = arguments()
    with tempfile.TemporaryDirectory() as folder:
        frames, times = distinct_frames(play(folder, args.glimt))
    # Compute one palette for all frames from a dozen of them.
    some = frames[:: max(1, len(frames) // 12)]
    strip = Image.new("RGB", (frames[0].width, frames[0].height * len(some)))
    for index, image in enumerate(some):
        strip.paste(image, (0, index * image.height))
    palette = strip.quantize(256, method=Image.Quantize.MEDIANCUT)
    frames = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in frames]
    if args.frames:
        args.frames.mkdir(exist_ok=True, parents=True)
        for index, (image, milliseconds) in enumerate(zip(frames, times)):
            image.save(args.frames / f"{index:03}_{milliseconds}ms.png")
    frames[0].save(args.output, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True)
    print(f"{args.output}: {len(frames)} frames, {sum(times) / 1000:.1f} s, {args.output.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
