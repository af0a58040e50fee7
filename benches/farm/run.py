#!/usr/bin/env python3
"""Measures renders in 1, 2, 4 and 8 parts: processor seconds, bytes per part, merge seconds. Extrapolates to 10,000 parts.

    python3 benches/farm/run.py [--program target/release/glimt] [--rounds 3] [--large] [SCENE ...]

Processor seconds are from the report's stages, so that other load on the machine matters little; each is the minimum of several rounds.
`work` is `photons` and `render`, `set-up` is everything before, `write` is the encoding of the part. `slowest` is the largest work of a
part divided by the mean. --large measures only 2560 x 1600 pixels in 8 parts.

The efficiency of N parts is the processor time of a single run divided by that of all parts and their merge:
(set-up + work + write) / (N set-up + work + N write + merge), where the merge has a term proportional to the bytes of the image and one
proportional to N. Work is distributed evenly over tiles of 32 x 32 pixels, and with photons over blocks of 16 passes: if there are more
parts than tiles, some are empty; if there are more parts than blocks, several parts trace the photons of each block.
"""

import argparse
import json
import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
SETUP = ("parse", "meshes", "textures", "accel", "lights")
COUNTS = (1, 2, 4, 8)
PART_COUNTS = (1, 10, 100, 1000, 10000)
# 16 blocks of photons for 8 parts.
OPTIONS = {"path": ["--samples", "64"], "photons": ["--samples", "256", "--width", "256", "--height", "256"]}
LARGE = ["--width", "2560", "--height", "1600"]
LARGE_SAMPLES = {"photons": ["--samples", "128", "--set", "photons.count=100000"]}


