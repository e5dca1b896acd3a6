//! Reads the statements of an OBJ file (Wavefront, "Object Files (.obj)", Advanced Visualizer
//! manual, appendix B) into flat arrays, in one pass over the bytes.
//!
//! Nothing in it is fatal: what cannot be understood is counted, with the line where it began, and
//! left out. Vertices are kept even when broken, because faces refer to them by number.

use glam::{Vec2, Vec3};

use crate::import::scan::Scanner;

/// Marks an attribute that a corner does not have.
pub(super) const NONE: u32 = u32::MAX;

/// Most libraries that are read.
pub(super) const MAX_LIBRARIES: usize = 64;

/// One corner of a face: numbers, from 0, of a position, a UV and a normal.
pub(super) type Corner = [u32; 3];

/// Everything a file says, unchecked: corners may refer to what does not exist.
#[derive(Debug, Default)]
pub(super) struct ObjFile {
    pub(super) positions: Vec<Vec3>,
    /// sRGB colours after the positions; empty, or as long as they are.
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    /// Corners of all faces, one face after the other.
    pub(super) corners: Vec<Corner>,
    /// Where each face's corners end.
    pub(super) face_ends: Vec<u32>,
    /// Stretches of faces with the same state; each ends where the next begins.
    pub(super) runs: Vec<Run>,
    pub(super) material_names: Vec<String>,
    pub(super) object_names: Vec<String>,
    /// What `mtllib` lines say.
    pub(super) libraries: Vec<String>,
    pub(super) problems: Problems,
}

/// State that holds from a face on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) first_face: u32,
    /// Index in the material names, or [`NONE`].
    pub(super) material: u32,
    /// Index in the object names, or [`NONE`].
    pub(super) object: u32,
    /// Number of the smoothing group; 0 is flat.
    pub(super) smoothing: u32,
}

/// How often something was wrong, and the line where it was first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Count {
    pub(super) times: u64,
    pub(super) line: u32,
}

impl Count {
    fn add(&mut self, line: u32) {
        if self.times == 0 {
            self.line = line;
        }
        self.times += 1;
    }
}

/// What was left out.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Problems {
    pub(super) broken_faces: Count,
    pub(super) broken_vertices: Count,
    pub(super) points_and_lines: Count,
    pub(super) free_form: Count,
    /// Too many faces for 32-bit numbers.
    pub(super) overflow: bool,
}

/// Reads a whole file.
pub(super) fn parse(bytes: &[u8]) -> ObjFile {
    let mut file = ObjFile::default();
    let mut state = Run { first_face: 0, material: NONE, object: NONE, smoothing: 0 };
    let mut scanner = Scanner::new(bytes);
    let mut names = Names::default();
    while !scanner.is_at_end() {
        match scanner.word() {
            b"v" => file.read_position(&mut scanner),
            b"vt" => {
                let u = scanner.number().unwrap_or(0.0);
                let v = scanner.number().unwrap_or(0.0);
                file.uvs.push(Vec2::new(u, v));
            }
            b"vn" => {
                let [x, y, z] = std::array::from_fn(|_| scanner.number().unwrap_or(0.0));
                file.normals.push(Vec3::new(x, y, z));
            }
            b"f" | b"fo" => file.read_face(&mut scanner, state),
            b"usemtl" => {
                state.material = names.materials.number(scanner.rest_of_line());
            }
            b"o" => state.object = names.objects.number(scanner.rest_of_line()),
            b"s" => state.smoothing = smoothing_group(scanner.word()),
            b"mtllib" => {
                let line = String::from_utf8_lossy(scanner.rest_of_line()).into_owned();
                let has_room = file.libraries.len() < MAX_LIBRARIES;
                if has_room && !line.is_empty() && !file.libraries.contains(&line) {
                    file.libraries.push(line);
                }
            }
            b"p" | b"l" => file.problems.points_and_lines.add(scanner.line()),
            b"curv" | b"curv2" | b"surf" => file.problems.free_form.add(scanner.line()),
            // Groups only name faces; everything else does not concern triangles.
            _ => {}
        }
        scanner.next_line();
    }
    file.material_names = names.materials.names;
    file.object_names = names.objects.names;
    file
}

