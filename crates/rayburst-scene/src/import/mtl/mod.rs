//! Reads MTL material libraries (Wavefront, "Material Library File (.mtl)", with the widespread
//! extensions `Ke`, `norm`, `Pr`, `Pm` and their maps of "Extending MTL for PBR", Clara.io, 2014).

mod convert;
mod textures;

use glam::{Vec2, Vec3};

pub(crate) use convert::convert;
pub(crate) use textures::{MapUse, TextureStore};

use super::scan::Scanner;

/// One `newmtl`, as written; what the file does not say is `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlMaterial {
    pub(crate) name: String,
    pub(crate) diffuse: Option<Vec3>,
    pub(crate) specular: Option<Vec3>,
    pub(crate) emission: Option<Vec3>,
    /// `Tf`.
    pub(crate) filter: Option<Vec3>,
    /// `Ns`.
    pub(crate) exponent: Option<f32>,
    /// `Ni`.
    pub(crate) ior: Option<f32>,
    /// `d`.
    pub(crate) dissolve: Option<f32>,
    /// `Tr`.
    pub(crate) transparency: Option<f32>,
    pub(crate) illumination: Option<i64>,
    /// `Pr`.
    pub(crate) roughness: Option<f32>,
    /// `Pm`.
    pub(crate) metallic: Option<f32>,
    pub(crate) diffuse_map: Option<MapRef>,
    pub(crate) specular_map: Option<MapRef>,
    pub(crate) emission_map: Option<MapRef>,
    pub(crate) alpha_map: Option<MapRef>,
    pub(crate) bump_map: Option<MapRef>,
    pub(crate) normal_map: Option<MapRef>,
    pub(crate) roughness_map: Option<MapRef>,
    pub(crate) metallic_map: Option<MapRef>,
}

/// A texture with its options.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MapRef {
    /// The path as written.
    pub(crate) file: String,
    /// `-s`.
    pub(crate) scale: Vec2,
    /// `-o`.
    pub(crate) offset: Vec2,
    /// `-clamp on`.
    pub(crate) clamp: bool,
    /// `-bm`.
    pub(crate) bump: f32,
}

impl MapRef {
    /// A texture without options.
    pub(crate) fn new(file: String) -> Self {
        Self { file, scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false, bump: 1.0 }
    }
}

/// Reads a library. Statements that are not understood are passed over: the format has many
/// dialects and none of them is binding.
pub(crate) fn parse(bytes: &[u8]) -> Vec<MtlMaterial> {
    let mut materials: Vec<MtlMaterial> = Vec::new();
    let mut scanner = Scanner::new(bytes);
    while !scanner.is_at_end() {
        let keyword = scanner.word().to_ascii_lowercase();
        if keyword == b"newmtl" {
            let name = String::from_utf8_lossy(scanner.rest_of_line()).into_owned();
            materials.push(MtlMaterial { name, ..MtlMaterial::default() });
        } else if let Some(material) = materials.last_mut() {
            material.read(&keyword, &mut scanner);
        }
        scanner.next_line();
    }
    materials
}

impl MtlMaterial {
    fn read(&mut self, keyword: &[u8], scanner: &mut Scanner<'_>) {
        match keyword {
            b"kd" => self.diffuse = color(scanner),
            b"ks" => self.specular = color(scanner),
            b"ke" => self.emission = color(scanner),
            b"tf" => self.filter = color(scanner),
            b"ns" => self.exponent = value(scanner),
            b"ni" => self.ior = value(scanner),
            b"d" => self.dissolve = value(scanner),
            b"tr" => self.transparency = value(scanner),
            b"pr" => self.roughness = value(scanner),
            b"pm" => self.metallic = value(scanner),
            b"illum" => {
                scanner.skip_blanks();
                self.illumination = scanner.integer();
            }
            b"map_kd" => self.diffuse_map = map(scanner),
            b"map_ks" => self.specular_map = map(scanner),
            b"map_ke" => self.emission_map = map(scanner),
            b"map_d" | b"map_tr" | b"map_opacity" => self.alpha_map = map(scanner),
            b"bump" | b"map_bump" => self.bump_map = map(scanner),
            b"norm" | b"map_norm" | b"map_kn" => self.normal_map = map(scanner),
            b"map_pr" => self.roughness_map = map(scanner),
            b"map_pm" => self.metallic_map = map(scanner),
            _ => {}
        }
    }
}

/// One number stands for all three; not finite ones for nothing. `spectral` and `xyz` colours are
/// not numbers.
fn color(scanner: &mut Scanner<'_>) -> Option<Vec3> {
    let red = value(scanner)?;
    let green = value(scanner).unwrap_or(red);
    let blue = value(scanner).unwrap_or(red);
    Some(Vec3::new(red, green, blue).max(Vec3::ZERO))
}

