//! Ray kernel: build time, memory, and millions of rays per second on one thread and on all threads. The rays
//! are primary rays, one cosine-distributed bounce, and shadow rays (any hit) to a point light.
//!
//! - `cargo bench --bench rays` uses generated meshes. `-- a.ply b.obj c.mesh` uses files, and `-- ball` a
//!   generated mesh with a million triangles.
//! - `--embree LIB` compares with Embree 4, where `LIB` is the path of `libembree4.so`. Embree builds a
//!   robust scene at medium quality. `--embree-isa avx512` enables AVX-512, which Embree needs for packets of
//!   16; its single rays are faster with AVX2.
//! - `--instructions NAME` uses only this instruction set for traversal.
//! - `--high` uses spatial splits (`Quality::High`), also in Embree.
//! - `--build` measures only the build.
//! - `--closest FILE` and `--any FILE` also time the rays in a file, for the closest or any hit.
//! - `--rays FILE --hits FILE` (or `--occluded FILE`) counts differences from expected results. May be
//!   repeated.
//!
//! glimt and Embree alternate chunk by chunk, and the fastest run of each chunk counts, so that load from
//! other programs affects both equally.

#![allow(clippy::print_stdout)]

mod compare;
mod embree;
mod meshes;

use std::path::{Path, PathBuf};
use std::time::Instant;

use embree::{Embree, EmbreeScene};
use glimt::accel::wide_bvh::{BuildQuality, InstructionSet};
use glimt::accel::{KdTree, PACKET_SIZE, WideBvh, packet_ray_ends};
use glimt::control::CancelToken;
use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use rayon::prelude::*;

/// Timed runs per chunk.
const RUNS: usize = 7;

/// Rays per chunk.
const CHUNK: usize = 1 << 15;

#[derive(Default)]
struct BenchOptions {
    embree: Option<PathBuf>,
    instructions: Option<InstructionSet>,
    isa: Option<String>,
    build_only: bool,
    high: bool,
    /// Ray files to time, each with whether to find any hit instead of the closest.
    timed: Vec<(PathBuf, bool)>,
    /// Ray files and their expected results.
    given: Vec<(PathBuf, PathBuf)>,
    files: Vec<String>,
}

fn main() {
    let options = options();
    let embree = options.embree.as_deref().map(|path| {
        Embree::load(path).unwrap_or_else(|error| {
            println!("{}: {error}", path.display());
            std::process::exit(2)
        })
    });
    for file in &options.files {
        if file == "ball" {
            measure("ball 1M", &meshes::rippled_ball(708), embree.as_ref(), &options);
            continue;
        }
        match meshes::load(Path::new(file)) {
            Ok(mesh) => measure(file.rsplit('/').next().unwrap_or(file), &mesh, embree.as_ref(), &options),
            Err(error) => println!("{file}: {error}"),
        }
    }
    if options.files.is_empty() {
        for (name, rings) in [("ball 10k", 71), ("ball 100k", 224), ("ball 1M", 708), ("ball 10M", 2237)] {
            measure(name, &meshes::rippled_ball(rings), embree.as_ref(), &options);
        }
    }
}

fn options() -> BenchOptions {
    let mut options = BenchOptions::default();
    let mut rays = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--embree" => options.embree = arguments.next().map(PathBuf::from),
            "--instructions" => {
                let name = arguments.next().unwrap_or_default();
                options.instructions = InstructionSet::ALL
                    .into_iter()
                    .find(|own| format!("{own:?}").eq_ignore_ascii_case(&name));
            }
            "--high" => options.high = true,
            "--build" => options.build_only = true,
            "--closest" | "--any" => {
                options.timed.extend(arguments.next().map(|file| (PathBuf::from(file), argument == "--any")));
            }
            "--rays" => rays = arguments.next().map(PathBuf::from),
            "--hits" | "--occluded" => {
                options.given.extend(rays.take().zip(arguments.next().map(PathBuf::from)));
            }
            "--embree-isa" => options.isa = arguments.next(),
            other if !other.starts_with("--") => options.files.push(other.to_owned()),
            _ => {}
        }
    }
    options
}