impl ObjFile {
    #[inline]
    fn read_position(&mut self, scanner: &mut Scanner<'_>) {
        let x = scanner.number();
        let y = scanner.number();
        let z = scanner.number();
        let position = match (x, y, z) {
            (Some(x), Some(y), Some(z)) => Vec3::new(x, y, z),
            _ => {
                self.problems.broken_vertices.add(scanner.line());
                Vec3::NAN
            }
        };
        self.positions.push(position);
        // One more number is a weight; three are a colour.
        if let Some(r) = scanner.number()
            && let (Some(g), Some(b)) = (scanner.number(), scanner.number())
        {
            self.colors.resize(self.positions.len() - 1, Vec3::ONE);
            self.colors.push(Vec3::new(r, g, b));
            return;
        }
        if !self.colors.is_empty() {
            self.colors.push(Vec3::ONE);
        }
    }

    #[inline]
    fn read_face(&mut self, scanner: &mut Scanner<'_>, mut state: Run) {
        let first = self.corners.len();
        let line = scanner.line();
        while !scanner.is_line_done() {
            match self.read_corner(scanner) {
                Some(corner) => self.corners.push(corner),
                None => {
                    self.corners.truncate(first);
                    break;
                }
            }
        }
        if self.corners.len() - first < 3 {
            self.corners.truncate(first);
            self.problems.broken_faces.add(line);
            return;
        }
        if self.corners.len() >= NONE as usize {
            self.corners.truncate(first);
            self.problems.overflow = true;
            return;
        }
        state.first_face = self.face_ends.len() as u32;
        let is_new = self.runs.last().is_none_or(|last| {
            (last.material, last.object, last.smoothing)
                != (state.material, state.object, state.smoothing)
        });
        if is_new {
            self.runs.push(state);
        }
        self.face_ends.push(self.corners.len() as u32);
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[inline]
    fn read_corner(&self, scanner: &mut Scanner<'_>) -> Option<Corner> {
        let position = resolve(scanner.integer()?, self.positions.len())?;
        let mut corner = [position, NONE, NONE];
        if scanner.eat(b'/') {
            // UVs and normals that do not exist cost the corner only that attribute.
            if let Some(uv) = scanner.integer() {
                corner[1] = resolve(uv, self.uvs.len()).unwrap_or(NONE);
            }
            if scanner.eat(b'/')
                && let Some(normal) = scanner.integer()
            {
                corner[2] = resolve(normal, self.normals.len()).unwrap_or(NONE);
            }
        }
        Some(corner)
    }
}

/// The number, from 0, of what a file's index means: from 1 upwards, or from −1 back from the last.
#[inline]
fn resolve(index: i64, count: usize) -> Option<u32> {
    let number = if index > 0 { index - 1 } else { index.checked_add(count as i64)? };
    if index == 0 {
        return None;
    }
    u32::try_from(number).ok().filter(|&n| n != NONE)
}

/// `off`, `0`, or a number; a group may have any name, told apart by a hash.
fn smoothing_group(word: &[u8]) -> u32 {
    match word {
        b"" | b"off" | b"0" | b"null" => 0,
        b"on" => 1,
        _ => match Scanner::new(word).integer() {
            Some(number) => number as u32,
            None => word
                .iter()
                .fold(0x811c_9dc5, |hash: u32, &b| (hash ^ u32::from(b)).wrapping_mul(0x0100_0193)),
        },
    }
}

#[derive(Default)]
struct Names {
    materials: NameTable,
    objects: NameTable,
}

/// Numbers names in the order they first appear.
#[derive(Default)]
struct NameTable {
    names: Vec<String>,
    numbers: std::collections::HashMap<Vec<u8>, u32>,
}

impl NameTable {
    fn number(&mut self, name: &[u8]) -> u32 {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let number = self.names.len() as u32;
        self.names.push(String::from_utf8_lossy(name).into_owned());
        self.numbers.insert(name.to_vec(), number);
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_all_forms_of_corners() {
        let file = parse(
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\n\
              f 1 2 3\nf 1/1 2/2 3/1\nf 1//1 2//1 3//1\nf -3/-2/-1 -2/-1/-1 -1/-2/-1\n\
              f 1/ 2/ 3/\nf 1/9 2/0 3/-9\n",
        );
        assert_eq!(file.face_ends, [3, 6, 9, 12, 15, 18]);
        assert_eq!(file.corners[0..3], [[0, NONE, NONE], [1, NONE, NONE], [2, NONE, NONE]]);
        assert_eq!(file.corners[3..6], [[0, 0, NONE], [1, 1, NONE], [2, 0, NONE]]);
        assert_eq!(file.corners[6..9], [[0, NONE, 0], [1, NONE, 0], [2, NONE, 0]]);
        assert_eq!(file.corners[9..12], [[0, 0, 0], [1, 1, 0], [2, 0, 0]]);
        assert_eq!(file.corners[12..15], file.corners[0..3]);
        assert_eq!(file.corners[15..18], [[0, 8, NONE], [1, NONE, NONE], [2, NONE, NONE]]);
    }

    #[test]
    fn continues_lines_and_skips_comments() {
        let file = parse(
            b"# c\\\nv 0 0 0 # tail\r\n\tv\t1 0\\\r\n 0\r\nv 0 1 0\r\n  f 1 \\\n2\\\n 3 # end\n#f 1 2 3",
        );
        assert_eq!(file.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
        assert_eq!(file.face_ends, [3]);
    }

    #[test]
    fn broken_statements_are_counted_with_their_line() {
        let file = parse(b"v 0 0\nv 1 2 x\nf 1 2\nf 0 1 2\nf a b c\nf 1 2 -9\nl 1 2\nf 1 1 1\nf");
        assert_eq!(file.problems.broken_vertices, Count { times: 2, line: 1 });
        assert_eq!(file.problems.broken_faces, Count { times: 5, line: 3 });
        assert_eq!(file.problems.points_and_lines, Count { times: 1, line: 7 });
        assert_eq!(file.face_ends, [3]);
        assert!(file.positions.iter().all(|p| p.is_nan()));
    }

    #[test]
    fn state_makes_runs() {
        let file = parse(
            b"v 0 0 0\nusemtl Material #25 \ns 2\nf 1 1 1\ng x\nf 1 1 1\ns off\nusemtl other\n\
              usemtl Material #25\nf 1 1 1\no a b\nf 1 1 1\n",
        );
        assert_eq!(file.material_names, ["Material #25", "other"]);
        assert_eq!(file.object_names, ["a b"]);
        assert_eq!(
            file.runs,
            [
                Run { first_face: 0, material: 0, object: NONE, smoothing: 2 },
                Run { first_face: 2, material: 0, object: NONE, smoothing: 0 },
                Run { first_face: 3, material: 0, object: 0, smoothing: 0 },
            ]
        );
    }

    #[test]
    fn colours_follow_positions() {
        let file = parse(b"v 0 0 0\nv 1 0 0 0.5 0.25 1\nv 1 1 1 1\n");
        assert_eq!(file.colors, [Vec3::ONE, Vec3::new(0.5, 0.25, 1.0), Vec3::ONE]);
    }

    #[test]
    fn indices_never_wrap() {
        assert_eq!(resolve(i64::MAX, 5), None);
        assert_eq!(resolve(-i64::MAX, 5), None);
        assert_eq!(resolve(i64::from(u32::MAX) + 1, 5), None);
        assert_eq!(resolve(0, 5), None);
        assert_eq!(resolve(-5, 5), Some(0));
        assert_eq!(resolve(-6, 5), None);
    }
}
