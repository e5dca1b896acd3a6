//! [`crate::raster`] in vectors of eight pixels (AVX2) and sixteen (AVX-512).

use std::arch::x86_64::*;

use crate::{
    PixelEdges, PixelPlanes, PixelTile, PixelTriangle, TilePart,
    raster::{LARGEST_EXPONENT, SIDE, settle},
    x86_lanes::lanes_of,
};

/// [`crate::Isa::cover_tile`], a row at a time.
///
/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn cover_tile8<const IDS: bool, const WRITE: bool>(
    planes: &PixelPlanes,
    triangle: &PixelTriangle<'_>,
    part: &TilePart,
    id: u32,
    tile: &mut PixelTile,
) -> [u64; 2] {
    debug_assert!(part.rows[1] < 8);
    let [top, bottom] = part.rows;
    // SAFETY: the caller's promise; rows are less than eight, so all loads and stores are of the tile,
    // whose rows are 32 bytes of arrays of alignment 64.
    unsafe {
        let columns = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let x = _mm256_add_ps(_mm256_set1_ps(part.first[0]), _mm256_cvtepi32_ps(columns));
        let along = [
            _mm256_mul_ps(_mm256_set1_ps(planes.x[0]), x),
            _mm256_mul_ps(_mm256_set1_ps(planes.x[1]), x),
            _mm256_mul_ps(_mm256_set1_ps(planes.x[2]), x),
            _mm256_mul_ps(_mm256_set1_ps(planes.x[3]), x),
        ];
        let before = _mm256_cmpgt_epi32(_mm256_set1_epi32(part.columns[0] as i32), columns);
        let beyond = _mm256_cmpgt_epi32(columns, _mm256_set1_epi32(part.columns[1] as i32));
        let outside = _mm256_castsi256_ps(_mm256_or_si256(before, beyond));
        let id = _mm256_set1_epi32(id as i32);
        let (mut covered, mut close) = (0u64, 0u64);
        let mut row = top;
        while row <= bottom.min(7) {
            let y = part.first[1] + row as f32;
            let value = |plane: usize| {
                let start = planes.at_origin[plane] + planes.y[plane] * y;
                _mm256_add_ps(_mm256_set1_ps(start), along[plane])
            };
            let plane = value(3);
            let nearness = _mm256_min_ps(plane, _mm256_set1_ps(planes.nearest));
            let stored = tile.nearness.as_mut_ptr().add(8 * row as usize);
            let seen = _mm256_load_ps(stored);
            let inside = _mm256_min_ps(_mm256_min_ps(value(0), value(1)), value(2));
            let doubt = _mm256_set1_ps(PixelPlanes::DOUBT);
            let may = _mm256_cmp_ps::<_CMP_GE_OQ>(inside, _mm256_set1_ps(-PixelPlanes::DOUBT));
            let counts = _mm256_cmp_ps::<_CMP_LE_OQ>(plane, _mm256_set1_ps(planes.limit));
            let may = _mm256_andnot_ps(outside, _mm256_and_ps(may, counts));
            let nearer = _mm256_cmp_ps::<_CMP_GT_OQ>(nearness, seen);
            let stored_ids: *mut __m256i = tile.ids.as_mut_ptr().add(8 * row as usize).cast();
            let mut wins = nearer;
            if IDS {
                let seen_ids = _mm256_load_si256(stored_ids);
                let first = _mm256_cmpeq_epi32(_mm256_min_epu32(id, seen_ids), id);
                let equal = _mm256_cmp_ps::<_CMP_EQ_OQ>(nearness, seen);
                wins = _mm256_or_ps(wins, _mm256_and_ps(equal, _mm256_castsi256_ps(first)));
                let no_sign = _mm256_set1_ps(-0.0);
                let differs = _mm256_andnot_ps(no_sign, _mm256_sub_ps(nearness, seen));
                let size = _mm256_andnot_ps(no_sign, nearness);
                let size = _mm256_mul_ps(size, _mm256_set1_ps(PixelPlanes::CLOSE));
                let near = _mm256_and_ps(may, _mm256_cmp_ps::<_CMP_LE_OQ>(differs, size));
                close |= u64::from(_mm256_movemask_ps(near) as u32) << (8 * row);
            }
            let mut passes = _mm256_and_ps(may, wins);
            let mut bits = _mm256_movemask_ps(passes) as u32;
            let near_edge = _mm256_cmp_ps::<_CMP_LE_OQ>(inside, doubt);
            let doubtful = _mm256_movemask_ps(_mm256_and_ps(passes, near_edge)) as u32;
            if doubtful != 0 {
                bits = settle(triangle, [part.first[0], y], bits, doubtful);
                passes = _mm256_castsi256_ps(lanes_of(bits));
            }
            covered |= u64::from(bits) << (8 * row);
            if WRITE {
                _mm256_store_ps(stored, _mm256_blendv_ps(seen, nearness, passes));
                if IDS {
                    let seen_ids = _mm256_load_si256(stored_ids);
                    let mixed = _mm256_blendv_epi8(seen_ids, id, _mm256_castps_si256(passes));
                    _mm256_store_si256(stored_ids, mixed);
                }
            }
            row += 1;
        }
        [covered, close]
    }
}

