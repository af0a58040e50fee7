//! Structs of arrays. [`soa!`](crate::soa) generates the packet form of a struct: one array of
//! [`PACKET_SIZE`] numbers per number in the struct. Loops over the lanes of a packet read and write
//! values of the struct, and compile to vector instructions.

use std::fmt::Debug;

use super::Vec3;
use super::lanes::{F32x16, Mask, PACKET_SIZE, Vec3x16, lane, select, select_u32, set_lane};

/// A type with a packet form.
pub trait Soa: Copy + Debug {
    /// One value per lane.
    type Packet: Clone + Debug;

    /// Returns a packet with the same value in all lanes.
    fn splat(self) -> Self::Packet;

    /// Returns the value in lane `i`.
    fn get(packet: &Self::Packet, i: usize) -> Self;

    /// Sets the value in lane `i`.
    fn set(self, packet: &mut Self::Packet, i: usize);

    /// Replaces the lanes of `target` selected by the mask with the lanes of `new`.
    fn select(mask: &Mask, new: &Self::Packet, target: &mut Self::Packet);
}

impl Soa for f32 {
    type Packet = F32x16;

    #[inline(always)]
    fn splat(self) -> F32x16 {
        [self; PACKET_SIZE]
    }

    #[inline(always)]
    fn get(packet: &F32x16, i: usize) -> Self {
        packet[i]
    }

    #[inline(always)]
    fn set(self, packet: &mut F32x16, i: usize) {
        packet[i] = self;
    }

    #[inline(always)]
    fn select(mask: &Mask, new: &F32x16, target: &mut F32x16) {
        select(mask, new, target);
    }
}

impl Soa for u32 {
    type Packet = [u32; PACKET_SIZE];

    #[inline(always)]
    fn splat(self) -> Self::Packet {
        [self; PACKET_SIZE]
    }

    #[inline(always)]
    fn get(packet: &Self::Packet, i: usize) -> Self {
        packet[i]
    }

    #[inline(always)]
    fn set(self, packet: &mut Self::Packet, i: usize) {
        packet[i] = self;
    }

    #[inline(always)]
    fn select(mask: &Mask, new: &Self::Packet, target: &mut Self::Packet) {
        select_u32(mask, new, target);
    }
}

impl Soa for Vec3 {
    type Packet = Vec3x16;

    #[inline(always)]
    fn splat(self) -> Vec3x16 {
        [[self.x; PACKET_SIZE], [self.y; PACKET_SIZE], [self.z; PACKET_SIZE]]
    }

    #[inline(always)]
    fn get(packet: &Vec3x16, i: usize) -> Self {
        lane(packet, i)
    }

    #[inline(always)]
    fn set(self, packet: &mut Vec3x16, i: usize) {
        set_lane(packet, i, self);
    }

    #[inline(always)]
    fn select(mask: &Mask, new: &Vec3x16, target: &mut Vec3x16) {
        for axis in 0..3 {
            select(mask, &new[axis], &mut target[axis]);
        }
    }
}

impl<T: Soa, const N: usize> Soa for [T; N] {
    type Packet = [T::Packet; N];

    #[inline(always)]
    fn splat(self) -> Self::Packet {
        self.map(T::splat)
    }

    #[inline(always)]
    fn get(packet: &Self::Packet, i: usize) -> Self {
        std::array::from_fn(|number| T::get(&packet[number], i))
    }

    #[inline(always)]
    fn set(self, packet: &mut Self::Packet, i: usize) {
        for number in 0..N {
            self[number].set(&mut packet[number], i);
        }
    }

    #[inline(always)]
    fn select(mask: &Mask, new: &Self::Packet, target: &mut Self::Packet) {
        for number in 0..N {
            T::select(mask, &new[number], &mut target[number]);
        }
    }
}

/// A packet of flags is a bit mask with one bit per lane. All higher bits are 0.
impl Soa for bool {
    type Packet = u32;

    #[inline(always)]
    fn splat(self) -> u32 {
        if self { (1 << PACKET_SIZE) - 1 } else { 0 }
    }

