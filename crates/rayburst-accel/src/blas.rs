//! A bottom-level structure: the triangles of many geometries.

use std::{ops::ControlFlow, sync::OnceLock, time::Instant};

use glam::Vec3;
use rayburst_math::{Aabb, Hit, Ray};
use rayburst_simd::{Isa, IsaLevel, Triangles4};

use crate::{
    BuildError, BuildOptions, BuildQuality, BuildStats, Builder, BvhDefect, CandidateFilter,
    Geometry, GeometryInfo, InstanceFlags, Layout, TraceOptions, TriangleMesh, ValidationReport,
    build::{
        binned_sah::{BinnedSah, MAX_DEPTH},
        monitor::Monitor,
        morton::Keys,
        ploc::Ploc,
        primitives::{self, MAX_PRIMITIVES},
        reinsertion::reinsert,
        sbvh::Sbvh,
        triangle_keys,
    },
    layout::{
        bvh2::Bvh2,
        bvh8::Bvh8,
        compressed::compress,
        triangles::{BLOCK, TriangleId, TriangleLeaves, locate},
        view::TreeView,
    },
    procedural::ProceduralTree,
    refit::{changed::Links, procedural::split},
    structure::{Stacks, Structure},
    traverse::{
        closest::Closest,
        count::Count,
        prepare::PreparedRay,
        query::{Asker, Place, Query, trace_blas},
    },
    validate,
};

/// The triangles of many geometries, ready to be traced.
#[derive(Clone, Debug)]
pub struct Blas {
    pub(crate) tree: Bvh8,
    /// The number of each geometry's first triangle, and after the last the number of all.
    starts: Vec<u32>,
    stats: BuildStats,
    isa: IsaLevel,
    /// Where each triangle's block is, made when first asked for.
    blocks: OnceLock<Vec<u32>>,
    /// Triangles in no block, found when first asked for.
    absent: OnceLock<Vec<u32>>,
    /// The ways up the tree, made when first asked for.
    links: OnceLock<Links>,
    /// What each geometry is.
    infos: Vec<GeometryInfo>,
    /// The tree of procedural primitives, if there are any.
    procedural: Option<Box<ProceduralTree>>,
}

