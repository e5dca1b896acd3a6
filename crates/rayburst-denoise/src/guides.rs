//! What a picture's pixels show: by it filters tell surfaces apart and find them in the frame before.

use rayburst_image::{Plane, Plane3};

use crate::{DenoiseError, Result};

/// The noise-free planes of a frame that filters are guided by, all of one size.
#[derive(Clone, Copy, Debug)]
pub struct Guides<'a> {
    /// Distance along the viewing direction, world units; infinite where nothing is.
    pub depth: &'a Plane,
    /// Unit normal of shading, in a space that frames share; zero where nothing is.
    pub normal: &'a Plane3,
    /// Number of the object plus one; 0 where nothing is.
    pub object: &'a Plane<u32>,
    /// Where the pixel's point was in the frame before, minus where it is now: pixels, X to the right and Y
    /// down.
    pub motion: &'a [Plane; 2],
    /// How deep the pixel's point was in the frame before, minus how deep it is now, world units; without
    /// it points keep their depth.
    pub depth_motion: Option<&'a Plane>,
}

impl Guides<'_> {
    /// Width and height.
    pub fn size(&self) -> (u32, u32) {
        self.depth.size()
    }

    /// Fails where planes differ in size.
    pub fn check(&self) -> Result<()> {
        let expected = self.size();
        let depth_motion = self.depth_motion.map_or(expected, Plane::size);
        let sizes = [
            ("the normal", self.normal.size()),
            ("the object", self.object.size()),
            ("the motion", self.motion[0].size()),
            ("the motion", self.motion[1].size()),
            ("the depth's motion", depth_motion),
        ];
        match sizes.into_iter().find(|(_, size)| *size != expected) {
            Some((name, found)) => Err(DenoiseError::Mismatch { name, found, expected }),
            None => Ok(()),
        }
    }
}
