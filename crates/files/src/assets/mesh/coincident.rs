//! Finds coincident vertices.

use rayon::prelude::*;

use crate::control::{CancelToken, Canceled};
use crate::math::Vec3;

/// Average number of vertices per bucket. Buckets are sorted in parallel, and the cancel token is polled once
/// per bucket.
const BUCKET: usize = 1 << 12;

/// Number of vertices between polls of the cancel token.
const BATCH: usize = 1 << 16;

/// Hash and index of a vertex.
type VertexHashAndIndex = (u32, u32);

/// Finds sets of coincident vertices, each in ascending order. The order of the sets is arbitrary but
/// deterministic.
pub(super) fn find_coincident_vertex_sets(
    positions: &[Vec3],
    token: &CancelToken,
) -> Result<Vec<Vec<u32>>, Canceled> {
    let bits = positions.len().div_ceil(BUCKET).next_power_of_two().ilog2();
    let mut hashes = vec![0; positions.len()];
    for (hashes, positions) in hashes.chunks_mut(BATCH).zip(positions.chunks(BATCH)) {
        token.check_pause_and_cancel()?;
        hashes.par_iter_mut().zip(positions).for_each(|(hash, position)| *hash = hash_position(*position));
    }
    let (entries, ends) = sort_into_buckets(&hashes, bits, token)?;
    let starts = std::iter::once(0).chain(ends.iter().copied());
    let buckets: Vec<_> = starts.zip(&ends).map(|(start, end)| &entries[start..*end]).collect();
    let found: Result<Vec<_>, Canceled> =
        buckets.par_iter().map(|bucket| group_coincident_in_bucket(bucket, positions, token)).collect();
    Ok(found?.into_iter().flatten().collect())
}

/// Bit pattern of a position. Adding 0 converts −0 to 0.
fn position_bits(position: Vec3) -> [u32; 3] {
    (position + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// Multiplicative hash (Knuth, *The Art of Computer Programming*, vol. 3, section 6.4). The upper bits are
/// mixed best.
fn hash_position(position: Vec3) -> u32 {
    let [x, y, z] = position_bits(position).map(u64::from);
    let mixed = (x | y << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ z.wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    ((mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32) as u32
}

/// Sorts vertices into buckets by the upper bits of their hashes. Returns the sorted vertices and the end
/// index of each bucket.
fn sort_into_buckets(
    hashes: &[u32],
    bits: u32,
    token: &CancelToken,
) -> Result<(Vec<VertexHashAndIndex>, Vec<usize>), Canceled> {
    let bucket = |hash: u32| (u64::from(hash) >> (32 - bits)) as usize;
    let mut ends = vec![0; 1 << bits];
    for hashes in hashes.chunks(BATCH) {
        token.check_pause_and_cancel()?;
        hashes.iter().for_each(|&hash| ends[bucket(hash)] += 1);
    }
    let mut next = 0;
    for end in &mut ends {
        next += std::mem::replace(end, next);
    }
    let mut entries = vec![(0, 0); hashes.len()];
    for (vertex, &hash) in (0_u32..).zip(hashes) {
        if (vertex as usize).is_multiple_of(BATCH) {
            token.check_pause_and_cancel()?;
        }
        let end = &mut ends[bucket(hash)];
        entries[*end] = (hash, vertex);
        *end += 1;
    }
    Ok((entries, ends))
}

/// Finds the coincident vertices in a bucket by grouping them by hash, then by position.
fn group_coincident_in_bucket(
    bucket: &[VertexHashAndIndex],
    positions: &[Vec3],
    token: &CancelToken,
) -> Result<Vec<Vec<u32>>, Canceled> {
    token.check_pause_and_cancel()?;
    let mut entries = bucket.to_vec();
    entries.sort_unstable();
    let mut found = Vec::new();
    for same_hash in entries.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        let mut order: Vec<_> = same_hash
            .iter()
            .map(|&(_, vertex)| (position_bits(positions[vertex as usize]), vertex))
            .collect();
        order.sort_unstable();
        let groups = order.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1);
        found.extend(groups.map(|group| group.iter().map(|(_, vertex)| *vertex).collect()));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_coincident_vertices_are_found() {
        // Positions repeat after 5000 vertices; −0 equals 0.
        let at = |i: u32| Vec3::new((i % 5000) as f32, 0.25, if i < 5000 { 0.0 } else { -0.0 });
        let positions: Vec<_> = (0..20_000).map(at).chain([Vec3::splat(9.0), Vec3::splat(8.0)]).collect();
        let mut found = find_coincident_vertex_sets(&positions, &CancelToken::new()).expect("not canceled");
        found.sort_unstable();
        let expected: Vec<Vec<u32>> =
            (0..5000).map(|i| (0..4).map(|turn| i + 5000 * turn).collect()).collect();
        assert_eq!(found, expected);
        assert_eq!(find_coincident_vertex_sets(&[], &CancelToken::new()), Ok(Vec::new()));
    }

    #[test]
    fn grid_positions_spread_over_all_buckets() {
        let mut counts = [0; 64];
        for i in 0..64_000_u32 {
            let position = Vec3::new((i % 40) as f32, (i / 40 % 40) as f32, (i / 1600) as f32) * 0.5;
            counts[hash_position(position) as usize >> 26] += 1;
        }
        assert!(counts.iter().all(|count| (500..2000).contains(count)), "{counts:?}");
    }
}
