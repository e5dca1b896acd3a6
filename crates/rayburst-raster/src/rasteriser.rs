//! The rasteriser: pictures of meshes, and what it keeps from one to the next.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec2;
use rayburst_image::Plane;
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use crate::{
    Coverage, Mesh, RasterError, Result, View,
    bins::{BIN, Bin, BinGrid, NOTHING, TILE, TILES},
    fill::{Filling, depth},
    mesh::{Placed, sees_bounds},
    project::{Chunk, Screen, Vertices},
};

/// Clusters that one task projects.
const TASK: usize = 16;
/// Clusters are drawn in this many waves, the nearest first, so that earlier ones hide later ones...
const WAVES: usize = 12;
/// ... but those that were not seen in the last picture in this many, if most that were follow.
const LAST_WAVES: usize = 2;
/// A wave has at least so many clusters.
const SMALLEST_WAVE: usize = 128;
/// Clusters that are projected before bins are filled, at most: bounds the memory.
const LARGEST_WAVE: usize = 1 << 14;
/// Hidden boxes are searched for in so many tiles at most.
const MOST_TILES: u32 = 1024;

/// Draws meshes as views see them. Keeps its working memory from picture to picture: once it has drawn the
/// like, it allocates nothing. It also keeps which clusters were seen, and draws them first the next time, since
/// they hide most others: one for each view that moves with little change is best. What it draws does not depend
/// on that.
///
/// Work is done on the calling thread's rayon pool. Pictures depend neither on the number of threads nor on
/// the instruction set.
#[derive(Debug)]
pub struct Rasteriser {
    isa: IsaLevel,
    bins: Vec<Bin>,
    placed: Vec<Placed>,
    clusters: Vec<Visible>,
    /// What tasks of culling find.
    found: Vec<Vec<Visible>>,
    chunks: Vec<Chunk>,
    /// Whether each of `clusters` was seen when it was drawn.
    shown: Vec<AtomicBool>,
    /// Whether each cluster of all meshes was seen in the last picture.
    seen: Vec<bool>,
}

/// A cluster that may be seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Visible {
    /// Whether it was not seen in the last picture, and the depth at which it begins.
    key: (bool, u32),
    pub(crate) mesh: u32,
    cluster: u32,
}

/// What a picture shows, pixel by pixel.
#[derive(Clone, Debug, Default)]
pub struct Visibility {
    /// Depth along the view; infinite where nothing is seen.
    pub depth: Plane,
    /// Numbers of triangles; [`u32::MAX`] where nothing is seen.
    pub triangles: Plane<u32>,
    /// Contested pixels of 8×8 at a time, as bits.
    contested: Vec<u64>,
    /// The number of each mesh's first triangle.
    first_ids: Vec<u32>,
}

impl Visibility {
    /// Whether a pixel of the picture may show another triangle as well: one that is as deep as the one that it
    /// shows but for rounding, or translucent there. Where surfaces lie in each other rays may see either.
    #[inline]
    pub fn is_contested(&self, x: u32, y: u32) -> bool {
        let columns = (self.depth.stride() / TILE as usize).max(1);
        let tile = (y / TILE) as usize * columns + (x / TILE) as usize;
        let bits = self.contested.get(tile).copied().unwrap_or(0);
        bits >> ((y % TILE) * TILE + x % TILE) & 1 != 0
    }

    /// The mesh, by its place among those drawn, and the primitive that a number of a triangle stands for.
    #[inline]
    pub fn identify(&self, triangle: u32) -> Option<(usize, u32)> {
        if triangle == NOTHING {
            return None;
        }
        // Of meshes without triangles, which begin where the next one does, the last.
        let mesh = self.first_ids.partition_point(|&first| first <= triangle).checked_sub(1)?;
        Some((mesh, triangle - self.first_ids[mesh]))
    }
}

