//! Embree 4 for comparison, called through its C API and loaded at run time from a user-specified path.
//!
//! Names, constants and layouts match the headers `rtcore_common.h`, `rtcore_ray.h`, `rtcore_buffer.h` and
//! `rtcore_scene.h` of Embree 4.

#![allow(unsafe_code, clippy::panic)]

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicIsize, Ordering};

use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use libloading::{Library, Symbol};

/// Primitive id of a miss.
pub const NONE: u32 = u32::MAX;

const GEOMETRY_TYPE_TRIANGLE: c_int = 0;
const BUFFER_TYPE_INDEX: c_int = 0;
const BUFFER_TYPE_VERTEX: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const SCENE_FLAG_ROBUST: c_int = 1 << 2;
const RAY_QUERY_FLAG_COHERENT: c_int = 1 << 16;

/// Embree's build quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// `RTC_BUILD_QUALITY_MEDIUM`, the default.
    Medium = 1,
    /// `RTC_BUILD_QUALITY_HIGH`: spatial splits.
    High = 2,
}

/// `RTCRayHit`.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RayHit {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: [u32; 2],
    padding: [u32; 3],
}

/// `RTCRay16` followed by `RTCHit16`, with an array of sixteen values per member.
#[repr(C, align(64))]
struct RayHit16 {
    rows: [[f32; 16]; 12],
    normal: [[f32; 16]; 3],
    u: [f32; 16],
    v: [f32; 16],
    primitive: [u32; 16],
    geometry: [u32; 16],
    instance: [[u32; 16]; 2],
}

/// `RTCIntersectArguments`; `RTCOccludedArguments` begins with the same fields.
#[repr(C)]
struct Arguments {
    flags: c_int,
    feature_mask: c_uint,
    context: *mut c_void,
    filter: *const c_void,
    intersect: *const c_void,
    min_width_distance_factor: f32,
}

type Handle = *mut c_void;

/// Embree functions called for every ray.
#[derive(Clone, Copy)]
struct Queries {
    intersect1: unsafe extern "C" fn(Handle, *mut RayHit, *const Arguments),
    occluded1: unsafe extern "C" fn(Handle, *mut RayHit, *const Arguments),
    intersect16: unsafe extern "C" fn(*const c_int, Handle, *mut RayHit16, *const Arguments),
}

/// The loaded Embree library.
pub struct Embree {
    /// Never unloaded, because Embree's threads outlive its devices.
    library: ManuallyDrop<Library>,
    queries: Queries,
}

/// An Embree scene with one mesh and the robust flag.
pub struct EmbreeScene<'a> {
    embree: &'a Embree,
    _mesh: &'a TriangleMesh,
    device: Handle,
    scene: Handle,
    /// Scene memory in bytes, as reported by Embree.
    pub memory_bytes: usize,
}

static MEMORY_BYTES: AtomicIsize = AtomicIsize::new(0);

extern "C" fn count_memory(_user: *mut c_void, bytes: isize, _post: bool) -> bool {
    MEMORY_BYTES.fetch_add(bytes, Ordering::Relaxed);
    true
}

impl Embree {
    /// Loads Embree from `path`.
    pub fn load(path: &Path) -> Result<Self, libloading::Error> {
        // SAFETY: the user chose the library, and Embree's initializers have no preconditions.
        let library = unsafe { Library::new(path)? };
        // SAFETY: the types match the C API.
        let queries = unsafe {
            Queries {
                intersect1: *library.get(b"rtcIntersect1")?,
                occluded1: *library.get(b"rtcOccluded1")?,
                intersect16: *library.get(b"rtcIntersect16")?,
            }
        };
        Ok(Self { library: ManuallyDrop::new(library), queries })
    }

    /// Looks up an API function.
    ///
    /// # Safety
    /// `F` must be the type of the function `name`.
    unsafe fn function<F>(&self, name: &str) -> Symbol<'_, F> {
        // SAFETY: the caller guarantees the type.
        unsafe { self.library.get(name.as_bytes()) }.unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Prepares a scene with one mesh, which will be built with `threads` threads.
    pub fn build<'a>(
        &'a self,
        mesh: &'a TriangleMesh,
        quality: Quality,
        threads: usize,
        isa: &str,
    ) -> EmbreeScene<'a> {
        MEMORY_BYTES.store(0, Ordering::Relaxed);
        let options =
            CString::new(format!("threads={threads},isa={isa}")).expect("the options contain no NUL byte");
        // SAFETY: every call has its C signature; the buffers outlive the scene, which borrows the mesh.
        unsafe {
            let device = self.function::<unsafe extern "C" fn(*const c_char) -> Handle>("rtcNewDevice")(
                options.as_ptr(),
            );
            assert!(!device.is_null(), "Embree failed to create a device");
            type Monitor = extern "C" fn(*mut c_void, isize, bool) -> bool;
            self.function::<unsafe extern "C" fn(Handle, Monitor, *mut c_void)>(
                "rtcSetDeviceMemoryMonitorFunction",
            )(device, count_memory, null_mut());
            let scene = self.function::<unsafe extern "C" fn(Handle) -> Handle>("rtcNewScene")(device);
            self.function::<unsafe extern "C" fn(Handle, c_int)>("rtcSetSceneFlags")(
                scene,
                SCENE_FLAG_ROBUST,
            );
            self.function::<unsafe extern "C" fn(Handle, c_int)>("rtcSetSceneBuildQuality")(
                scene,
                quality as c_int,
            );
            let geometry = self.function::<unsafe extern "C" fn(Handle, c_int) -> Handle>("rtcNewGeometry")(
                device,
                GEOMETRY_TYPE_TRIANGLE,
            );
            self.function::<unsafe extern "C" fn(Handle, c_int)>("rtcSetGeometryBuildQuality")(
                geometry,
                quality as c_int,
            );
            let share = self.function::<unsafe extern "C" fn(
                Handle,
                c_int,
                c_uint,
                c_int,
                *const c_void,
                usize,
                usize,
                usize,
            )>("rtcSetSharedGeometryBuffer");
            let (positions, triangles) = (&mesh.positions, &mesh.triangles);
            share(
                geometry,
                BUFFER_TYPE_VERTEX,
                0,
                FORMAT_FLOAT3,
                positions.as_ptr().cast(),
                0,
                12,
                positions.len(),
            );
            share(
                geometry,
                BUFFER_TYPE_INDEX,
                0,
                FORMAT_UINT3,
                triangles.as_ptr().cast(),
                0,
                12,
                triangles.len(),
            );
            self.function::<unsafe extern "C" fn(Handle)>("rtcCommitGeometry")(geometry);
            self.function::<unsafe extern "C" fn(Handle, Handle) -> c_uint>("rtcAttachGeometry")(
                scene, geometry,
            );
            self.function::<unsafe extern "C" fn(Handle)>("rtcReleaseGeometry")(geometry);
            EmbreeScene { embree: self, _mesh: mesh, device, scene, memory_bytes: 0 }
        }
    }
}

