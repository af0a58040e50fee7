//! The rays of a packet, from the camera or from a queue of paths.

use super::camera::CameraRayPacket;
use super::ray::PathRay;
use super::tile::TileContext;
use crate::world::Hit;

/// Source of a packet's rays.
#[derive(Clone, Copy)]
pub enum PacketSource<'a> {
    /// Camera rays: the packet, its first slot, the number of rays, and the queue index of the first ray.
    Camera(&'a CameraRayPacket, u32, usize, u32),
    /// Consecutive rays in a queue, and the queue index of the first ray.
    Paths(&'a [PathRay], u32),
    /// Rays whose hits have already been found, at these queue indices.
    Traced(&'a [PathRay], &'a [Option<Hit>], &'a [u32]),
}

impl PacketSource<'_> {
    /// Number of lanes, which may include lanes without a camera ray.
    pub fn lane_count(&self) -> usize {
        match self {
            Self::Camera(_, _, count, _) => *count,
            Self::Paths(paths, _) => paths.len(),
            Self::Traced(_, _, places) => places.len(),
        }
    }

    /// Mask of the lanes with a ray.
    pub fn mask(&self) -> u32 {
        let all = ((1_u64 << self.lane_count()) - 1) as u32;
        match self {
            Self::Camera(row, ..) => all & row.valid,
            Self::Paths(..) | Self::Traced(..) => all,
        }
    }

    /// Queue index of a lane's path, or an arbitrary number if the lane has no path.
    #[inline(always)]
    pub fn queue_index(&self, lane: usize) -> u32 {
        match self {
            Self::Camera(_, _, _, first) | Self::Paths(_, first) => first + lane as u32,
            Self::Traced(_, _, places) => places.get(lane).copied().unwrap_or(0),
        }
    }

    /// A lane's path. The lane must have one.
    #[inline(always)]
    pub fn path(&self, tile: &TileContext<'_>, lane: usize) -> PathRay {
        match self {
            Self::Camera(row, first, ..) => {
                tile.path_from_camera_ray(row.rays.ray(lane), first + lane as u32)
            }
            Self::Paths(paths, _) => paths[lane],
            Self::Traced(paths, _, places) => paths[places[lane] as usize],
        }
    }

    /// A lane's queued path, or `None` for camera rays and for lanes without a path.
    #[inline(always)]
    pub fn queued_path(&self, lane: usize) -> Option<&PathRay> {
        match self {
            Self::Camera(..) => None,
            Self::Paths(paths, _) => paths.get(lane),
            Self::Traced(paths, _, places) => paths.get(*places.get(lane)? as usize),
        }
    }
}
