//! Several numbers at a time: loops without branches over arrays, which compilers turn into vector instructions. Every lane
//! gets the bits that it would get alone.

use std::f32::consts::FRAC_PI_2;

use super::Vec3;

/// Numbers at a time.
pub const LANES: usize = 4;

/// One number for each of several samples.
pub type Lanes = [f32; LANES];

/// A function of each lane's number.
#[inline(always)]
pub fn map(x: Lanes, f: impl Fn(f32) -> f32) -> Lanes {
    let mut values = x;
    for value in &mut values {
        *value = f(*value);
    }
    values
}

/// A function of each lane's two numbers.
#[inline(always)]
pub fn zip(x: Lanes, y: Lanes, f: impl Fn(f32, f32) -> f32) -> Lanes {
    let mut values = x;
    for (value, y) in values.iter_mut().zip(y) {
        *value = f(*value, y);
    }
    values
}

/// Vectors, by coordinate.
pub type Lanes3 = [Lanes; 3];

/// Dot products with one vector.
#[inline(always)]
pub fn dot(a: &Lanes3, b: Vec3) -> Lanes {
    let mut products = a[0];
    for (i, product) in products.iter_mut().enumerate() {
        *product = *product * b.x + a[1][i] * b.y + a[2][i] * b.z;
    }
    products
}

/// The vector of a lane.
#[inline(always)]
pub fn lane(vectors: &Lanes3, i: usize) -> Vec3 {
    Vec3::new(vectors[0][i], vectors[1][i], vectors[2][i])
}

/// Sine and cosine of angles in [0, 2π], within 1.2e-7: the angle is taken to [−π/4, π/4] around a multiple of π/2, which is
/// subtracted in three parts (Cody and Waite, *Software Manual for the Elementary Functions*, 1980), and there the
/// polynomials are those of Moshier's Cephes library.
#[inline(always)]
pub fn sin_cos(angle: Lanes) -> (Lanes, Lanes) {
    let quarters = map(angle, |a| {
        let beyond = |k: f32| if a > (k - 0.5) * FRAC_PI_2 { 1.0 } else { 0.0 };
        beyond(1.0) + beyond(2.0) + beyond(3.0) + beyond(4.0)
    });
    let near = zip(angle, quarters, |a, k| ((a - k * 1.570_312_5) - k * 4.837_513e-4) - k * 7.549_79e-8);
    let sin = map(near, |r| {
        let z = r * r;
        r + r * z * (-1.666_665_5e-1 + z * (8.332_161e-3 + z * -1.951_529_6e-4))
    });
    let cos = map(near, |r| {
        let z = r * r;
        1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5))
    });
    (pick(quarters, sin, cos, [2.0, 3.0]), pick(quarters, cos, sin, [1.0, 2.0]))
}

/// Of two values the one for the quarter of each lane, with the other sign in two of the quarters.
#[inline(always)]
fn pick(quarters: Lanes, even: Lanes, odd: Lanes, negative: [f32; 2]) -> Lanes {
    let mut values = even;
    for (i, value) in values.iter_mut().enumerate() {
        let k = quarters[i];
        let size = if k == 1.0 || k == 3.0 { odd[i] } else { *value };
        *value = if k == negative[0] || k == negative[1] { -size } else { size };
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_all_around() {
        for i in 0..=100_000 {
            let angle = i as f32 * (std::f32::consts::TAU / 100_000.0);
            let (sin, cos) = sin_cos([angle; LANES]);
            let (exact_sin, exact_cos) = f64::from(angle).sin_cos();
            assert!((f64::from(sin[0]) - exact_sin).abs() < 1.2e-7, "sin {angle}: {}", sin[0]);
            assert!((f64::from(cos[3]) - exact_cos).abs() < 1.2e-7, "cos {angle}: {}", cos[3]);
        }
    }
}
