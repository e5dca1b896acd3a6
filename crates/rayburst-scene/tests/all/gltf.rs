//! Every real glTF scene loads as its authors meant it.

use std::path::{Path, PathBuf};

use rayburst_scene::{
    Scene,
    import::{LoadOptions, load},
};

/// Where the real scenes are, if they are.
fn scenes() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
    if folder.is_dir() {
        return Some(folder.to_path_buf());
    }
    eprintln!("skipped: {} is not there", folder.display());
    None
}

fn unique_triangles(scene: &Scene) -> usize {
    scene.meshes.iter().flat_map(|m| &m.primitives).map(|p| p.indices.len()).sum()
}

/// File, triangles of all meshes, triangles as placed, materials, animations, images, warnings.
const EXPECTED: &[(&str, usize, u64, usize, usize, usize, usize)] = &[
    ("bathroom/bathroom.gltf", 38_531, 38_531, 29, 0, 9, 0),
    ("cesium_man/CesiumMan.glb", 4_672, 4_672, 1, 1, 1, 0),
    ("chess_board/chess_board.glb", 178_848, 178_848, 3, 0, 8, 1),
    ("damaged_helmet/DamagedHelmet.glb", 15_452, 15_452, 1, 0, 5, 0),
    ("flight_helmet/FlightHelmet.gltf", 94_722, 94_722, 6, 0, 15, 0),
    ("fox/Fox.glb", 576, 576, 1, 3, 1, 0),
    ("gltf_tests/AlphaBlendModeTest.glb", 61, 61, 6, 0, 9, 0),
    ("gltf_tests/AnimatedMorphCube.glb", 12, 12, 1, 1, 0, 0),
    ("gltf_tests/AnimatedMorphSphere.glb", 960, 960, 1, 1, 0, 0),
    ("gltf_tests/AnisotropyRotationTest.glb", 7_476, 13_876, 6, 0, 4, 1),
    ("gltf_tests/AttenuationTest.glb", 232, 292, 18, 0, 2, 2),
    ("gltf_tests/BoxAnimated.glb", 254, 254, 2, 1, 0, 0),
    ("gltf_tests/Cameras/Cameras.gltf", 2, 2, 1, 0, 0, 0),
    ("gltf_tests/ClearCoatTest.glb", 37_116, 37_116, 19, 0, 5, 1),
    ("gltf_tests/InterpolationTest/InterpolationTest.gltf", 110, 110, 10, 9, 1, 0),
    ("gltf_tests/Lights.glb", 12, 12, 1, 0, 0, 0),
    ("gltf_tests/MorphStressTest.gltf", 2_412, 2_412, 2, 3, 3, 0),
    ("gltf_tests/MultiUVTest/MultiUVTest.gltf", 12, 12, 1, 0, 2, 0),
    ("gltf_tests/NormalTangentTest.glb", 7_774, 7_774, 1, 0, 3, 0),
    ("gltf_tests/PrimitiveModeNormalsTest.glb", 2_562, 2_562, 3, 0, 1, 2),
    ("gltf_tests/RiggedSimple.glb", 188, 188, 1, 1, 0, 0),
    ("gltf_tests/SimpleInstancing.glb", 12, 1_500, 1, 0, 0, 0),
    ("gltf_tests/SpecularTest.glb", 44_828, 44_828, 24, 0, 1, 1),
    ("gltf_tests/TextureCoordinateTest/TextureCoordinateTest.gltf", 10, 10, 5, 0, 1, 0),
    ("gltf_tests/TextureSettingsTest/TextureSettingsTest.gltf", 72, 72, 10, 0, 3, 0),
    ("gltf_tests/TextureTransformTest/TextureTransformTest.gltf", 18, 24, 9, 0, 5, 0),
    ("gltf_tests/TransmissionRoughnessTest.glb", 77_792, 77_792, 9, 0, 5, 2),
    ("gltf_tests/TwoSidedPlane/TwoSidedPlane.gltf", 2, 2, 1, 0, 3, 0),
    ("gltf_tests/UnlitTest/UnlitTest.gltf", 88, 88, 2, 0, 0, 0),
    ("gltf_tests/VertexColorTest/VertexColorTest.gltf", 36, 36, 2, 0, 2, 0),
    ("hotel_room/hotel_room.glb", 99_029, 99_029, 11, 0, 6, 1),
    ("littlest_tokyo/LittlestTokyo.glb", 88_978, 88_978, 14, 1, 4, 0),
    ("scrub_pine/scrub_pine_forest.gltf", 529, 210_802, 3, 0, 2, 0),
    ("sponza/sponza.gltf", 262_267, 262_267, 25, 0, 69, 0),
];

