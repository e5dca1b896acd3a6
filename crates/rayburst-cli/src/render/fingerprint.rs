//! What a picture shows, in a few words: a resumed render must show the same.

use rayburst::{
    image::{LayeredImage, MipMap, mip::MipLevel},
    scene::FlatScene,
};

use crate::{
    error::{CliError, Result},
    load::Loaded,
};

const SCENE: &str = "rayburst.scene";
const CONTENT: &str = "rayburst.scene_content";

/// The name of a scene and a hash of its content.
pub(super) struct Identity {
    scene: String,
    content: String,
}

impl Identity {
    /// Of a scene at an instant.
    pub(super) fn new(loaded: &Loaded, flat: &FlatScene) -> Self {
        Self { scene: loaded.name.clone(), content: format!("{:016x}", content(flat)) }
    }

    /// Notes it in a picture.
    pub(super) fn store(&self, image: &mut LayeredImage) {
        image.attributes.insert(SCENE.into(), self.scene.clone());
        image.attributes.insert(CONTENT.into(), self.content.clone());
    }

    /// Fails if a picture shows something else.
    pub(super) fn check(&self, image: &LayeredImage) -> Result<()> {
        if image.attributes.get(CONTENT) == Some(&self.content) {
            return Ok(());
        }
        let saved = image.attributes.get(SCENE).map_or("unknown", String::as_str);
        let how = if saved == self.scene {
            format!("the scene '{saved}', its light or its time have changed")
        } else {
            format!("its scene is '{saved}', this render's is '{}'", self.scene)
        };
        Err(CliError::failed(format!(
            "the saved picture cannot be continued: {how}; render to another file"
        )))
    }
}

/// A hash of everything that decides the picture besides camera and settings; of textures a small
/// mip level, in which every texel has a share.
fn content(flat: &FlatScene) -> u64 {
    let mut hash = Fnv::default();
    for geometry in &flat.geometries {
        let primitive = &geometry.primitive;
        hash.floats(primitive.positions.iter().flat_map(|p| p.to_array()));
        hash.words(primitive.indices.iter().flatten().copied());
        hash.floats(geometry.transform.to_cols_array());
        hash.words([geometry.material, geometry.node]);
    }
    for instance in &flat.instances {
        hash.floats(instance.object_to_world.to_cols_array());
        hash.words([instance.first_geometry]);
    }
    hash.text(&format!("{:?}{:?}", flat.materials, flat.lights));
    for image in flat.images.iter() {
        hash.words([image.width(), image.height()]);
        hash_texels(&mut hash, image);
    }
    match &flat.environment {
        rayburst::scene::Environment::Map(map) => {
            hash.text(&format!("{:?} {} {}", map.size, map.rotation, map.intensity));
            hash.floats(map.texels.iter().flat_map(|t| t.to_array()));
        }
        other => hash.text(&format!("{other:?}")),
    }
    hash.0
}

/// Texels of the first small level.
fn hash_texels(hash: &mut Fnv, image: &MipMap) {
    const SMALL: u32 = 32;
    let small = |level: &MipLevel| level.width.max(level.height) <= SMALL;
    let Some(level) = image.levels().iter().position(small) else { return };
    let MipLevel { width, height, .. } = image.levels()[level];
    for y in 0..height {
        hash.floats((0..width).flat_map(|x| image.texel(level, x, y)));
    }
}

/// The hash of Fowler, Noll and Vo, 64 bits, variant 1a, over words.
struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    fn words(&mut self, words: impl IntoIterator<Item = u32>) {
        for word in words {
            self.0 = (self.0 ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f32>) {
        self.words(values.into_iter().map(f32::to_bits));
    }

    fn text(&mut self, text: &str) {
        self.words(text.bytes().map(u32::from));
    }
}