    #[inline(always)]
    fn get(packet: &u32, i: usize) -> Self {
        packet & 1 << i != 0
    }

    #[inline(always)]
    fn set(self, packet: &mut u32, i: usize) {
        *packet = *packet & !(1 << i) | u32::from(self) << i;
    }

    #[inline(always)]
    fn select(mask: &Mask, new: &u32, target: &mut u32) {
        let mut bits = 0;
        for i in 0..PACKET_SIZE {
            bits |= mask[i] & 1 << i;
        }
        *target = new & bits | *target & !bits;
    }
}

/// Generates a struct and its packet form, in which each field is a packet. Fields may be numbers, vectors,
/// arrays, and other structs with a packet form. Each field has a default value, which is stored in unused
/// lanes. The packet may have further fields, listed after `with`, that apply to all lanes. They are set to
/// their defaults by [`Soa::splat`].
///
/// ```
/// use glimt_base::math::Vec3;
/// use glimt_base::math::soa::Soa;
///
/// glimt_base::soa! {
///     /// A colored disk.
///     #[derive(PartialEq)]
///     pub struct Disk in DiskPacket {
///         /// Linear color.
///         color: Vec3 = Vec3::ONE,
///         /// Radius in scene units.
///         radius: f32 = 0.5,
///     }
/// }
///
/// let mut disks = Disk::default().splat();
/// Disk { radius: 2.0, ..Disk::default() }.set(&mut disks, 3);
/// assert_eq!(disks.radius[2..5], [0.5, 2.0, 0.5]);
/// ```
#[macro_export]
macro_rules! soa {
    (
        $(#[$attribute:meta])*
        $vis:vis struct $Name:ident $(<$(const $N:ident: $Of:ty),+>)? in $Packet:ident {
            $($(#[$field_attribute:meta])* $field_vis:vis $field:ident: $type:ty = $default:expr),+ $(,)?
        }
        $(with {
            $($(#[$shared_attribute:meta])* $shared_vis:vis $shared:ident: $shared_type:ty = $shared_default:expr),+ $(,)?
        })?
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug)]
        $vis struct $Name $(<$(const $N: $Of),+>)? {
            $($(#[$field_attribute])* $field_vis $field: $type),+
        }

        impl $(<$(const $N: $Of),+>)? Default for $Name $(<$($N),+>)? {
            #[inline(always)]
            fn default() -> Self {
                Self { $($field: $default),+ }
            }
        }

        #[doc = concat!("A packet of [`", stringify!($Name), "`].")]
        #[derive(Clone, Debug)]
        #[repr(align(64))]
        $vis struct $Packet $(<$(const $N: $Of),+>)? {
            $($(#[$field_attribute])* $field_vis $field: <$type as $crate::math::soa::Soa>::Packet,)+
            $($($(#[$shared_attribute])* $shared_vis $shared: $shared_type,)+)?
        }

        impl $(<$(const $N: $Of),+>)? $crate::math::soa::Soa for $Name $(<$($N),+>)? {
            type Packet = $Packet $(<$($N),+>)?;

            #[inline(always)]
            fn splat(self) -> Self::Packet {
                $Packet {
                    $($field: $crate::math::soa::Soa::splat(self.$field),)+
                    $($($shared: $shared_default,)+)?
                }
            }

            #[inline(always)]
            fn get(packet: &Self::Packet, i: usize) -> Self {
                Self { $($field: <$type as $crate::math::soa::Soa>::get(&packet.$field, i)),+ }
            }

            #[inline(always)]
            fn set(self, packet: &mut Self::Packet, i: usize) {
                $($crate::math::soa::Soa::set(self.$field, &mut packet.$field, i);)+
            }

            #[inline(always)]
            fn select(mask: &$crate::math::lanes::Mask, new: &Self::Packet, target: &mut Self::Packet) {
                $(<$type as $crate::math::soa::Soa>::select(mask, &new.$field, &mut target.$field);)+
            }
        }
    };
}