#[test]
fn every_scene_loads_whole() {
    let Some(folder) = scenes() else { return };
    for &(file, triangles, placed, materials, animations, images, warnings) in EXPECTED {
        let scene = load(&folder.join(file), &LoadOptions::default())
            .unwrap_or_else(|e| panic!("{file}: {e}"));
        assert_eq!(unique_triangles(&scene), triangles, "triangles of {file}");
        assert_eq!(scene.placed_triangles(), placed, "placed triangles of {file}");
        assert_eq!(scene.materials.len(), materials, "materials of {file}");
        assert_eq!(scene.animations.len(), animations, "animations of {file}");
        assert_eq!(scene.images.len(), images, "images of {file}");
        assert_eq!(scene.warnings.len(), warnings, "warnings of {file}: {:#?}", scene.warnings);
        check_invariants(&scene, file);
    }
}

/// What the scene model promises to those who use it.
pub(crate) fn check_invariants(scene: &Scene, file: &str) {
    assert_eq!(scene.materials.len(), scene.material_names.len(), "{file}");
    for (index, node) in scene.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|p| (p as usize) < index), "{file}: node {index}");
        assert!(node.mesh.is_none_or(|m| (m as usize) < scene.meshes.len()), "{file}");
        assert!(node.skin.is_none_or(|s| (s as usize) < scene.skins.len()), "{file}");
        assert!(node.camera.is_none_or(|c| (c as usize) < scene.cameras.len()), "{file}");
        assert!(node.light.is_none_or(|l| (l as usize) < scene.lights.len()), "{file}");
    }
    for texture in &scene.textures {
        assert!((texture.image as usize) < scene.images.len(), "{file}");
    }
    for slot in scene.materials.iter().flat_map(|m| m.slots()) {
        assert!(slot.index().is_none_or(|t| t < scene.textures.len()), "{file}");
    }
    for skin in &scene.skins {
        assert_eq!(skin.joints.len(), skin.inverse_bind.len(), "{file}");
        assert!(skin.joints.iter().all(|&j| (j as usize) < scene.nodes.len()), "{file}");
    }
    for primitive in scene.meshes.iter().flat_map(|m| &m.primitives) {
        let count = primitive.positions.len();
        let fits = |length: Option<usize>| length.is_none_or(|l| l == count);
        assert!(primitive.indices.as_flattened().iter().all(|&i| (i as usize) < count), "{file}");
        assert!(fits(primitive.normals.as_ref().map(Vec::len)), "{file}");
        assert!(fits(primitive.tangents.as_ref().map(Vec::len)), "{file}");
        assert!(primitive.uvs.iter().all(|uvs| uvs.len() == count), "{file}");
        assert!(fits(primitive.colors.as_ref().map(Vec::len)), "{file}");
        assert!(fits(primitive.skin.as_ref().map(Vec::len)), "{file}");
        assert!((primitive.material as usize) < scene.materials.len(), "{file}");
        for target in &primitive.targets {
            for deltas in [&target.positions, &target.normals, &target.tangents] {
                assert!(fits(deltas.as_ref().map(Vec::len)), "{file}");
            }
        }
        for vertex in primitive.skin.iter().flatten() {
            let sum: f32 = vertex.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-5, "{file}: weights sum to {sum}");
        }
        for tangent in primitive.tangents.iter().flatten() {
            assert!(tangent.is_finite() && tangent.w.abs() == 1.0, "{file}: {tangent}");
        }
    }
    for channel in scene.animations.iter().flat_map(|a| &a.channels) {
        assert!((channel.node as usize) < scene.nodes.len(), "{file}");
        assert!(channel.times.is_sorted_by(|a, b| a < b) && !channel.times.is_empty(), "{file}");
        assert_eq!(channel.values.len() % (channel.times.len() * channel.width), 0, "{file}");
    }
}
