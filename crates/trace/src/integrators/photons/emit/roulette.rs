//! Russian roulette for photons.

use super::{PhotonWavefront, max_flux_component};
use crate::integrators::PACKET_SIZE;
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::tile::TileContext;
use crate::math::lanes::Simd;
use crate::sampling::{Dimension, SamplerPacket};
use crate::world::SimdKernel;

impl PhotonWavefront<'_> {
    /// Applies Russian roulette based on flux. Surviving photons keep about their initial flux.
    pub(super) fn apply_roulette_to_queued_photons(&mut self) {
        let tile = self.tracing.tile;
        let mut kept = 0;
        for begin in (0..self.next.len()).step_by(PACKET_SIZE) {
            let end = self.next.len().min(begin + PACKET_SIZE);
            let risks = tile
                .world
                .geometry
                .instruction_set()
                .run(RouletteRandomKernel { tile, rays: &self.next[begin..end] });
            for (place, risk) in (begin..end).zip(risks) {
                let mut ray = self.next[place];
                let flux = max_flux_component(tile.world, &ray);
                let chance = flux / self.references[ray.slot as usize];
                if !(flux > 0.0 && risk < chance) {
                    continue;
                }
                if chance < 1.0 {
                    ray.throughput /= chance;
                }
                self.next[kept] = ray;
                kept += 1;
            }
        }
        self.next.truncate(kept);
    }
}

/// Draws the random numbers for Russian roulette.
struct RouletteRandomKernel<'a> {
    tile: &'a TileContext<'a>,
    rays: &'a [PathRay],
}

impl SimdKernel for RouletteRandomKernel<'_> {
    type Output = [f32; PACKET_SIZE];

    #[inline(always)]
    fn run(self, _: impl Simd) -> Self::Output {
        let (mut slots, mut paths) = ([0; PACKET_SIZE], [0; PACKET_SIZE]);
        for (i, ray) in self.rays.iter().enumerate().take(PACKET_SIZE) {
            (slots[i], paths[i]) = (ray.slot, ray.path);
        }
        let (xs, ys, samples) = self.tile.block.pixels_and_samples_of_slots(&slots);
        let sampler = SamplerPacket::new(self.tile.settings.render.seed, &xs, &ys, &samples);
        let [risks, _] = sampler.pairs(&paths, Dimension::Roulette, 0, 1);
        risks
    }
}
