//! Factors that select the lobes that an image shows.

use super::bsdf::ShownLobes;
use glimt_base::soa;

soa! {
    /// Factors that select which lobes an image shows.
    pub struct ShownLobeFactors in LobeFactorsPacket {
        /// Factor for the wide lobes: 1 if they are shown, and 0 if they are hidden.
        pub(super) wide: f32 = 0.0,
        /// Factor for the narrow lobes: 1 if they are shown, and 0 if they are hidden.
        pub(super) narrow: f32 = 0.0,
        /// Value of f in sr⁻¹ that is shown instead of the lobes.
        pub(super) unit: f32 = 0.0,
    }
}

impl From<ShownLobes> for ShownLobeFactors {
    #[inline(always)]
    fn from(shown: ShownLobes) -> Self {
        let factor = |is_shown: bool| if is_shown { 1.0 } else { 0.0 };
        match shown {
            ShownLobes::Of { diffuse, specular } => {
                Self { wide: factor(diffuse), narrow: factor(specular), unit: 0.0 }
            }
            ShownLobes::Unit => Self { wide: 0.0, narrow: 0.0, unit: 1.0 },
        }
    }
}