/// A finite number; before it, the option of `d -halo 0.5` is passed over.
fn value(scanner: &mut Scanner<'_>) -> Option<f32> {
    let mut attempt = *scanner;
    if attempt.word() == b"-halo" {
        *scanner = attempt;
    }
    scanner.number().filter(|x| x.is_finite())
}

/// Options, then a path that may hold blanks.
fn map(scanner: &mut Scanner<'_>) -> Option<MapRef> {
    let mut map = MapRef::new(String::new());
    loop {
        let mut attempt = *scanner;
        match attempt.word() {
            b"-s" => map.scale = uv_option(&mut attempt, 1.0),
            b"-o" => map.offset = uv_option(&mut attempt, 0.0),
            b"-t" => drop(uv_option(&mut attempt, 0.0)),
            b"-clamp" => map.clamp = attempt.word() == b"on",
            b"-bm" => map.bump = attempt.number().filter(|x| x.is_finite()).unwrap_or(1.0),
            b"-mm" => drop((attempt.number(), attempt.number())),
            b"-boost" | b"-texres" => drop(attempt.number()),
            b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-type" => drop(attempt.word()),
            _ => break,
        }
        *scanner = attempt;
    }
    map.file = String::from_utf8_lossy(scanner.rest_of_line()).trim_matches('"').to_owned();
    (!map.file.is_empty()).then_some(map)
}

/// One to three numbers; a word that a number only begins is the path (`-s 2 2 1st.png`).
fn uv_option(scanner: &mut Scanner<'_>, missing: f32) -> Vec2 {
    let mut values = [missing; 3];
    for value in &mut values {
        let mut attempt = *scanner;
        let Some(number) = attempt.number() else { break };
        if !attempt.is_at_blank() {
            break;
        }
        if number.is_finite() {
            *value = number;
        }
        *scanner = attempt;
    }
    Vec2::new(values[0], values[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_values_in_any_case_and_layout() {
        let materials = parse(
            b"Kd 9 9 9\nnewmtl Material #25\r\n\tKd 0.5 0.25 1 # red\n  ks .1\nKe 1 \\\n2 3\nNs 1e2\n\
              Ni 1.5\nd -halo 0.25\nTr 0.75\nillum 7\nTf 1 0 0\nPr 0.3\nPm 1\nKa spectral x.rfl\n\
              newmtl b\nKd spectral file.rfl 1\nNs nan\nKs -1 0 0\n",
        );
        assert_eq!(materials.len(), 2);
        let expected = MtlMaterial {
            name: "Material #25".into(),
            diffuse: Some(Vec3::new(0.5, 0.25, 1.0)),
            specular: Some(Vec3::splat(0.1)),
            emission: Some(Vec3::new(1.0, 2.0, 3.0)),
            filter: Some(Vec3::X),
            exponent: Some(100.0),
            ior: Some(1.5),
            dissolve: Some(0.25),
            transparency: Some(0.75),
            illumination: Some(7),
            roughness: Some(0.3),
            metallic: Some(1.0),
            ..MtlMaterial::default()
        };
        assert_eq!(materials[0], expected);
        let poor =
            MtlMaterial { name: "b".into(), specular: Some(Vec3::ZERO), ..MtlMaterial::default() };
        assert_eq!(materials[1], poor);
    }

    #[test]
    fn reads_map_options_and_paths_with_blanks() {
        let materials = parse(
            b"newmtl a\nmap_Kd -s 2 3 1 -o 0.5 -clamp on -bm 0.2 my wood.png  \n\
              map_d -mm 0 1 -imfchan m -blendu on ..\\tex\\a.png\nmap_Ke -s 2 2 1st.png\n\
              bump -bm 0.5 \"b.png\"\nmap_Ks -s 1 1 1\n",
        );
        let diffuse = materials[0].diffuse_map.as_ref().expect("map_Kd");
        assert_eq!(diffuse.file, "my wood.png");
        assert_eq!((diffuse.scale, diffuse.offset), (Vec2::new(2.0, 3.0), Vec2::new(0.5, 0.0)));
        assert!(diffuse.clamp);
        assert_eq!(diffuse.bump, 0.2);
        assert_eq!(materials[0].alpha_map.as_ref().expect("map_d").file, "..\\tex\\a.png");
        let emission = materials[0].emission_map.as_ref().expect("map_Ke");
        assert_eq!((emission.file.as_str(), emission.scale), ("1st.png", Vec2::splat(2.0)));
        assert_eq!(materials[0].bump_map.as_ref().expect("bump").file, "b.png");
        assert_eq!(materials[0].specular_map, None);
    }
}