impl Blas {
    /// Builds over triangle meshes and procedural primitives; their order gives the geometry indices of
    /// hits. Triangles and procedural primitives get a tree each.
    pub fn of_geometries(
        geometries: &[Geometry<'_>],
        options: &BuildOptions<'_>,
    ) -> Result<Self, BuildError> {
        let begin = Instant::now();
        let procedural = ProceduralTree::build(geometries, options)?;
        let (meshes, _) = split(geometries);
        let mut blas = Self::build(&meshes, options)?;
        blas.infos = geometries.iter().map(Geometry::info).collect();
        blas.procedural = procedural.map(Box::new);
        blas.stats.seconds = begin.elapsed().as_secs_f64();
        Ok(blas)
    }

    /// Builds over triangle meshes; their order gives the geometry indices of hits.
    pub fn build(
        geometries: &[TriangleMesh<'_>],
        options: &BuildOptions<'_>,
    ) -> Result<Self, BuildError> {
        let begin = Instant::now();
        let isa = options.resolve_isa()?;
        let starts = number_triangles(geometries)?;
        let leaves = TriangleLeaves { geometries, starts: &starts[..geometries.len()] };
        let monitor = Monitor::new(options.control);
        monitor.check()?;
        let bins = match options.quality {
            BuildQuality::Fast => 8,
            BuildQuality::Balanced | BuildQuality::Best => 32,
        };
        let leaf_size = BLOCK;
        let references_of = || {
            let (refs, _) = primitives::of_triangles(geometries, leaves.starts)?;
            monitor.begin(refs.len());
            Ok::<_, BuildError>(refs)
        };
        let builder = options.resolve_builder();
        let effort = options.resolve_reinsertion(builder)?;
        let widen = |mut binary: Bvh2| {
            reinsert(&mut binary, &effort, monitor)?;
            Bvh8::collapse(&binary, &leaves)
        };
        let (tree, primitives, references) = match builder {
            Builder::Lbvh => {
                let keys = triangle_keys::of_triangles(geometries, leaves.starts, options.curve)?;
                let keys = Keys::sort(keys);
                monitor.check()?;
                (Bvh8::from_keys(&keys, &leaves)?, keys.len(), keys.len())
            }
            Builder::BinnedSah => {
                let refs = references_of()?;
                let primitives = refs.len();
                let max_depth = MAX_DEPTH;
                let binary = BinnedSah { bins, leaf_size, max_depth, monitor }.build(refs)?;
                // A cancelled tree has leaves of any size.
                monitor.check()?;
                (widen(binary)?, primitives, primitives)
            }
            Builder::Hlbvh => {
                let keys = triangle_keys::of_triangles(geometries, leaves.starts, options.curve)?;
                monitor.check()?;
                let keys = Keys::sort(keys);
                monitor.check()?;
                monitor.begin(keys.len());
                (Bvh8::from_clusters(&keys, &leaves, bins, monitor)?, keys.len(), keys.len())
            }
            Builder::Ploc => {
                let refs = references_of()?;
                let binary = Ploc { curve: options.curve, leaf_size, monitor }.build(&refs)?;
                (widen(binary)?, refs.len(), refs.len())
            }
            Builder::SpatialSplits => {
                let refs = references_of()?;
                let primitives = refs.len();
                let budget = options.resolve_budget();
                let splits = Sbvh { bins, leaf_size, budget, shapes: &leaves, monitor };
                let (binary, references) = splits.build(refs)?;
                monitor.check()?;
                (widen(binary)?, primitives, references)
            }
        };
        let tree = match options.layout {
            Layout::Wide => tree,
            Layout::Compressed => compress(tree)?,
        };
        monitor.check()?;
        monitor.finish();
        let inactive = starts[geometries.len()] as usize - primitives;
        let stats = BuildStats {
            primitives,
            inactive,
            references,
            nodes: tree.shape.nodes,
            leaves: tree.shape.leaves,
            depth: tree.shape.depth,
            sah_cost: tree.shape.sah_cost,
            bytes: tree.bytes() + size_of_val(starts.as_slice()),
            seconds: begin.elapsed().as_secs_f64(),
        };
        let (blocks, absent, links) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
        let infos = geometries.iter().map(|&mesh| Geometry::from(mesh).info()).collect();
        let procedural = None;
        Ok(Self { tree, starts, stats, isa, blocks, absent, links, infos, procedural })
    }

    /// What the build made, of both trees together.
    pub fn stats(&self) -> BuildStats {
        let mut stats = self.stats;
        stats.bytes += size_of_val(self.infos.as_slice());
        match &self.procedural {
            Some(procedural) => procedural.add_to(stats),
            None => stats,
        }
    }

    /// The box around all primitives that can be hit; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds.union(self.procedural_bounds())
    }

    /// The box around all triangles that can be hit; empty if there are none.
    pub(crate) fn triangle_bounds(&self) -> Aabb {
        self.tree.bounds
    }

    /// The box around all procedural primitives that can be met; empty if there are none.
    pub(crate) fn procedural_bounds(&self) -> Aabb {
        self.procedural.as_ref().map_or(Aabb::EMPTY, |procedural| procedural.bounds())
    }

    /// The tree of procedural primitives, to be refitted.
    pub(crate) fn procedural_mut(&mut self) -> Option<&mut ProceduralTree> {
        self.procedural.as_deref_mut()
    }

    /// The tree of procedural primitives.
    pub(crate) fn procedural(&self) -> Option<&ProceduralTree> {
        self.procedural.as_deref()
    }

    /// What each geometry is.
    pub fn geometries(&self) -> &[GeometryInfo] {
        &self.infos
    }

    /// Whether a ray may ask about a triangle more than once: after spatial splits.
    pub fn may_ask_twice(&self) -> bool {
        self.has_duplicates()
    }

    /// How many geometries it was built from.
    pub fn geometry_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The instruction set of its kernels.
    pub fn isa(&self) -> IsaLevel {
        self.isa
    }

    /// The corners of a triangle as they are traced, after the geometry's transform; `None` if there
    /// is no such triangle or it can never be hit. The first call makes an index of four bytes a
    /// triangle.
    pub fn triangle(&self, geometry: u32, primitive: u32) -> Option<[Vec3; 3]> {
        let triangle = self.number(geometry, primitive)?;
        let at = self.blocks.get_or_init(|| self.index_blocks())[triangle as usize];
        if at == NO_BLOCK {
            return None;
        }
        let block = self.tree.block(at);
        let lane = (0..BLOCK).find(|&l| TriangleId::of_lane(&block, l).triangle() == triangle)?;
        let corners = block
            .vertices
            .map(|corner| Vec3::new(corner[0][lane], corner[1][lane], corner[2][lane]));
        // A refit writes NaN where a triangle can no longer be hit.
        corners[0].is_finite().then_some(corners)
    }

    /// Proves the structure: each triangle that can be hit reached once, or covered by the boxes of the
    /// leaves that it is in after spatial splits; boxes enclosing, references in bounds, depth within
    /// what traversal allows.
    pub fn validate(&self) -> Result<ValidationReport, BvhDefect> {
        let report = self.validate_triangles()?;
        match &self.procedural {
            Some(procedural) => procedural.validate(report),
            None => Ok(report),
        }
    }

    fn validate_triangles(&self) -> Result<ValidationReport, BvhDefect> {
        let total = self.starts[self.geometry_count()];
        let expected = self.stats.primitives;
        let half_lines = size_of::<Triangles4>() / 32;
        if self.has_duplicates() {
            return validate::split_tree(&self.tree, total, expected, half_lines, |value| {
                self.leaf(value).collect()
            });
        }
        validate::tree(&self.tree, total, expected, half_lines, |value| {
            let boxes = self.leaf(value);
            boxes.map(|(triangle, corners)| (triangle, Aabb::of_points(corners))).collect()
        })
    }

    /// The triangles of a leaf and their corners.
    fn leaf(&self, value: u32) -> impl Iterator<Item = (u32, [Vec3; 3])> + use<> {
        let block = self.tree.block(value);
        (0..BLOCK).filter_map(move |lane| {
            let id = TriangleId::of_lane(&block, lane);
            let corners = block
                .vertices
                .map(|corner| Vec3::new(corner[0][lane], corner[1][lane], corner[2][lane]));
            let hittable = id != TriangleId::NONE && !corners[0].x.is_nan();
            hittable.then_some((id.triangle(), corners))
        })
    }

    /// Whether a triangle may be in several leaves.
    pub(crate) fn has_duplicates(&self) -> bool {
        self.stats.references > self.stats.primitives
    }

    /// The geometry and primitive of a triangle numbered through all geometries.
    #[inline]
    pub(crate) fn locate(&self, triangle: u32) -> (u32, u32) {
        // The usual case: one geometry's start, and the number of all.
        if let [_, _] = self.starts[..] { (0, triangle) } else { locate(&self.starts, triangle) }
    }

    /// The number of a triangle through all geometries, if there is such a triangle.
    pub(crate) fn number(&self, geometry: u32, primitive: u32) -> Option<u32> {
        let start = *self.starts.get(geometry as usize)?;
        let end = *self.starts.get(geometry as usize + 1)?;
        start.checked_add(primitive).filter(|&triangle| triangle < end)
    }

    /// How many triangles a geometry has.
    pub(crate) fn triangle_count(&self, geometry: usize) -> usize {
        (self.starts[geometry + 1] - self.starts[geometry]) as usize
    }

    /// The tree, the numbers of the geometries' first triangles and of all, and the counts.
    pub(crate) fn parts(&mut self) -> (&mut Bvh8, &[u32], &mut BuildStats) {
        (&mut self.tree, &self.starts, &mut self.stats)
    }

    /// The triangles in no block: those that could not be hit when it was built.
    pub(crate) fn absent(&self) -> &[u32] {
        self.absent.get_or_init(|| {
            if self.stats.inactive == 0 {
                return vec![];
            }
            let blocks = self.blocks.get_or_init(|| self.index_blocks());
            (0..blocks.len() as u32).filter(|&i| blocks[i as usize] == NO_BLOCK).collect()
        })
    }

    /// Where each triangle's block is, and the ways up, until [`Self::keep_links`].
    pub(crate) fn take_links(&mut self) -> (Vec<u32>, Links) {
        let blocks = self.blocks.take().unwrap_or_else(|| self.index_blocks());
        let links = self.links.take().unwrap_or_else(|| {
            Links::new(&self.tree, &blocks, |leaf| {
                let block = self.tree.block(leaf);
                let ids = (0..BLOCK).map(move |lane| TriangleId::of_lane(&block, lane));
                ids.filter(|&id| id != TriangleId::NONE).map(TriangleId::triangle)
            })
        });
        (blocks, links)
    }

    /// Keeps what [`Self::take_links`] gave.
    pub(crate) fn keep_links(&mut self, blocks: Vec<u32>, links: Links) {
        self.blocks = OnceLock::from(blocks);
        self.links = OnceLock::from(links);
    }

    /// How many triangles are in blocks, but cannot be hit since a refit.
    pub(crate) fn count_hidden(&self) -> usize {
        let mut hidden = vec![];
        self.tree.for_each_leaf(|value| {
            let block = self.tree.block(value);
            hidden.extend(
                (0..BLOCK)
                    .filter(|&lane| block.vertices[0][0][lane].is_nan())
                    .map(|lane| TriangleId::of_lane(&block, lane))
                    .filter(|&id| id != TriangleId::NONE)
                    .map(TriangleId::triangle),
            );
        });
        hidden.sort_unstable();
        hidden.dedup();
        hidden.len()
    }

    fn index_blocks(&self) -> Vec<u32> {
        let mut blocks = vec![NO_BLOCK; self.starts[self.geometry_count()] as usize];
        self.tree.for_each_leaf(|value| {
            let block = self.tree.block(value);
            for lane in 0..BLOCK {
                let id = TriangleId::of_lane(&block, lane);
                if id != TriangleId::NONE {
                    blocks[id.triangle() as usize] = value;
                }
            }
        });
        blocks
    }
}

/// Marks triangles in no block.
pub(crate) const NO_BLOCK: u32 = u32::MAX;

/// The number of each geometry's first triangle, and the number of all.
fn number_triangles(geometries: &[TriangleMesh<'_>]) -> Result<Vec<u32>, BuildError> {
    let mut starts = Vec::with_capacity(geometries.len() + 1);
    let mut total = 0usize;
    starts.push(0);
    for mesh in geometries {
        total = total.saturating_add(mesh.indices.len());
        if total > MAX_PRIMITIVES {
            let count = geometries.iter().map(|mesh| mesh.indices.len()).sum();
            return Err(BuildError::TooMany { what: "triangles", count, limit: MAX_PRIMITIVES });
        }
        starts.push(total as u32);
    }
    Ok(starts)
}

impl Structure for Blas {
    const TWO_LEVEL: bool = false;

    fn isa_level(&self) -> IsaLevel {
        self.isa
    }

    #[inline(always)]
    fn trace<I: Isa, Q: Query, F: CandidateFilter, C: Count>(
        &self,
        isa: I,
        asker: &Asker<'_, F>,
        options: &TraceOptions,
        stacks: &mut Stacks,
        query: &mut Q,
        count: &mut C,
    ) -> ControlFlow<()> {
        let Some((prepared, Some(place))) = self.enter_root(asker.ray, options) else {
            return ControlFlow::Continue(());
        };
        trace_blas(isa, &place, &prepared, asker, &mut stacks.bottom, query, count)
    }

    #[inline(always)]
    fn finish(&self, closest: &Closest) -> Hit {
        closest.finish(|_, triangle| self.locate(triangle))
    }

    #[inline(always)]
    fn enter_root(
        &self,
        ray: &Ray,
        options: &TraceOptions,
    ) -> Option<(PreparedRay, Option<Place<'_>>)> {
        let prepared = PreparedRay::new(ray, &self.tree.bounds, 0.0)?;
        Some((prepared, Some(Place::new(self, 0, InstanceFlags::default(), options))))
    }

    #[inline(always)]
    fn place(&self, options: &TraceOptions) -> Option<Place<'_>> {
        Some(Place::new(self, 0, InstanceFlags::default(), options))
    }

    #[inline(always)]
    fn root_view(&self) -> TreeView {
        self.tree.view()
    }

    #[inline(always)]
    fn stack_entries(&self) -> usize {
        self.tree.stack_entries()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Curve, layout::bvh8::defects};

    fn terrain(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let height = |x: u32, z: u32| ((x * 7919 + z * 104_729) % 97) as f32 * 0.01;
        let positions = (0..=n)
            .flat_map(|z| (0..=n).map(move |x| Vec3::new(x as f32, height(x, z), z as f32)))
            .collect();
        let indices = (0..n)
            .flat_map(|z| (0..n).map(move |x| z * (n + 1) + x))
            .flat_map(|a| [[a, a + n + 1, a + 1], [a + 1, a + n + 1, a + n + 2]])
            .collect();
        (positions, indices)
    }

    fn build(n: u32, quality: BuildQuality) -> Blas {
        build_with(n, &BuildOptions { quality, ..BuildOptions::default() })
    }

    fn build_with(n: u32, options: &BuildOptions<'_>) -> Blas {
        let (mut positions, mut indices) = terrain(n);
        // Triangles across all others, which the best quality splits.
        for i in 0..8 {
            let first = positions.len() as u32;
            let x = i as f32 * n as f32 / 8.0;
            let far = Vec3::new(n as f32 - x, 1.0, n as f32);
            positions.extend([Vec3::new(x, -1.0, 0.0), far, far + 0.1]);
            indices.push([first, first + 1, first + 2]);
        }
        let mesh = TriangleMesh::new(&positions, &indices);
        Blas::build(&[mesh], options).unwrap()
    }

    #[test]
    fn the_bytes_do_not_depend_on_threads() {
        use Builder::{BinnedSah, Hlbvh, Lbvh, Ploc, SpatialSplits};
        let curves = [Curve::Morton, Curve::Hilbert];
        let all =
            curves.map(|curve| [BinnedSah, SpatialSplits, Lbvh, Hlbvh, Ploc].map(|b| (b, curve)));
        for (builder, curve) in all.into_iter().flatten() {
            let options = BuildOptions { builder: Some(builder), curve, ..BuildOptions::default() };
            let bytes = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let blas = pool.install(|| build_with(300, &options));
                assert_eq!(blas.has_duplicates(), builder == SpatialSplits);
                blas.tree.words().to_vec()
            };
            let one = bytes(1);
            assert!(one == bytes(2) && one == bytes(7), "{options:?}");
        }
    }

    #[test]
    fn validation_finds_every_kind_of_defect() {
        for quality in [BuildQuality::Balanced, BuildQuality::Best] {
            let blas = build(12, quality);
            assert_eq!(blas.has_duplicates(), quality == BuildQuality::Best);
            blas.validate().unwrap();
            for (name, defect) in defects() {
                let mut broken = blas.clone();
                defect(&mut broken.tree);
                assert!(broken.validate().is_err(), "{name}, {quality:?}");
            }
        }
        let blas = build(12, BuildQuality::Balanced);
        let mut fewer = blas.clone();
        fewer.stats.primitives += 1;
        assert!(matches!(fewer.validate(), Err(BvhDefect::Missing(_))));
    }
}