/// [`crate::Isa::cover_tile`], two rows at a time.
///
/// # Safety
/// The CPU must have AVX-512 F and DQ.
#[inline(always)]
pub(crate) unsafe fn cover_tile16<const IDS: bool, const WRITE: bool>(
    planes: &PixelPlanes,
    triangle: &PixelTriangle<'_>,
    part: &TilePart,
    id: u32,
    tile: &mut PixelTile,
) -> [u64; 2] {
    debug_assert!(part.rows[1] < 8);
    let [top, bottom] = part.rows;
    // SAFETY: the caller's promise; pairs of rows start at less than eight, so all loads and stores are
    // of the tile, pairs of whose rows are 64 bytes of arrays of alignment 64.
    unsafe {
        let columns = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7);
        let second = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1);
        let x = _mm512_add_ps(_mm512_set1_ps(part.first[0]), _mm512_cvtepi32_ps(columns));
        let second = _mm512_cvtepi32_ps(second);
        let along = [
            _mm512_mul_ps(_mm512_set1_ps(planes.x[0]), x),
            _mm512_mul_ps(_mm512_set1_ps(planes.x[1]), x),
            _mm512_mul_ps(_mm512_set1_ps(planes.x[2]), x),
            _mm512_mul_ps(_mm512_set1_ps(planes.x[3]), x),
        ];
        let wanted_columns = (0xFFu32 << part.columns[0]) & (0xFF >> (7 - part.columns[1].min(7)));
        let wanted_columns = wanted_columns * 0x0101;
        let wanted_rows = [u32::from(top % 2 == 0) * 0xFF, u32::from(bottom % 2 != 0) * 0xFF00];
        let id = _mm512_set1_epi32(id as i32);
        let (mut covered, mut close) = (0u64, 0u64);
        let mut row = top & !1;
        while row <= bottom.min(7) {
            let mut wanted = wanted_columns;
            if row < top {
                wanted &= 0xFF00 | wanted_rows[0];
            }
            if row + 1 > bottom {
                wanted &= 0x00FF | wanted_rows[1];
            }
            let y = _mm512_add_ps(_mm512_set1_ps(part.first[1] + row as f32), second);
            let value = |plane: usize| {
                let slope = _mm512_mul_ps(_mm512_set1_ps(planes.y[plane]), y);
                let start = _mm512_add_ps(_mm512_set1_ps(planes.at_origin[plane]), slope);
                _mm512_add_ps(start, along[plane])
            };
            let plane = value(3);
            let nearness = _mm512_min_ps(plane, _mm512_set1_ps(planes.nearest));
            let stored = tile.nearness.as_mut_ptr().add(8 * row as usize);
            let seen = _mm512_load_ps(stored);
            let inside = _mm512_min_ps(_mm512_min_ps(value(0), value(1)), value(2));
            let doubt = _mm512_set1_ps(PixelPlanes::DOUBT);
            let no_doubt = _mm512_set1_ps(-PixelPlanes::DOUBT);
            let may = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(wanted as u16, inside, no_doubt);
            let limit = _mm512_set1_ps(planes.limit);
            let may = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(may, plane, limit);
            let mut passes = _mm512_mask_cmp_ps_mask::<_CMP_GT_OQ>(may, nearness, seen);
            let stored_ids: *mut __m512i = tile.ids.as_mut_ptr().add(8 * row as usize).cast();
            if IDS {
                let equal = _mm512_mask_cmp_ps_mask::<_CMP_EQ_OQ>(may, nearness, seen);
                let seen_ids = _mm512_load_si512(stored_ids);
                passes |= _mm512_mask_cmple_epu32_mask(equal, id, seen_ids);
                let differs = _mm512_abs_ps(_mm512_sub_ps(nearness, seen));
                let size =
                    _mm512_mul_ps(_mm512_abs_ps(nearness), _mm512_set1_ps(PixelPlanes::CLOSE));
                let near = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(may, differs, size);
                close |= u64::from(near) << (8 * row);
            }
            let doubtful = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(passes, inside, doubt);
            if doubtful != 0 {
                let first = [part.first[0], part.first[1] + row as f32];
                passes = settle(triangle, first, u32::from(passes), u32::from(doubtful)) as u16;
            }
            covered |= u64::from(passes) << (8 * row);
            if WRITE {
                // Whole vectors: a load waits until a masked store is done.
                _mm512_store_ps(stored, _mm512_mask_mov_ps(seen, passes, nearness));
                if IDS {
                    let seen_ids = _mm512_load_si512(stored_ids);
                    _mm512_store_si512(stored_ids, _mm512_mask_mov_epi32(seen_ids, passes, id));
                }
            }
            row += 2;
        }
        [covered, close]
    }
}

