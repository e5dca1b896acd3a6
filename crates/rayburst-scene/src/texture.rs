//! Textures: an image and how it is looked up.

/// What happens outside [0, 1) (glTF 2.0, section 5.26).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WrapMode {
    /// Tiles.
    #[default]
    Repeat,
    /// Tiles, every other one mirrored.
    MirroredRepeat,
    /// The edge texel goes on.
    ClampToEdge,
}

/// How texels are blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FilterMode {
    /// The nearest texel.
    Nearest,
    /// Linear interpolation.
    #[default]
    Linear,
}

/// A texture. The image's colour space is the image's own property: an image used both as colour
/// and as data is stored twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Texture {
    /// Index in the scene's images.
    pub image: u32,
    /// Wrapping in u and v.
    pub wrap: [WrapMode; 2],
    /// Filter when magnified.
    pub magnify: FilterMode,
    /// Filter within a mip level when minified.
    pub minify: FilterMode,
    /// Filter between mip levels; `None` uses level 0 only.
    pub mip: Option<FilterMode>,
}

impl Texture {
    /// Repeating, trilinear.
    pub const fn new(image: u32) -> Self {
        Self {
            image,
            wrap: [WrapMode::Repeat; 2],
            magnify: FilterMode::Linear,
            minify: FilterMode::Linear,
            mip: Some(FilterMode::Linear),
        }
    }
}