fn seconds(run: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    run();
    begin.elapsed().as_secs_f64()
}

fn measure(name: &str, mesh: &TriangleMesh, embree: Option<&Embree>, options: &BenchOptions) {
    let count = mesh.triangles.len() as u32;
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let quality = if options.high { BuildQuality::High } else { BuildQuality::Medium };
    let build = || {
        let corners = |id| mesh.corners(id);
        WideBvh::build_with_quality(quality, count, corners, &CancelToken::new())
            .expect("the token is not canceled")
    };
    let (mut own_build, mut peer_build) = (f64::INFINITY, f64::INFINITY);
    let mut tree = None;
    let mut scene = None;
    for _ in 0..if options.build_only { 25 } else { 5 } {
        drop(tree.take());
        own_build = own_build.min(seconds(|| tree = Some(build())));
        if let Some(embree) = embree {
            drop(scene.take());
            let mut new = embree.build(
                mesh,
                if options.high { embree::Quality::High } else { embree::Quality::Medium },
                threads,
                options.isa.as_deref().unwrap_or("avx2"),
            );
            peer_build = peer_build.min(seconds(|| new.commit()));
            scene = Some(new);
        }
    }
    let Some(mut tree) = tree else { return };
    println!("{name}: {count} triangles, built with {threads} threads, traced with 1");
    line("build", "s", own_build, scene.as_ref().map(|_| peer_build));
    line(
        "memory",
        "MB",
        tree.memory_bytes() as f64 / 1e6,
        scene.as_ref().map(|scene| scene.memory_bytes as f64 / 1e6),
    );
    let (nodes, packs) = tree.expected_visits();
    println!("  a random line visits {nodes:.2} nodes and {packs:.2} packs");
    if options.build_only {
        return;
    }
    let rays = meshes::rays(&tree, mesh);
    if options.instructions.is_none() {
        kd_tree(mesh, &rays);
    }
    for instructions in InstructionSet::ALL {
        if instructions.or_best_if_unsupported() != instructions
            || options.instructions.is_some_and(|only| only != instructions)
        {
            continue;
        }
        tree = tree.with_instruction_set(instructions);
        println!("  {instructions:?}, single rays");
        closest("primary", &tree, scene.as_ref(), &rays.primary);
        closest("diffuse", &tree, scene.as_ref(), &rays.diffuse);
        any("shadow", &tree, scene.as_ref(), &rays.shadow);
        packets(&tree, scene.as_ref(), &rays);
        all_threads(&tree, &rays, threads);
        for (file, any_hit) in &options.timed {
            match meshes::ray_file(file) {
                Ok(rays) => timed(&tree, scene.as_ref(), &rays, *any_hit),
                Err(error) => println!("  {}: {error}", file.display()),
            }
        }
        for (rays, answers) in &options.given {
            if let Err(error) = compare::compare(&tree, mesh, rays, answers) {
                println!("  {}: {error}", rays.display());
            }
        }
    }
}