/// [`crate::Isa::pixel_planes`], the three edges side by side.
///
/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn pixel_planes<const PERSPECTIVE: bool>(
    corners: &[[f32; 4]; 3],
    first: [f64; 2],
    planes: &mut PixelPlanes,
) -> PixelEdges {
    /// Lanes 1, 2, 0, 3.
    const FOLLOWING: i32 = 0b11_00_10_01;
    /// Lanes 2, 0, 1, 3.
    const PRECEDING: i32 = 0b11_01_00_10;
    // SAFETY: the caller's promise; corners are four numbers each, planes are rows of four of alignment 16,
    // edges rows of four of alignment 32.
    unsafe {
        let [a, b, c] = corners;
        let (a, b) = (_mm_loadu_ps(a.as_ptr()), _mm_loadu_ps(b.as_ptr()));
        let (c, none) = (_mm_loadu_ps(c.as_ptr()), _mm_setzero_ps());
        // Rows become columns: all x, all y, all w, all n.
        let (ab, cd) = (_mm_unpacklo_ps(a, b), _mm_unpacklo_ps(c, none));
        let (x, y) = (_mm_movelh_ps(ab, cd), _mm_movehl_ps(cd, ab));
        let (ab, cd) = (_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, none));
        let (w, n) = (_mm_movelh_ps(ab, cd), _mm_movehl_ps(cd, ab));
        let w = _mm256_cvtps_pd(w);
        let seen = |v: __m128, from: f64| {
            _mm256_sub_pd(_mm256_cvtps_pd(v), _mm256_mul_pd(_mm256_set1_pd(from), w))
        };
        let (x, y) = (seen(x, first[0]), seen(y, first[1]));
        let (x1, x2) =
            (_mm256_permute4x64_pd::<FOLLOWING>(x), _mm256_permute4x64_pd::<PRECEDING>(x));
        let (y1, y2) =
            (_mm256_permute4x64_pd::<FOLLOWING>(y), _mm256_permute4x64_pd::<PRECEDING>(y));
        let (w1, w2) =
            (_mm256_permute4x64_pd::<FOLLOWING>(w), _mm256_permute4x64_pd::<PRECEDING>(w));
        let cross = |p: __m256d, q: __m256d, r: __m256d, s: __m256d| {
            _mm256_sub_pd(_mm256_mul_pd(p, q), _mm256_mul_pd(r, s))
        };
        let (ex, ey) = (cross(y1, w2, w1, y2), cross(w1, x2, x1, w2));
        let e0 = cross(x1, y2, y1, x2);
        let first_of = |v: __m256d| _mm256_castpd256_pd128(v);
        let det = _mm_add_sd(
            _mm_add_sd(
                _mm_mul_sd(first_of(x), first_of(ex)),
                _mm_mul_sd(first_of(y), first_of(ey)),
            ),
            _mm_mul_sd(first_of(w), first_of(e0)),
        );
        let inverse = _mm256_broadcastsd_pd(_mm_div_sd(_mm_set_sd(1.0), det));
        let share = if PERSPECTIVE { inverse } else { _mm256_mul_pd(_mm256_cvtps_pd(n), inverse) };
        // The three sums side by side: columns become rows again.
        let (sx, sy) = (_mm256_mul_pd(share, ex), _mm256_mul_pd(share, ey));
        let s0 = _mm256_mul_pd(share, e0);
        let (xy_even, xy_odd) = (_mm256_unpacklo_pd(sx, sy), _mm256_unpackhi_pd(sx, sy));
        let (zz_even, zz_odd) = (_mm256_unpacklo_pd(s0, s0), _mm256_unpackhi_pd(s0, s0));
        let lane0 = _mm256_permute2f128_pd::<0x20>(xy_even, zz_even);
        let lane1 = _mm256_permute2f128_pd::<0x20>(xy_odd, zz_odd);
        let lane2 = _mm256_permute2f128_pd::<0x31>(xy_even, zz_even);
        let nearness = _mm256_add_pd(_mm256_add_pd(lane0, lane1), lane2);
        let nearness = _mm256_cvtpd_ps(nearness);

        let no_sign = _mm256_set1_pd(-0.0);
        let (ax, ay) = (_mm256_andnot_pd(no_sign, ex), _mm256_andnot_pd(no_sign, ey));
        let slopes = _mm256_mul_pd(_mm256_set1_pd(SIDE), _mm256_max_pd(ax, ay));
        let largest = _mm256_max_pd(slopes, _mm256_andnot_pd(no_sign, e0));
        let largest_exponent = _mm256_set1_epi64x(LARGEST_EXPONENT as i64);
        let exponent_bits = _mm256_set1_epi64x(0x7FF << 52);
        let exponent = _mm256_and_si256(_mm256_castpd_si256(largest), exponent_bits);
        let scale = _mm256_castsi256_pd(_mm256_sub_epi64(largest_exponent, exponent));
        let sign = _mm256_and_pd(no_sign, _mm256_broadcastsd_pd(det));
        let scale = _mm256_or_pd(scale, sign);
        let scaled = |e: __m256d| _mm256_cvtpd_ps(_mm256_mul_pd(e, scale));
        let px = _mm_insert_ps::<0b0011_0000>(scaled(ex), nearness);
        let py = _mm_insert_ps::<0b0111_0000>(scaled(ey), nearness);
        let p0 = _mm_insert_ps::<0b1011_0000>(scaled(e0), nearness);
        let nearest = _mm_max_ss(_mm_max_ss(_mm_movehl_ps(n, n), _mm_shuffle_ps::<1>(n, n)), n);
        planes.nearest = _mm_cvtss_f32(nearest);
        _mm_store_ps(planes.x.as_mut_ptr(), px);
        _mm_store_ps(planes.y.as_mut_ptr(), py);
        _mm_store_ps(planes.at_origin.as_mut_ptr(), p0);
        planes.limit = if PERSPECTIVE { f32::MAX } else { 0.0 };
        let mut edges = PixelEdges { edges: [[0.0; 4]; 3], det: _mm_cvtsd_f64(det) };
        _mm256_store_pd(edges.edges[0].as_mut_ptr(), ex);
        _mm256_store_pd(edges.edges[1].as_mut_ptr(), ey);
        _mm256_store_pd(edges.edges[2].as_mut_ptr(), e0);
        edges
    }
}

/// The raster operations of a token, by the function that covers tiles.
macro_rules! raster_methods {
    ($cover_tile:ident) => {
        #[inline(always)]
        fn pixel_planes<const PERSPECTIVE: bool>(
            self,
            corners: &[[f32; 4]; 3],
            first: [f64; 2],
            planes: &mut crate::PixelPlanes,
        ) -> crate::PixelEdges {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86_raster::pixel_planes::<PERSPECTIVE>(corners, first, planes) }
        }

        #[inline(always)]
        fn cover_tile<const IDS: bool, const WRITE: bool>(
            self,
            planes: &crate::PixelPlanes,
            triangle: &crate::PixelTriangle<'_>,
            part: &crate::TilePart,
            id: u32,
            tile: &mut crate::PixelTile,
        ) -> [u64; 2] {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe {
                crate::x86_raster::$cover_tile::<IDS, WRITE>(planes, triangle, part, id, tile)
            }
        }
    };
}
pub(crate) use raster_methods;
