//! Octahedral encoding of directions in 32 bits, 16 bits per axis (Meyer, Süßmuth, Sußner, Stamminger,
//! Greiner, *On Floating-Point Normal Vectors*, 2010).

use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, Vec3x16};

/// Sixteen encoded directions.
pub type PackedDirectionPacket = [u32; PACKET_SIZE];

/// Half the side length of the square onto which directions are mapped.
const SIDE: f32 = 32767.0;

/// Encodes a direction. The result may differ from the nearest code in the last bit.
pub fn pack_direction(direction: Vec3) -> u32 {
    let Vec3 { x, y, z } = direction * (SIDE / (direction.x.abs() + direction.y.abs() + direction.z.abs()));
    let (u, v) = if z < 0.0 { ((SIDE - y.abs()).copysign(x), (SIDE - x.abs()).copysign(y)) } else { (x, y) };
    let whole = |x: f32| (x + 0.5_f32.copysign(x)) as i32 as u32 & 0xffff;
    whole(u) | whole(v) << 16
}

/// Decodes a unit vector.
#[inline(always)]
pub fn unpack_unit_vector(packed: u32) -> Vec3 {
    let [x, y, z] = unpack_unnormalized_vector(packed);
    Vec3::new(x, y, z).normalize()
}

/// Decodes vectors without normalizing them. Their lengths are between SIDE/√3 and SIDE.
#[inline(always)]
pub fn unpack_unnormalized_lanes(packed: &PackedDirectionPacket) -> Vec3x16 {
    let mut vectors = [[0.0; PACKET_SIZE]; 3];
    for i in 0..PACKET_SIZE {
        let [x, y, z] = unpack_unnormalized_vector(packed[i]);
        (vectors[0][i], vectors[1][i], vectors[2][i]) = (x, y, z);
    }
    vectors
}

#[inline(always)]
fn unpack_unnormalized_vector(packed: u32) -> [f32; 3] {
    let u = ((packed << 16) as i32 >> 16) as f32;
    let v = (packed as i32 >> 16) as f32;
    let z = SIDE - u.abs() - v.abs();
    let folded = if z < 0.0 { -z } else { 0.0 };
    [u - folded.copysign(u), v - folded.copysign(v), z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed_number_generator as random;

    #[test]
    fn round_trip_error_is_below_7e_5() {
        let mut next = random(3);
        let mut some: Vec<Vec3> = (0..10_000).map(|_| Vec3::new(next(), next(), next())).collect();
        for axis in Vec3::AXES {
            for other in Vec3::AXES {
                some.extend([axis + other, axis - other, -axis - other, axis + other * 1e-30]);
            }
        }
        for direction in some.into_iter().filter_map(Vec3::try_normalize) {
            let packed = pack_direction(direction);
            assert!(
                (unpack_unit_vector(packed) - direction).length() < 7e-5,
                "{direction}: {}",
                unpack_unit_vector(packed)
            );
            let long = unpack_unnormalized_lanes(&[packed; PACKET_SIZE]);
            let first = Vec3::new(long[0][0], long[1][0], long[2][0]);
            assert!((first.normalize() - direction).length() < 7e-5, "{direction}: {first}");
        }
    }
}
