//! A scene's coordinate frame: origin and unit of length.

/// Origin and unit of length.
#[derive(Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) at: [f64; 3],
    pub(crate) unit: f64,
}

/// Scene size in units.
const SIZE: f64 = 8.0;

impl Frame {
    /// The identity frame.
    pub(crate) const PLAIN: Self = Self { at: [0.0; 3], unit: 1.0 };

    /// A frame 2ᵏ times as large.
    pub(crate) fn scaled(k: i32) -> Self {
        Self { unit: 2.0_f64.powi(k), ..Self::PLAIN }
    }

    /// A frame moved by a multiple of the scene's size.
    pub(crate) fn moved(sizes: f64) -> Self {
        Self { at: [SIZE * sizes, -0.5 * SIZE * sizes, 0.25 * SIZE * sizes], ..Self::PLAIN }
    }

    /// A point. Coordinates are rounded to multiples of 1/1024 so that sums and products are exact.
    pub(crate) fn point(self, x: f64, y: f64, z: f64) -> String {
        let [x, y, z] = [x, y, z].map(|x| (x * 1024.0).round() / 1024.0 * self.unit);
        let [at_x, at_y, at_z] = self.at;
        format!("[{:?}, {:?}, {:?}]", at_x + x, at_y + y, at_z + z)
    }

    /// An edge or offset vector: scaled, but not moved.
    pub(crate) fn vector(self, x: f64, y: f64, z: f64) -> String {
        Self { at: [0.0; 3], ..self }.point(x, y, z)
    }

    /// A scaled length.
    pub(crate) fn length(self, x: f64) -> String {
        format!("{:?}", x * self.unit)
    }

    /// A point light's intensity, scaled to keep the irradiance constant.
    pub(crate) fn intensity(self, x: f64) -> String {
        format!("{:?}", x * self.unit * self.unit)
    }
}
