//! The token of an instruction set and the kernels that run under it.

use crate::{
    Boxes8, Extent16, Frustum, Group16, GroupAxes, Nearest, PixelEdges, PixelPlanes, PixelTile,
    PixelTriangle, Preparation16, QuantizedNode8, Question16, Rays16, Row16, ShearRay, SlabRay,
    TilePart, TriangleHits, TriangleRows, Triangles4, compressed, group, raster,
};

/// A proof that the running CPU has an instruction set: tokens other than [`crate::Scalar`] are only
/// made by detection.
pub trait Isa: Copy + Send + Sync + std::fmt::Debug + 'static {
    /// The name by which `RAYBURST_ISA` and `--isa` know it.
    const NAME: &'static str;

    /// Runs a kernel in a region compiled for this instruction set.
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output;

    /// Which of eight boxes a ray may meet in `t_min ≤ t ≤ t_max`, as bits, and the distances at
    /// which it enters them (no less than `t_min`).
    fn slab8(
        self,
        boxes: &Boxes8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32;

    /// For each of some rays the children of its node whose boxes it may meet, the farthest first, and
    /// how many; stage by stage for all rays, so that what one waits for is hidden behind the others.
    /// Spans are `t_min` and `t_max`.
    ///
    /// `keys[ray][i]` holds the bits of the distance at which the ray enters the box of
    /// `found[ray][i]`, its lowest three bits replaced by the child's slot: bits of numbers that are
    /// not negative sort like the numbers. What is beyond the returned number is unspecified. Needs
    /// `t_min ≥ 0`, which may not be −0.
    #[inline(always)]
    fn sorted8<const N: usize>(
        self,
        nodes: [(&Boxes8, &[u32; 8]); N],
        rays: [&SlabRay; N],
        spans: [[f32; 2]; N],
        keys: [&mut [u32; 8]; N],
        found: [&mut [u32; 8]; N],
    ) -> [usize; N] {
        let mut counts = [0; N];
        for ray in 0..N {
            let ([t_min, t_max], count) = (spans[ray], &mut counts[ray]);
            let (keys, found) = (&mut *keys[ray], &mut *found[ray]);
            let mut distances = [0.0; 8];
            let mut mask = self.slab8(nodes[ray].0, rays[ray], t_min, t_max, &mut distances);
            while mask != 0 {
                let slot = mask.trailing_zeros() as usize % 8;
                mask &= mask - 1;
                let key = (distances[slot].to_bits() & KEY_DISTANCE & !SLOT) | slot as u32;
                let mut place = *count;
                while place > 0 && keys[place - 1] < key {
                    (keys[place], found[place]) = (keys[place - 1], found[place - 1]);
                    place -= 1;
                }
                (keys[place], found[place]) = (key, nodes[ray].1[slot]);
                *count += 1;
            }
        }
        counts
    }

    /// The children of a node whose boxes a ray may meet: returns how many and the slot of the first,
    /// and writes the others by slot. What is beyond is unspecified.
    #[inline(always)]
    fn met8(
        self,
        node: (&Boxes8, &[u32; 8]),
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        others: &mut [u32; 8],
    ) -> (usize, u32) {
        let mask = self.slab8(node.0, ray, t_min, t_max, &mut [0.0; 8]);
        let mut rest = mask & mask.wrapping_sub(1);
        let mut count = 0;
        while rest != 0 {
            others[count % 8] = node.1[rest.trailing_zeros() as usize % 8];
            rest &= rest - 1;
            count += 1;
        }
        (mask.count_ones() as usize, mask.trailing_zeros() & SLOT)
    }

    /// [`Isa::slab8`] of a compressed node: boxes that are barely missed may differ.
    #[inline(always)]
    fn quantized_slab8(
        self,
        node: &QuantizedNode8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32 {
        self.slab8(&self.expand8(node).0, ray, t_min, t_max, distances)
    }

    /// [`Isa::sorted8`] of compressed nodes: boxes that are barely missed may differ.
    #[inline(always)]
    fn quantized_sorted8<const N: usize>(
        self,
        nodes: [&QuantizedNode8; N],
        rays: [&SlabRay; N],
        spans: [[f32; 2]; N],
        keys: [&mut [u32; 8]; N],
        found: [&mut [u32; 8]; N],
    ) -> [usize; N] {
        let nodes = nodes.map(|node| self.expand8(node));
        let nodes = nodes.each_ref().map(|(boxes, children)| (boxes, children));
        self.sorted8(nodes, rays, spans, keys, found)
    }

    /// [`Isa::met8`] of a compressed node: boxes that are barely missed may differ.
    #[inline(always)]
    fn quantized_met8(
        self,
        node: &QuantizedNode8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        others: &mut [u32; 8],
    ) -> (usize, u32) {
        let (boxes, children) = self.expand8(node);
        self.met8((&boxes, &children), ray, t_min, t_max, others)
    }

    /// One more than the index of the last key that is no greater than `limit`; zero if all are.
    /// Keys and limit are less than 2³¹.
    #[inline(always)]
    fn last_within8(self, keys: &[u32; 8], limit: u32) -> usize {
        keys.iter().rposition(|&key| key <= limit).map_or(0, |index| index + 1)
    }

    /// Which of four triangles a ray meets in `t_min ≤ t ≤ t_max`; returns `hits.mask`, and leaves
    /// the rest of `hits` alone if that is zero.
    fn triangles4(
        self,
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32;

    /// The nearest of four triangles that a ray meets in `t_min ≤ t ≤ t_max`, without a branch;
    /// `keep` has lanes that may be met if they wind counter-clockwise seen from the origin, and if
    /// clockwise.
    #[inline(always)]
    fn nearest4(
        self,
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        keep: [u32; 2],
    ) -> Nearest {
        let mut hits = TriangleHits::NONE;
        let mut mask = self.triangles4(block, ray, t_min, t_max, &mut hits);
        mask &= (hits.front & keep[0]) | (!hits.front & keep[1]);
        let mut nearest = Nearest { t: f32::INFINITY, lane: 0, mask, doubtful: false };
        for lane in (0..4).filter(|lane| mask >> lane & 1 != 0) {
            let t = hits.t[lane];
            nearest.doubtful |= t == nearest.t;
            if t < nearest.t {
                nearest = Nearest { t, lane: lane as u32, mask, doubtful: false };
            }
        }
        nearest
    }

    /// [`Isa::nearest4`] of four rays, each with a block of its own.
    #[inline(always)]
    fn nearest4_of4(
        self,
        blocks: [&Triangles4; 4],
        rays: [&ShearRay; 4],
        spans: [[f32; 2]; 4],
        keep: [[u32; 2]; 4],
    ) -> [Nearest; 4] {
        let mut all = [Nearest::NONE; 4];
        let mut i = 0;
        while i < 4 {
            let [t_min, t_max] = spans[i];
            all[i] = self.nearest4(blocks[i], rays[i], t_min, t_max, keep[i]);
            i += 1;
        }
        all
    }

    /// The boxes of a compressed node, and its children's words. The box of a slot without a child is
    /// empty along x.
    #[inline(always)]
    fn expand8(self, node: &QuantizedNode8) -> (Boxes8, [u32; 8]) {
        compressed::expand8(node)
    }

    /// The triangles of a compressed leaf. Lanes without one get NaN, and `unused` for an id.
    #[inline(always)]
    fn expand4(self, rows: TriangleRows<'_>, unused: u32) -> Triangles4 {
        compressed::expand4(rows, unused)
    }

    /// [`Isa::triangles4`] of a compressed leaf.
    #[inline(always)]
    fn rows_triangles4(
        self,
        rows: TriangleRows<'_>,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32 {
        self.triangles4(&self.expand4(rows, 0), ray, t_min, t_max, hits)
    }

    /// [`Isa::nearest4`] of a compressed leaf.
    #[inline(always)]
    fn rows_nearest4(
        self,
        rows: TriangleRows<'_>,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        keep: [u32; 2],
    ) -> Nearest {
        self.nearest4(&self.expand4(rows, 0), ray, t_min, t_max, keep)
    }

    /// Puts sixteen rays side by side, each given as origin, `t_min`, direction, `t_max`.
    #[inline(always)]
    fn load16(self, rays: &[[f32; 8]; 16], to: &mut Rays16) {
        for (lane, ray) in rays.iter().enumerate() {
            let [ox, oy, oz, t_min, dx, dy, dz, t_max] = *ray;
            (to.t_min[lane], to.t_max[lane]) = (t_min, t_max);
            for (axis, (o, d)) in [(ox, dx), (oy, dy), (oz, dz)].into_iter().enumerate() {
                (to.origin[axis][lane], to.direction[axis][lane]) = (o, d);
            }
        }
    }

    /// Prepares sixteen rays: as [`SlabRay`] and [`ShearRay`] are prepared, with errors, signs and
    /// scale in common. Intervals must not start below zero.
    #[inline(always)]
    fn prepare16(
        self,
        rays: &Rays16,
        how: &Preparation16,
        axes: &GroupAxes,
        group: &mut Group16,
        extent: &mut Extent16,
    ) {
        group::prepare16(rays, how, axes, group, extent);
    }

    /// Where the last of the `active` rays of a group ends, from the waist on.
    #[inline(always)]
    fn end16(self, group: &Group16, active: u32) -> f32 {
        group::end16(group, active)
    }

    /// The least number of the first row and the greatest of the second; none may be NaN.
    #[inline(always)]
    fn ends16(self, rows: &[Row16; 2]) -> [f32; 2] {
        group::ends16(rows)
    }

    /// Which of eight boxes any ray of an interval may meet in `t_min ≤ t ≤ t_max`, as bits, and the
    /// least distances at which one enters them.
    #[inline(always)]
    fn frustum8(
        self,
        boxes: &Boxes8,
        axes: &GroupAxes,
        frustum: &Frustum,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32 {
        group::frustum8(boxes, axes, frustum, t_min, t_max, distances)
    }

    /// Which of sixteen rays may meet the box in a slot within their intervals, as bits.
    #[inline(always)]
    fn box16(self, boxes: &Boxes8, slot: usize, axes: &GroupAxes, group: &Group16) -> u32 {
        group::box16(boxes, slot, axes, group)
    }

    /// Which of sixteen rays meet the triangle in a lane within their intervals, and rays for which
    /// [`Isa::triangles4`] must be asked instead, as bits. If `NEAREST`, rays that meet it keep what
    /// they met, and their intervals end there.
    #[inline(always)]
    fn triangle16<const NEAREST: bool>(
        self,
        block: &Triangles4,
        lane: usize,
        axes: &GroupAxes,
        group: &mut Group16,
        question: &Question16,
    ) -> (u32, u32) {
        group::triangle16::<NEAREST>(block, lane, axes, group, question)
    }

    /// The planes of a triangle over pixels; corners and `first` are those of [`PixelTriangle`]. Values are
    /// meaningless if the determinant is zero.
    ///
    /// Products are taken in `f64`, where those of a shared edge's corners are the same for both triangles but
    /// for the sign; what is rounded is the same for both, too.
    #[inline(always)]
    fn pixel_planes<const PERSPECTIVE: bool>(
        self,
        corners: &[[f32; 4]; 3],
        first: [f64; 2],
        planes: &mut PixelPlanes,
    ) -> PixelEdges {
        raster::pixel_planes::<PERSPECTIVE>(corners, first, planes)
    }

    /// The pixels of a part of a tile that a triangle covers and wins, as bits, row by row: whose centres are
    /// inside or on left or top edges, where its nearness does not exceed its limit, and where it is nearer than
    /// what is seen or, if `IDS`, as near and of no greater id. If `WRITE`, it is seen there from now on; without
    /// `IDS`, ids are left alone. Then, with `IDS`, the pixels it may cover where it is as near as what was seen
    /// but for rounding ([`PixelPlanes::CLOSE`]).
    #[inline(always)]
    fn cover_tile<const IDS: bool, const WRITE: bool>(
        self,
        planes: &PixelPlanes,
        triangle: &PixelTriangle<'_>,
        part: &TilePart,
        id: u32,
        tile: &mut PixelTile,
    ) -> [u64; 2] {
        raster::cover_tile::<IDS, WRITE>(planes, triangle, part, id, tile)
    }

    /// Asks for the cache line at an address, which need not be valid.
    fn prefetch<T>(self, address: *const T);
}

/// Bits of a key that hold a slot.
pub const SLOT: u32 = 7;
/// Bits of a number that is not negative.
const KEY_DISTANCE: u32 = u32::MAX >> 1;

/// Work written once for every instruction set.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// Does the work. Implementations are `#[inline(always)]`, and so is what they call in their
    /// inner loops: code that is not inlined is compiled for the baseline instruction set.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}