impl EmbreeScene<'_> {
    /// Builds the acceleration structure. The build time is the duration of this call.
    pub fn commit(&mut self) {
        // SAFETY: the scene is alive.
        unsafe { self.embree.function::<unsafe extern "C" fn(Handle)>("rtcCommitScene")(self.scene) };
        self.memory_bytes = MEMORY_BYTES.load(Ordering::Relaxed).max(0) as usize;
    }

    /// Returns the closest hit: t, primitive, u, v.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<(f32, u32, f32, f32)> {
        let mut query = query(ray);
        // SAFETY: the scene is committed, and the query has the layout of `RTCRayHit`.
        unsafe { (self.embree.queries.intersect1)(self.scene, &mut query, null()) };
        (query.geometry != NONE).then_some((query.t_far, query.primitive, query.u, query.v))
    }

    /// Returns whether the ray hits anything.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        let mut query = query(ray);
        // SAFETY: as above; `RTCRayHit` begins with `RTCRay`.
        unsafe { (self.embree.queries.occluded1)(self.scene, &mut query, null()) };
        query.t_far < 0.0
    }

    /// Counts the rays that hit a primitive. Traces sixteen rays at a time and ignores the remainder.
    pub fn closest16(&self, rays: &[Ray], coherent: bool) -> usize {
        let arguments = Arguments {
            flags: if coherent { RAY_QUERY_FLAG_COHERENT } else { 0 },
            feature_mask: u32::MAX,
            context: null_mut(),
            filter: null(),
            intersect: null(),
            min_width_distance_factor: 0.0,
        };
        let mut hits = 0;
        let valid = Aligned([-1; 16]);
        for sixteen in rays.chunks_exact(16) {
            let mut packet = RayHit16 {
                rows: [[0.0; 16]; 12],
                normal: [[0.0; 16]; 3],
                u: [0.0; 16],
                v: [0.0; 16],
                primitive: [NONE; 16],
                geometry: [NONE; 16],
                instance: [[NONE; 16]; 2],
            };
            for (lane, ray) in sixteen.iter().enumerate() {
                for axis in 0..3 {
                    packet.rows[axis][lane] = ray.origin[axis];
                    packet.rows[4 + axis][lane] = ray.direction[axis];
                }
                packet.rows[8][lane] = ray.t_max;
                packet.rows[9][lane] = f32::from_bits(u32::MAX);
            }
            // SAFETY: the scene is committed, and packet and mask have the layout and alignment that the API
            // requires.
            unsafe {
                (self.embree.queries.intersect16)(valid.0.as_ptr(), self.scene, &mut packet, &arguments);
            };
            hits += packet.geometry.iter().filter(|&&geometry| geometry != NONE).count();
        }
        hits
    }
}

#[repr(align(64))]
struct Aligned([c_int; 16]);

#[inline]
fn query(ray: &Ray) -> RayHit {
    RayHit {
        origin: ray.origin.to_array(),
        t_near: 0.0,
        direction: ray.direction.to_array(),
        time: 0.0,
        t_far: ray.t_max,
        mask: u32::MAX,
        id: 0,
        flags: 0,
        normal: [0.0; 3],
        u: 0.0,
        v: 0.0,
        primitive: NONE,
        geometry: NONE,
        instance: [NONE; 2],
        padding: [0; 3],
    }
}

impl Drop for EmbreeScene<'_> {
    fn drop(&mut self) {
        // SAFETY: `build` created both handles, and each is released once.
        unsafe {
            self.embree.function::<unsafe extern "C" fn(Handle)>("rtcReleaseScene")(self.scene);
            self.embree.function::<unsafe extern "C" fn(Handle)>("rtcReleaseDevice")(self.device);
        }
    }
}