/// Times the rays in a file on one thread: one by one, and in packets of sixteen in file order. For
/// Embree, the fastest mode counts.
fn timed(tree: &WideBvh, scene: Option<&EmbreeScene<'_>>, rays: &[Ray], any_hit: bool) {
    let seconds = |rate: f64| rays.len() as f64 / 1e6 / rate;
    let mut single = |rays: &[Ray]| match any_hit {
        true => rays.iter().filter(|ray| tree.any_hit(ray, None)).count(),
        false => rays.iter().filter(|ray| tree.closest_hit(ray).is_some()).count(),
    };
    let mut packets = |rays: &[Ray]| {
        let mut hits = [None; PACKET_SIZE];
        let mut found = |some: &[Ray]| {
            if any_hit {
                return tree.any_hit_packet(some, &packet_ray_ends(some), &[]).count_ones() as usize;
            }
            tree.closest_hit_packet(some, &packet_ray_ends(some), &mut hits[..some.len()]);
            hits[..some.len()].iter().flatten().count()
        };
        rays.chunks(PACKET_SIZE).map(&mut found).sum()
    };
    let own = rates(rays, [&mut single, &mut packets]);
    let peer = scene.map(|scene| {
        let mut single = |rays: &[Ray]| match any_hit {
            true => rays.iter().filter(|ray| scene.any(ray)).count(),
            false => rays.iter().filter(|ray| scene.closest(ray).is_some()).count(),
        };
        let mut plain = |rays: &[Ray]| scene.closest16(rays, false);
        let mut coherent = |rays: &[Ray]| scene.closest16(rays, true);
        // Packets support only closest hits.
        let ways: &mut [TraceFn<'_>] = &mut [&mut single, &mut plain, &mut coherent];
        let count = if any_hit { 1 } else { ways.len() };
        ways[..count].iter_mut().map(|way| rates(rays, [*way])[0]).fold(0.0, f64::max)
    });
    let kind = if any_hit { "any hit" } else { "closest" };
    println!("  {kind}: {} rays from a file", rays.len());
    line("one by one", "s", seconds(own[0]), peer.map(seconds));
    line("packets", "s", seconds(own[1]), peer.map(seconds));
}

/// Prints the rates on all threads for packets of primary and shadow rays, and for single diffuse rays.
fn all_threads(tree: &WideBvh, rays: &meshes::Rays, threads: usize) {
    let chunks = |rays: &[Ray], way: &(dyn Fn(&[Ray]) -> usize + Sync)| {
        let mut best = f64::INFINITY;
        for _ in 0..RUNS {
            best = best.min(seconds(|| {
                let found: usize = rays.par_chunks(1024).map(way).sum();
                std::hint::black_box(found);
            }));
        }
        rays.len() as f64 / best / 1e6
    };
    println!("  {:?}, {threads} threads: packets, single diffuse rays", tree.instruction_set());
    let closest = |rays: &[Ray]| {
        let mut hits = [None; PACKET_SIZE];
        let mut found = |some: &[Ray]| {
            tree.closest_hit_packet(some, &packet_ray_ends(some), &mut hits[..some.len()]);
            hits[..some.len()].iter().flatten().count()
        };
        rays.chunks(PACKET_SIZE).map(&mut found).sum()
    };
    let any = |rays: &[Ray]| {
        let found =
            |some: &[Ray]| tree.any_hit_packet(some, &packet_ray_ends(some), &[]).count_ones() as usize;
        rays.chunks(PACKET_SIZE).map(found).sum()
    };
    line("primary", "Mrays/s", chunks(&rays.primary, &closest), None);
    line(
        "diffuse",
        "Mrays/s",
        chunks(&rays.diffuse, &|rays| rays.iter().filter_map(|ray| tree.closest_hit(ray)).count()),
        None,
    );
    line("shadow", "Mrays/s", chunks(&rays.shadow, &any), None);
}

/// Prints k-d tree rates.
fn kd_tree(mesh: &TriangleMesh, rays: &meshes::Rays) {
    let count = mesh.triangles.len() as u32;
    let build = || {
        KdTree::from_triangles(count, |id| mesh.corners(id), &CancelToken::new())
            .expect("the token is not canceled")
    };
    let mut best = f64::INFINITY;
    let mut tree = None;
    for _ in 0..3 {
        drop(tree.take());
        best = best.min(seconds(|| tree = Some(build())));
    }
    let Some(tree) = tree else { return };
    let (nodes, triangles) = tree.expected_visits();
    println!("  kd-tree, single rays; a random line visits {nodes:.2} nodes and {triangles:.2} triangles");
    line("build", "s", best, None);
    line("memory", "MB", tree.memory_bytes() as f64 / 1e6, None);
    let mut closest = |rays: &[Ray]| rays.iter().filter(|ray| tree.closest_hit(ray).is_some()).count();
    let mut any = |rays: &[Ray]| rays.iter().filter(|ray| tree.any_hit(ray, None)).count();
    line("primary", "Mrays/s", rates(&rays.primary, [&mut closest])[0], None);
    line("diffuse", "Mrays/s", rates(&rays.diffuse, [&mut closest])[0], None);
    line("shadow", "Mrays/s", rates(&rays.shadow, [&mut any])[0], None);
}

/// Prints glimt's and Embree's measurements, and their ratio.
fn line(name: &str, unit: &str, own: f64, peer: Option<f64>) {
    match peer {
        Some(peer) => println!("  {name:<10} {unit:>9} {own:>9.3} {peer:>9.3}  ratio {:.3}", own / peer),
        None => println!("  {name:<10} {unit:>9} {own:>9.3}"),
    }
}

fn closest(name: &str, tree: &WideBvh, scene: Option<&EmbreeScene<'_>>, rays: &[Ray]) {
    let mut own = |rays: &[Ray]| rays.iter().filter(|ray| tree.closest_hit(ray).is_some()).count();
    match scene {
        None => line(name, "Mrays/s", rates(rays, [&mut own])[0], None),
        Some(scene) => {
            let mut peer = |rays: &[Ray]| rays.iter().filter(|ray| scene.closest(ray).is_some()).count();
            let [own, peer] = rates(rays, [&mut own, &mut peer]);
            line(name, "Mrays/s", own, Some(peer));
        }
    }
}

fn any(name: &str, tree: &WideBvh, scene: Option<&EmbreeScene<'_>>, rays: &[Ray]) {
    let mut own = |rays: &[Ray]| rays.iter().filter(|ray| tree.any_hit(ray, None)).count();
    match scene {
        None => line(name, "Mrays/s", rates(rays, [&mut own])[0], None),
        Some(scene) => {
            let mut peer = |rays: &[Ray]| rays.iter().filter(|ray| scene.any(ray)).count();
            let [own, peer] = rates(rays, [&mut own, &mut peer]);
            line(name, "Mrays/s", own, Some(peer));
        }
    }
}

/// Prints the rates for packets of sixteen rays. Embree runs with and without the coherent flag.
fn packets(tree: &WideBvh, scene: Option<&EmbreeScene<'_>>, rays: &meshes::Rays) {
    let mut closest = |rays: &[Ray]| {
        let mut found = 0;
        let mut hits = [None; PACKET_SIZE];
        for sixteen in rays.chunks(PACKET_SIZE) {
            tree.closest_hit_packet(sixteen, &packet_ray_ends(sixteen), &mut hits[..sixteen.len()]);
            found += hits.iter().filter(|hit| hit.is_some()).count();
        }
        found
    };
    let mut any = |rays: &[Ray]| {
        let found = |sixteen: &[Ray]| {
            tree.any_hit_packet(sixteen, &packet_ray_ends(sixteen), &[]).count_ones() as usize
        };
        rays.chunks(PACKET_SIZE).map(found).sum()
    };
    println!("  {:?}, packets of {PACKET_SIZE}", tree.instruction_set());
    if let Some(scene) = scene {
        let mut plain = |rays: &[Ray]| scene.closest16(rays, false);
        let mut coherent = |rays: &[Ray]| scene.closest16(rays, true);
        let [own, plain, coherent] = rates(&rays.primary, [&mut closest, &mut plain, &mut coherent]);
        line("primary", "Mrays/s", own, Some(plain));
        line("coherent", "Mrays/s", own, Some(coherent));
    } else {
        line("primary", "Mrays/s", rates(&rays.primary, [&mut closest])[0], None);
    }
    line("diffuse", "Mrays/s", rates(&rays.diffuse, [&mut closest])[0], None);
    line("shadow", "Mrays/s", rates(&rays.shadow, [&mut any])[0], None);
}

/// Function that traces rays and counts hits.
type TraceFn<'a> = &'a mut dyn FnMut(&[Ray]) -> usize;

/// Millions of rays per second for each function, using the fastest run of every chunk.
fn rates<const N: usize>(rays: &[Ray], mut ways: [TraceFn<'_>; N]) -> [f64; N] {
    let mut total = [0.0; N];
    for chunk in rays.chunks(CHUNK) {
        let mut best = [f64::INFINITY; N];
        for _ in 0..RUNS {
            for (way, best) in ways.iter_mut().zip(&mut best) {
                *best = best.min(seconds(|| {
                    std::hint::black_box(way(chunk));
                }));
            }
        }
        for (total, best) in total.iter_mut().zip(best) {
            *total += best;
        }
    }
    total.map(|seconds| rays.len() as f64 / seconds / 1e6)
}