def measured(command, folder):
    """Runs a program; returns its processor seconds and wall-clock seconds."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, cwd=folder, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, time.perf_counter() - begin


def part(program, scene, options, index, count, folder):
    """Renders one part; returns its processor seconds by kind, and its bytes."""
    name = f"{count}.{index}.part"
    shard = ["--shard", f"{index}/{count}", "-o", name] if count > 1 else ["-o", "one.exr"]
    command = [program, scene, "--once", "--progress", "none", "--report", "report.json", "--checkpoint", "0"]
    total, _ = measured([*command, *shard, *options], folder)
    report = json.loads((Path(folder) / "report.json").read_text())
    seconds = {stage["name"]: stage["processor_seconds"] for stage in report["stages"]}
    size = os.path.getsize(Path(folder) / (name if count > 1 else "one.exr"))
    work, write = seconds["photons"] + seconds["render"], seconds["write"]
    # Everything outside the stages: start-up, report, exit.
    rest = total - sum(seconds.values())
    photons = report.get("photons") or {"seconds": 0.0, "passes": 0}
    tracing = photons["seconds"] / sum(stage["seconds"] for stage in report["stages"] if stage["name"] == "render")
    setup = sum(seconds[name] for name in SETUP) + rest
    blocks = -(-photons["passes"] // 16)
    return {"setup": setup, "work": work, "write": write, "bytes": size, "tracing": tracing, "blocks": blocks}


def minimum_of(rounds, measure):
    """Repeats a measurement; returns the minimum of each figure."""
    all_rounds = [measure() for _ in range(rounds)]
    return {name: min(figures[name] for figures in all_rounds) for name in all_rounds[0]}


def parts(program, scene, options, count, rounds, folder):
    return [
        minimum_of(rounds, lambda: part(program, scene, options, index, count, folder)) for index in range(1, count + 1)
    ]


def merged(program, count, rounds, folder):
    names = [f"{count}.{index}.part" for index in range(1, count + 1)]
    command = [program, "merge", "merged.exr", *names, "--progress", "none"]
    seconds = min(measured(command, folder) for _ in range(rounds))
    one = Path(folder) / "one.exr"
    same = not one.exists() or (Path(folder) / "merged.exr").read_bytes() == one.read_bytes()
    assert same, "the merged image differs from a single run"
    return seconds


def mean(figures, name):
    return sum(one[name] for one in figures) / len(figures)


def table(scene, options, arguments, counts, folder):
    """Prints the table of one scene; returns the inputs of the extrapolation."""
    print(f"\n{scene.stem} {' '.join(options)}\n")
    print("| parts | work, s | to one run | set-up of a part, s | write, s | bytes of a part | merge, s | slowest |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    program, rounds = str(Path(arguments.program).resolve()), arguments.rounds
    single, last = None, None
    for count in counts:
        figures = parts(program, str(scene), options, count, rounds, folder)
        work = sum(one["work"] for one in figures)
        single = single or figures[0]
        merge = merged(program, count, rounds, folder)[0] if count > 1 else 0.0
        slowest = max(one["work"] for one in figures) / (work / count)
        size = max(one["bytes"] for one in figures)
        to_one = work / single["work"] if counts[0] == 1 else float("nan")
        print(
            f"| {count} | {work:.2f} | {to_one:.3f} | {mean(figures, 'setup'):.3f} | {mean(figures, 'write'):.3f} "
            f"| {size} | {merge:.3f} | {slowest:.2f} |",
            flush=True,
        )
        last = {"count": count, "setup": mean(figures, "setup"), "write": mean(figures, "write"), "merge": merge}
    return single, last


def extrapolate(single, last, opening):
    """Prints the efficiency of up to 10,000 parts, for this image and for a render with 16 hours of work. With photons, the longer
    render has more passes."""
    print("\n| parts | efficiency | with 16 hours of work |\n| --- | --- | --- |")
    for count in PART_COUNTS:
        def of(work):
            alone = single["setup"] + work + single["write"]
            # A nearly empty part takes no time to write, but still needs the set-up.
            each = single["setup"] + last["write"] * last["count"] / max(count, last["count"])
            merge = last["merge"] + opening * count if count > 1 else 0.0
            again = max(1.0, count / (single["blocks"] * work / single["work"])) if single["blocks"] else 1.0
            all_work = work * (1.0 + single["tracing"] * (again - 1.0))
            return alone / (alone if count == 1 else all_work + count * each + merge)

        print(f"| {count} | {of(single['work']):.3f} | {of(16 * 3600.0):.4f} |")


def opening_of(program, rounds, folder):
    """Merge seconds per part, measured with 64 nearly empty parts."""
    scene = str(ROOT / "scenes/cornell.toml")
    options = ["--width", "64", "--height", "64", "--samples", "1"]
    for count in (2, 64):
        for index in range(1, count + 1):
            part(program, scene, options, index, count, folder)
    part(program, scene, options, 1, 1, folder)
    few, many = (merged(program, count, rounds, folder)[0] for count in (2, 64))
    return max(many - few, 0.0) / 62


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=ROOT / "target/release/glimt")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--large", action="store_true")
    parser.add_argument("scenes", nargs="*", help="[default: cornell, path, photons]")
    arguments = parser.parse_args()
    scenes = [Path(scene).resolve() for scene in arguments.scenes]
    scenes = scenes or [ROOT / f"scenes/{name}.toml" for name in ("cornell", "path", "photons")]
    with tempfile.TemporaryDirectory() as folder:
        opening = opening_of(str(Path(arguments.program).resolve()), arguments.rounds, folder)
        print(f"merge of an empty part: {1000 * opening:.2f} ms")
        for scene in scenes:
            (Path(folder) / "one.exr").unlink(missing_ok=True)
            if arguments.large:
                table(scene, LARGE + LARGE_SAMPLES.get(scene.stem, ["--samples", "4"]), arguments, (8,), folder)
            else:
                single, last = table(scene, OPTIONS.get(scene.stem, []), arguments, COUNTS, folder)
                extrapolate(single, last, opening)


if __name__ == "__main__":
    main()
