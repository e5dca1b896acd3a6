//! Small glTF files made in code.

use std::path::PathBuf;

use rayburst_scene::{
    Scene,
    import::{ImportError, LoadOptions, load},
};
use serde_json::{Value, json};

/// Component types by their numbers in the file.
pub(crate) const I8: u32 = 5120;
pub(crate) const U8: u32 = 5121;
pub(crate) const I16: u32 = 5122;
pub(crate) const U16: u32 = 5123;
pub(crate) const U32: u32 = 5125;
pub(crate) const F32: u32 = 5126;

/// A 1×1 picture, as PNG.
pub(crate) const PIXEL: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJ\
    AAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==";

/// A file under construction.
#[derive(Clone)]
pub(crate) struct Glb {
    pub(crate) json: Value,
    pub(crate) binary: Vec<u8>,
}

impl Glb {
    /// One scene with one node, which places mesh 0.
    pub(crate) fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{"byteLength": 0}],
        });
        Self { json, binary: Vec::new() }
    }

    /// Adds a buffer view and returns its index.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let view = json!({
            "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len(),
        });
        self.binary.extend_from_slice(bytes);
        self.json["buffers"][0]["byteLength"] = self.binary.len().into();
        self.push("bufferViews", view)
    }

    /// Adds an element to one of the root's arrays and returns its index.
    pub(crate) fn push(&mut self, array: &str, element: Value) -> usize {
        let array = &mut self.json[array];
        if array.is_null() {
            *array = json!([]);
        }
        let array = array.as_array_mut().unwrap();
        array.push(element);
        array.len() - 1
    }

    /// Adds an accessor of packed bytes and returns its index.
    pub(crate) fn accessor(
        &mut self,
        bytes: &[u8],
        component: u32,
        kind: &str,
        count: usize,
    ) -> usize {
        let view = self.view(bytes);
        self.push(
            "accessors",
            json!({
                "bufferView": view, "componentType": component, "type": kind, "count": count,
            }),
        )
    }

    /// Adds an accessor of floats.
    pub(crate) fn floats(&mut self, numbers: &[f32], kind: &str) -> usize {
        let width = match kind {
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 1,
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, F32, kind, numbers.len() / width)
    }

    /// Adds an accessor of 16-bit indices.
    pub(crate) fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor(&bytes, U16, "SCALAR", indices.len())
    }

    /// Adds a primitive to mesh 0.
    pub(crate) fn primitive(&mut self, primitive: Value) {
        self.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(primitive);
    }

    /// Adds a triangle to mesh 0, and returns the accessor of its positions.
    pub(crate) fn triangle(&mut self) -> usize {
        let position = self.floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.], "VEC3");
        self.primitive(json!({"attributes": {"POSITION": position}}));
        position
    }

    /// The whole file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut text = self.json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut binary = self.binary.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
        file.extend((text.len() as u32).to_le_bytes());
        file.extend(b"JSON");
        file.extend(text);
        file.extend((binary.len() as u32).to_le_bytes());
        file.extend(b"BIN\0");
        file.extend(binary);
        file
    }

    /// Reads it.
    pub(crate) fn load(&self) -> Result<Scene, ImportError> {
        self.load_with(&LoadOptions::default())
    }

    /// Reads it under limits.
    pub(crate) fn load_with(&self, options: &LoadOptions) -> Result<Scene, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let path: PathBuf = folder.path().join("scene.glb");
        std::fs::write(&path, self.bytes()).unwrap();
        load(&path, options)
    }

    /// Reads it; the message of the error that must come.
    pub(crate) fn error(&self) -> String {
        match self.load() {
            Ok(scene) => panic!("no error, but {:?}", scene.warnings),
            Err(error) => error.to_string(),
        }
    }
}