impl Rasteriser {
    /// One that uses an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            bins: Vec::new(),
            placed: Vec::new(),
            clusters: Vec::new(),
            found: Vec::new(),
            chunks: Vec::new(),
            shown: Vec::new(),
            seen: Vec::new(),
        }
    }

    /// Draws what is seen of some meshes. Of what is equally deep, the triangle of the earlier mesh is seen and
    /// of one mesh the first, so meshes should be in the order of (instance, geometry).
    pub fn draw<C: Coverage>(
        &mut self,
        view: &View,
        meshes: &[Mesh<'_>],
        coverage: &C,
        to: &mut Visibility,
    ) -> Result<()> {
        resize(&mut to.depth, view.size)?;
        resize(&mut to.triangles, view.size)?;
        self.fill::<C, true>(view, meshes, coverage)?;
        to.first_ids.clear();
        to.first_ids.extend(self.placed.iter().map(|placed| placed.first_id));
        let grid = BinGrid::new(view.size);
        let (columns, perspective) = (grid.columns as usize, view.is_perspective());
        let bands = to.depth.stride() * BIN as usize;
        let tile_columns = to.depth.stride() / TILE as usize;
        to.contested.resize(tile_columns * (grid.rows * TILES) as usize, 0);
        let width = view.size.0 as usize;
        let stride = to.depth.stride();
        to.depth
            .values_mut()
            .par_chunks_mut(bands)
            .zip(to.triangles.values_mut().par_chunks_mut(bands))
            .zip(to.contested.par_chunks_mut(tile_columns * TILES as usize))
            .zip(self.bins.par_chunks(columns))
            .for_each(|(((depths, ids), contested), bins)| {
                for (row, contested) in contested.chunks_mut(tile_columns).enumerate() {
                    for (to, (bin, tile)) in
                        contested.iter_mut().zip(tiles(bins, row * TILE as usize))
                    {
                        *to = bins[bin].contested[tile];
                    }
                }
                for (y, (depths, ids)) in
                    depths.chunks_mut(stride).zip(ids.chunks_mut(stride)).enumerate()
                {
                    read_depths(bins, y, &mut depths[..width], perspective, f32::MIN_POSITIVE);
                    read_ids(bins, y, &mut ids[..width]);
                }
            });
        Ok(())
    }

    /// Draws depths alone, as for shadow maps: along the view, infinite where nothing is seen.
    pub fn draw_depth<C: Coverage>(
        &mut self,
        view: &View,
        meshes: &[Mesh<'_>],
        coverage: &C,
        to: &mut Plane,
    ) -> Result<()> {
        resize(to, view.size)?;
        self.fill::<C, false>(view, meshes, coverage)?;
        let grid = BinGrid::new(view.size);
        let (columns, perspective) = (grid.columns as usize, view.is_perspective());
        let (stride, width) = (to.stride(), view.size.0 as usize);
        to.values_mut()
            .par_chunks_mut(stride * BIN as usize)
            .zip(self.bins.par_chunks(columns))
            .for_each(|(depths, bins)| {
                for (y, depths) in depths.chunks_mut(stride).enumerate() {
                    read_depths(bins, y, &mut depths[..width], perspective, f32::MIN_POSITIVE);
                }
            });
        Ok(())
    }

    /// Draws into the bins.
    fn fill<C: Coverage, const IDS: bool>(
        &mut self,
        view: &View,
        meshes: &[Mesh<'_>],
        coverage: &C,
    ) -> Result<()> {
        let (width, height) = view.size;
        if width.max(height) > u32::from(u16::MAX) {
            return Err(RasterError::TooLarge(width, height));
        }
        self.place(view, meshes)?;
        self.cull(meshes);
        let screen = Screen::new(view);
        let bins = screen.grid.count();
        if self.bins.len() != bins {
            self.bins.resize_with(bins, Bin::new);
        }
        // Reached by nothing that is seen: without perspective, nearness may be any number.
        let empty = if view.is_perspective() { f32::MIN_POSITIVE } else { f32::NEG_INFINITY };
        self.bins.par_iter_mut().for_each(|bin| bin.clear(empty, IDS));
        self.shown.clear();
        self.shown.resize_with(self.clusters.len(), || AtomicBool::new(false));
        let seen = self.clusters.partition_point(|cluster| !cluster.key.0);
        let rest = self.clusters.len() - seen;
        let last_waves = if rest > 4 * seen { WAVES } else { LAST_WAVES };
        let mut begin = 0;
        while begin < self.clusters.len() {
            let (limit, size) = if begin < seen {
                (seen, seen.div_ceil(WAVES))
            } else {
                (self.clusters.len(), rest.div_ceil(last_waves))
            };
            let end = (begin + size.clamp(SMALLEST_WAVE, LARGEST_WAVE)).min(limit);
            self.wave::<C, IDS>(&screen, meshes, coverage, begin..end, width);
            begin = end;
        }
        self.seen.fill(false);
        for (cluster, shown) in self.clusters.iter().zip(&self.shown) {
            let first = self.placed[cluster.mesh as usize].first_cluster;
            self.seen[first + cluster.cluster as usize] |= shown.load(Ordering::Relaxed);
        }
        Ok(())
    }

    /// How the view sees meshes.
    fn place(&mut self, view: &View, meshes: &[Mesh<'_>]) -> Result<()> {
        let total: u64 = meshes.iter().map(|m| u64::from(m.clusters.primitive_count())).sum();
        if total > u64::from(NOTHING) {
            return Err(RasterError::TooMany(total));
        }
        self.placed.clear();
        let (mut first_id, mut first_cluster) = (0, 0);
        for mesh in meshes {
            self.placed.push(Placed::new(view, mesh, first_id, first_cluster));
            first_id += mesh.clusters.primitive_count();
            first_cluster += mesh.clusters.clusters.len();
        }
        if self.seen.len() != first_cluster {
            self.seen.clear();
            self.seen.resize(first_cluster, false);
        }
        Ok(())
    }

    /// Finds the clusters in the picture, the nearest first.
    fn cull(&mut self, meshes: &[Mesh<'_>]) {
        let task = meshes.len().div_ceil(16).max(1);
        let tasks = meshes.len().div_ceil(task);
        self.found.resize_with(tasks.max(self.found.len()), Vec::new);
        let (placed, seen) = (&self.placed, &self.seen);
        self.found[..tasks]
            .par_iter_mut()
            .zip(meshes.par_chunks(task).zip(placed.par_chunks(task)))
            .enumerate()
            .for_each(|(number, (found, (meshes, placed)))| {
                found.clear();
                for (i, (mesh, placed)) in meshes.iter().zip(placed).enumerate() {
                    if !sees_bounds(placed, &mesh.clusters.bounds()) {
                        continue;
                    }
                    let mesh_number = (number * task + i) as u32;
                    for (cluster, number) in mesh.clusters.clusters.iter().zip(0..) {
                        if let Some(depth) = placed.sees(cluster.centre, cluster.half) {
                            let seen = seen[placed.first_cluster + number as usize];
                            let key = (!seen, depth.max(0.0).to_bits());
                            found.push(Visible { key, mesh: mesh_number, cluster: number });
                        }
                    }
                }
            });
        self.clusters.clear();
        for found in &self.found[..tasks] {
            self.clusters.extend_from_slice(found);
        }
        self.clusters.sort_unstable_by_key(|c| (c.key, c.mesh, c.cluster));
    }

    /// Draws some clusters, but those that are hidden by what has been drawn.
    fn wave<C: Coverage, const IDS: bool>(
        &mut self,
        screen: &Screen,
        meshes: &[Mesh<'_>],
        coverage: &C,
        range: std::ops::Range<usize>,
        width: u32,
    ) {
        let first_wave = range.start == 0;
        let shown = &self.shown[range.clone()];
        let clusters = &self.clusters[range];
        let tasks = clusters.len().div_ceil(TASK);
        if self.chunks.len() < tasks {
            self.chunks.resize_with(tasks, Chunk::default);
        }
        let (bins, placed, isa) = (&self.bins, &self.placed, self.isa);
        self.chunks[..tasks].par_iter_mut().zip(clusters.par_chunks(TASK)).enumerate().for_each(
            |(task, (chunk, clusters))| {
                let hidden_by = (!first_wave).then_some(bins.as_slice());
                let first = (task * TASK) as u32;
                isa.dispatch(Project { chunk, clusters, first, hidden_by, screen, meshes, placed });
            },
        );
        let filling = Filling {
            chunks: &self.chunks[..tasks],
            meshes,
            placed,
            clusters,
            shown,
            coverage,
            width,
        };
        let perspective = placed.first().is_some_and(|placed| placed.perspective);
        self.bins.par_iter_mut().enumerate().for_each(|(index, bin)| {
            let at = (index as u32 % screen.grid.columns, index as u32 / screen.grid.columns);
            let first =
                screen.first_centre() + DVec2::new(f64::from(at.0 * BIN), f64::from(at.1 * BIN));
            let at = (at.0, at.1, index);
            isa.dispatch(Fill::<C, IDS> { filling: &filling, bin, at, first, perspective });
        });
    }
}

/// A plane of a size, with any values.
fn resize<T: Copy + Default>(plane: &mut Plane<T>, size: (u32, u32)) -> Result<()> {
    if plane.size() != size || plane.values().is_empty() {
        *plane = Plane::new(size.0, size.1)?;
    }
    Ok(())
}

/// Projects clusters.
struct Project<'a> {
    chunk: &'a mut Chunk,
    clusters: &'a [Visible],
    /// The first cluster's place in the wave.
    first: u32,
    hidden_by: Option<&'a [Bin]>,
    screen: &'a Screen,
    meshes: &'a [Mesh<'a>],
    placed: &'a [Placed],
}

impl Kernel for Project<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { chunk, clusters, first, hidden_by, screen, meshes, placed } = self;
        chunk.clear();
        let mut vertices = Vertices::NONE;
        for (number, visible) in clusters.iter().enumerate() {
            if let Some(next) = clusters.get(number + 1) {
                meshes[next.mesh as usize].clusters.prefetch(isa, next.cluster as usize);
            }
            let (mesh, at) = (&meshes[visible.mesh as usize], visible.cluster as usize);
            let placed = &placed[visible.mesh as usize];
            if hidden_by.is_some_and(|bins| is_hidden(screen, bins, placed, mesh, at)) {
                continue;
            }
            let with = (placed, first + number as u32);
            if placed.perspective {
                chunk.add_cluster::<true>(screen, with, mesh.clusters, at, &mut vertices);
            } else {
                chunk.add_cluster::<false>(screen, with, mesh.clusters, at, &mut vertices);
            }
        }
        chunk.sort(screen.grid.count());
    }
}

/// Whether the bins hide a cluster.
#[inline(always)]
fn is_hidden(
    screen: &Screen,
    bins: &[Bin],
    placed: &Placed,
    mesh: &Mesh<'_>,
    cluster: usize,
) -> bool {
    let cluster = &mesh.clusters.clusters[cluster];
    let Some((bounds, nearness)) = placed.shown(cluster.centre, cluster.half) else { return false };
    let Some(span) = screen.pixels(bounds) else { return true };
    let [left, top] = [span.x, span.y].map(|x| x as u32 / TILE);
    let [right, bottom] = [-span.z, -span.w].map(|x| x as u32 / TILE);
    if (right - left + 1) * (bottom - top + 1) > MOST_TILES {
        return false;
    }
    // A little nearer: rounding.
    let nearness = nearness + nearness.abs() * (1.0 / (1 << 16) as f32);
    (top..=bottom).all(|y| {
        (left..=right).all(|x| {
            let bin = &bins[((y / TILES) * screen.grid.columns + x / TILES) as usize];
            nearness < bin.least[((y % TILES) * TILES + x % TILES) as usize]
        })
    })
}

/// Fills a bin.
struct Fill<'a, C, const IDS: bool> {
    filling: &'a Filling<'a, C>,
    bin: &'a mut Bin,
    at: (u32, u32, usize),
    first: DVec2,
    perspective: bool,
}

