#!/usr/bin/env python3
"""Prints the processor time of each rendering stage, in microseconds per path.

    cargo build --profile profiling
    python3 benches/rooms/stages.py SCENE... [--glimt target/profiling/glimt] [--samples N] [--side PIXELS]

Each scene is rendered once with `path` on one thread under `perf record` (Linux). Each profile sample counts for the stage of the
innermost function in STAGES, including inlined ones (from addr2line, which needs the profile with line tables).
"""

import argparse
import collections
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
RATE = 2000  # profile samples per second

# Substrings of function names, searched from the innermost frame outward; the first stage with a match counts.
STAGES = [
    ("glass", ["crossing", "contact", "isolated", "touch_error", "specular", "near_shape", "encloses"]),
    ("lights: picks", ["pick_flat", "pick_by_cuts", "picks", "importance_if_single_node", "move_to", "samples_at"]),
    ("lights: samples", ["sample_packet", "sample_per_lane", "light_pdf", "inverse_pdf"]),
    ("shadow rays", ["occluded", "any_packet", "any_rows", "any_avx", "any_in_small", "single::any", "packet::any", "pool", "is_hit", "doubtful_hit", "add_unoccluded"]),
    ("closest hits", ["facets", "closest", "single::nearest", "packet::nearest", "intersect_near_origin", "corners_and_edge_functions_f64", "alone", "update_nearest", "packet::Closest", "merged::rays"]),
    ("surfaces", ["fill_surfaces", "fill_other_surfaces", "surface", "facet", "set_positions", "set_smooth_normals", "PacketIntersection"]),
    ("textures", ["lookup", "texture"]),
    ("direct light", ["sample_all", "sample_pick", "SampleAllLights", "SampleLightTree", "contributions", "response"]),
    ("directions", ["scatter", "sample_diffuse", "lobes"]),
    ("random numbers", ["sampler", "scrambled", "pairs", "sobol"]),
    ("camera", ["camera"]),
    ("queues and film", ["render_tile", "Wavefront", "queues", "film", "direct::queue", "memmove", "memcpy", "memset"]),
]
# Everything except the render: reading, acceleration structures, writing.
SETUP = ["glimt_files", "glimt_scene", "build", "png", "deflate", "miniz", "blake3", "ld-linux", "dl_", "page", "clap"]


def run(command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def symbols(program):
    """Addresses of functions by their mangled names."""
    rows = (line.split() for line in run(["nm", program]).splitlines())
    return {row[2]: int(row[0], 16) for row in rows if len(row) == 3}


def samples(profile, program):
    """Sample counts by location: an address of the program, or the name of another function."""
    known, found = symbols(program), collections.Counter()
    for line in run(["perf", "script", "-i", profile, "-F", "ip,sym,symoff", "--no-demangle"]).splitlines():
        parts = line.split()
        if len(parts) >= 2:
            name, _, offset = parts[1].partition("+")
            found[known[name] + int(offset or "0", 16) if name in known else name] += 1
    return found


def frames(program, addresses):
    """Names of the functions at each address, innermost first."""
    command = ["addr2line", "-e", program, "-i", "-f", "-C", "-a", *(hex(address) for address in addresses)]
    names, own = {}, None
    lines = iter(run(command).splitlines())
    for line in lines:
        if line.startswith("0x"):
            own = names.setdefault(int(line, 16), [])
        else:
            own.append(line + " " + next(lines))
    return names


def stage(names):
    """The stage of a location, from its frames, innermost first."""
    if any(word in name for name in names for word in SETUP):
        return "reading, trees, writing"
    for name in names:
        for title, words in STAGES:
            if any(word in name for word in words):
                return title
    return "other"


def measure(scene, args):
    """Prints the stages of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        profile = f"{folder}/profile"
        render = [args.glimt, scene, "--once", "--integrator", "path", "--threads", "1", "--progress", "none"]
        size = ["--samples", args.samples, "--width", args.side, "--height", args.side, "-o", f"{folder}/out.exr"]
        run([str(part) for part in ["perf", "record", "-q", "-e", "cpu-clock", "-F", RATE, "-o", profile, *render, *size]])
        found = samples(profile, args.glimt)
    names = frames(args.glimt, [place for place in found if isinstance(place, int)])
    totals = collections.Counter()
    for place, count in found.items():
        totals[stage(names[place] if isinstance(place, int) else [place])] += count
    paths = args.samples * args.side**2
    microseconds = lambda count: 1e6 * count / RATE / paths
    setup = totals.pop("reading, trees, writing", 0)
    whole = sum(totals.values())
    print(f"{Path(scene).parent.name}/{Path(scene).name}: {microseconds(whole):.3f} us/path, setup and writing {setup / RATE:.2f} s")
    for title, count in totals.most_common():
        print(f"  {title:18}{microseconds(count):8.3f} us {count / whole:6.1%}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--glimt", default=str(ROOT / "target/profiling/glimt"))
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--side", type=int, default=128, help="image width and height in pixels")
    args = parser.parse_args()
    for scene in args.scenes:
        measure(scene, args)


if __name__ == "__main__":
    main()
