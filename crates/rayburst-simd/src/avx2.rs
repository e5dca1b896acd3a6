//! AVX2 with FMA (the level x86-64-v3): 8-wide boxes, 4-wide triangles.

use std::arch::x86_64::*;

use crate::{
    Boxes8, Isa, Kernel, ShearRay, SlabRay, TriangleHits, Triangles4,
    triangles::{LARGE, SMALL, decide_exactly},
};

/// Proof that the CPU has AVX2, FMA, BMI1, BMI2, F16C, LZCNT and POPCNT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx2(());

impl Avx2 {
    /// The token, if the CPU has every feature of the level.
    pub fn detect() -> Option<Self> {
        let found = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("f16c")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        found.then_some(Self(()))
    }
}

impl Isa for Avx2 {
    const NAME: &'static str = "avx2";

    #[inline(always)]
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,f16c,lzcnt,popcnt")]
        fn region<K: Kernel>(isa: Avx2, kernel: K) -> K::Output {
            kernel.run(isa)
        }
        // SAFETY: `self` exists, so `detect` saw every feature of the region on this CPU.
        unsafe { region(self, kernel) }
    }

    #[inline(always)]
    fn slab8(
        self,
        boxes: &Boxes8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32 {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { slab8(boxes, ray, t_min, t_max, distances) }
    }

    #[inline(always)]
    fn triangles4(
        self,
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32 {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { triangles4(block, ray, t_min, t_max, hits) }
    }

    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        // SAFETY: a prefetch neither faults nor changes memory, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,f16c,lzcnt,popcnt")]
fn slab8(boxes: &Boxes8, ray: &SlabRay, t_min: f32, t_max: f32, distances: &mut [f32; 8]) -> u32 {
    let (inverse, rows) = (ray.inverse(), ray.near_plane());
    let (near_offset, far_offset) = (ray.near_offset(), ray.far_offset());
    let plane = |row: usize, axis: usize, offset: f32| {
        debug_assert!(row < 6);
        // SAFETY: `SlabRay` holds rows below six, and flipping the lowest bit keeps them so; rows
        // of an array of alignment 64 are 32 bytes long.
        let planes = unsafe { _mm256_load_ps(boxes.planes.as_ptr().add(row).cast()) };
        _mm256_fmsub_ps(planes, _mm256_set1_ps(inverse[axis]), _mm256_set1_ps(offset))
    };
    let near_x = plane(rows[0], 0, near_offset[0]);
    let near_y = plane(rows[1], 1, near_offset[1]);
    let near_z = plane(rows[2], 2, near_offset[2]);
    let far_x = plane(rows[0] ^ 1, 0, far_offset[0]);
    let far_y = plane(rows[1] ^ 1, 1, far_offset[1]);
    let far_z = plane(rows[2] ^ 1, 2, far_offset[2]);
    let near =
        _mm256_max_ps(_mm256_max_ps(near_x, near_y), _mm256_max_ps(near_z, _mm256_set1_ps(t_min)));
    let far =
        _mm256_min_ps(_mm256_min_ps(far_x, far_y), _mm256_min_ps(far_z, _mm256_set1_ps(t_max)));
    // SAFETY: `distances` has room for eight lanes; the store needs no alignment.
    unsafe { _mm256_storeu_ps(distances.as_mut_ptr(), near) };
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,f16c,lzcnt,popcnt")]
fn triangles4(
    block: &Triangles4,
    ray: &ShearRay,
    t_min: f32,
    t_max: f32,
    hits: &mut TriangleHits,
) -> u32 {
    let (origin, axes, shear) = (ray.origin(), ray.axes(), ray.shear());
    let relative = |corner: usize, k: usize| {
        debug_assert!(axes[k] < 3);
        // SAFETY: `ShearRay` holds axes below three; each row of four lanes starts at a multiple of
        // 16 bytes of a structure of alignment 32.
        let row = unsafe {
            _mm_load_ps(block.vertices.as_ptr().cast::<f32>().add(12 * corner + 4 * axes[k]))
        };
        _mm_sub_ps(row, _mm_set1_ps(origin[k]))
    };
    let sheared = |corner: usize| {
        let z = relative(corner, 2);
        let x = _mm_sub_ps(relative(corner, 0), _mm_mul_ps(_mm_set1_ps(shear[0]), z));
        let y = _mm_sub_ps(relative(corner, 1), _mm_mul_ps(_mm_set1_ps(shear[1]), z));
        (x, y, _mm_mul_ps(_mm_set1_ps(shear[2]), z))
    };
    let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(0), sheared(1), sheared(2));
    let u = _mm_sub_ps(_mm_mul_ps(cx, by), _mm_mul_ps(cy, bx));
    let v = _mm_sub_ps(_mm_mul_ps(ax, cy), _mm_mul_ps(ay, cx));
    let w = _mm_sub_ps(_mm_mul_ps(bx, ay), _mm_mul_ps(by, ax));
    let zero = _mm_setzero_ps();
    let least = _mm_min_ps(_mm_min_ps(u, v), w);
    let greatest = _mm_max_ps(_mm_max_ps(u, v), w);
    let mixed = _mm_and_ps(_mm_cmplt_ps(least, zero), _mm_cmpgt_ps(greatest, zero));
    if _mm_movemask_ps(mixed) == 0xF {
        return 0;
    }
    let det = _mm_add_ps(_mm_add_ps(u, v), w);
    let size = _mm_andnot_ps(_mm_set1_ps(-0.0), det);
    let delicate = _mm_or_ps(
        _mm_or_ps(_mm_cmpeq_ps(least, zero), _mm_cmpeq_ps(greatest, zero)),
        _mm_or_ps(_mm_cmplt_ps(size, _mm_set1_ps(SMALL)), _mm_cmpgt_ps(size, _mm_set1_ps(LARGE))),
    );
    let scaled = _mm_add_ps(_mm_add_ps(_mm_mul_ps(u, az), _mm_mul_ps(v, bz)), _mm_mul_ps(w, cz));
    let t = _mm_div_ps(scaled, det);
    let inside =
        _mm_and_ps(_mm_cmpge_ps(t, _mm_set1_ps(t_min)), _mm_cmple_ps(t, _mm_set1_ps(t_max)));
    let mask = _mm_movemask_ps(_mm_andnot_ps(mixed, inside)) as u32;
    let mut exact = _mm_movemask_ps(_mm_andnot_ps(mixed, delicate)) as u32;
    if mask | exact == 0 {
        return 0;
    }
    // SAFETY: the arrays have room for four lanes each; the stores need no alignment.
    unsafe {
        _mm_storeu_ps(hits.t.as_mut_ptr(), t);
        _mm_storeu_ps(hits.u.as_mut_ptr(), _mm_div_ps(v, det));
        _mm_storeu_ps(hits.v.as_mut_ptr(), _mm_div_ps(w, det));
    }
    hits.mask = mask;
    hits.front = _mm_movemask_ps(_mm_cmpgt_ps(det, zero)) as u32;
    while exact != 0 {
        let lane = exact.trailing_zeros() as usize;
        decide_exactly(block, ray, lane, t_min, t_max, hits);
        exact &= exact - 1;
    }
    hits.mask
}
