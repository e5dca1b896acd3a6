//! Views, pictures and counts of coverage for tests.

use std::sync::Mutex;

use glam::{Affine3A, Vec2, Vec3};
use rayburst_raster::{
    Candidate, Clusters, Coverage, IsaLevel, Mesh, Projection, Rasteriser, View, Visibility,
};
use rayburst_testkit::TestMesh;

/// A view from `eye` to `target`; `half` is half the height at distance 1, or of parallel rays.
pub(crate) fn look(eye: Vec3, target: Vec3, half: f32, parallel: bool, size: (u32, u32)) -> View {
    let v = (target - eye).normalize();
    let r = v.cross(Vec3::new(0.1, 1.0, 0.05)).normalize();
    let half = Vec2::new(half * size.0 as f32 / size.1 as f32, half);
    let projection =
        if parallel { Projection::Orthographic { half } } else { Projection::Perspective { half } };
    View { eye, frame: [r, r.cross(v), v], projection, size, jitter: Vec2::ZERO }
}

pub(crate) fn clusters(mesh: &TestMesh) -> Clusters {
    Clusters::new(&mesh.positions, &mesh.indices, None)
}

pub(crate) fn placed(clusters: &Clusters, opaque: bool) -> Mesh<'_> {
    Mesh { clusters, transform: Affine3A::IDENTITY, instance: 3, geometry: 5, opaque }
}

/// What a new rasteriser of the best instruction set draws.
pub(crate) fn draw<C: Coverage>(view: &View, meshes: &[Mesh<'_>], coverage: &C) -> Visibility {
    let mut to = Visibility::default();
    Rasteriser::new(IsaLevel::detect()).draw(view, meshes, coverage, &mut to).expect("draws");
    to
}

/// How many triangles cover each pixel, and how many of them with their front; shows none.
pub(crate) struct Count(pub(crate) Mutex<Vec<[u32; 2]>>);

impl Coverage for Count {
    fn covers(&self, pixel: u32, candidate: &Candidate) -> bool {
        let counts = &mut self.0.lock().expect("not poisoned")[pixel as usize];
        counts[0] += 1;
        counts[1] += u32::from(candidate.front);
        false
    }
}

/// Of each pixel, the number of triangles that cover it, and of those with their front.
pub(crate) fn counts(view: &View, clusters: &Clusters) -> Vec<[u32; 2]> {
    let count = Count(Mutex::new(vec![[0; 2]; (view.size.0 * view.size.1) as usize]));
    let seen = draw(view, &[placed(clusters, false)], &count);
    assert!(seen.triangles.row(0).iter().all(|&id| id == u32::MAX), "nothing is shown");
    count.0.into_inner().expect("not poisoned")
}
