//! Which dimension of the sample sequence decides what. Groups of four share one Sobol' point.

/// Where in the pixel; two numbers.
pub(crate) const FILTER: u32 = 0;
/// Where on the lens; two numbers.
pub(crate) const LENS: u32 = 2;

/// The dimensions of one vertex of a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex(u32);

impl Vertex {
    /// The vertex where the ray of this depth ends; the eye ray has depth 1.
    #[inline]
    pub(crate) const fn at_depth(depth: u32) -> Self {
        Self(4 + 8 * (depth - 1))
    }

    /// Where on a light; two numbers.
    #[inline]
    pub(crate) const fn light_point(self) -> u32 {
        self.0
    }

    /// Which light.
    #[inline]
    pub(crate) const fn light_choice(self) -> u32 {
        self.0 + 2
    }

    /// Whether the path goes on.
    #[inline]
    pub(crate) const fn survival(self) -> u32 {
        self.0 + 3
    }

    /// Which direction; two numbers.
    #[inline]
    pub(crate) const fn direction(self) -> u32 {
        self.0 + 4
    }

    /// Which lobe of the BSDF.
    #[inline]
    pub(crate) const fn lobe(self) -> u32 {
        self.0 + 6
    }
}

/// Where on a punctual light of a frame that is asked for by a ray of its own; two numbers.
#[inline]
pub(crate) const fn exact_light(number: u32) -> u32 {
    EXACT_LIGHTS + 2 * number
}

/// Past those of the longest paths.
const EXACT_LIGHTS: u32 = 1 << 24;

/// Where the rays of ambient occlusion go; two numbers.
pub(crate) const OCCLUSION: u32 = (1 << 24) - 4;

/// Which polygon light of a frame's square a shadow ray goes to.
pub(crate) const POLYGON_CHOICE: u32 = (1 << 24) - 6;

/// Where on it; two numbers.
pub(crate) const POLYGON_POINT: u32 = (1 << 24) - 8;

/// Which of some points there.
pub(crate) const POLYGON_CANDIDATE: u32 = (1 << 24) - 5;