impl<C: Coverage, const IDS: bool> Kernel for Fill<'_, C, IDS> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { filling, bin, at, first, perspective } = self;
        if perspective {
            filling.fill::<I, true, IDS>(isa, bin, at, first);
        } else {
            filling.fill::<I, false, IDS>(isa, bin, at, first);
        }
        bin.settle();
    }
}

/// A row of depths of a row of bins.
fn read_depths(bins: &[Bin], y: usize, to: &mut [f32], perspective: bool, empty: f32) {
    for (to, tile) in to.chunks_mut(TILE as usize).zip(tiles(bins, y)) {
        let row = &bins[tile.0].tiles[tile.1].nearness[8 * (y % 8)..][..8];
        for (to, &nearness) in to.iter_mut().zip(row) {
            *to = match perspective {
                true if nearness <= empty => f32::INFINITY,
                true => depth::<true>(nearness),
                false => depth::<false>(nearness),
            };
        }
    }
}

/// A row of numbers of triangles.
fn read_ids(bins: &[Bin], y: usize, to: &mut [u32]) {
    for (to, tile) in to.chunks_mut(TILE as usize).zip(tiles(bins, y)) {
        let row = &bins[tile.0].tiles[tile.1].ids[8 * (y % 8)..];
        to.copy_from_slice(&row[..to.len()]);
    }
}

/// The bins and tiles that a row of pixels of a row of bins goes through.
fn tiles(bins: &[Bin], y: usize) -> impl Iterator<Item = (usize, usize)> {
    let row = (y as u32 / TILE * TILES) as usize;
    (0..bins.len()).flat_map(move |bin| (0..TILES as usize).map(move |tile| (bin, row + tile)))
}
