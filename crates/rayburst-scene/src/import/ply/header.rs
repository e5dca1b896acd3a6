//! The header of a PLY file (Turk, "The PLY Polygon File Format", 1994).

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Types of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary body.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The largest value of an integer type: full intensity of a colour.
    pub(super) fn full_scale(self) -> Option<f32> {
        match self {
            Self::I8 => Some(f32::from(i8::MAX)),
            Self::U8 => Some(f32::from(u8::MAX)),
            Self::I16 => Some(f32::from(i16::MAX)),
            Self::U16 => Some(f32::from(u16::MAX)),
            Self::I32 => Some(i32::MAX as f32),
            Self::U32 => Some(u32::MAX as f32),
            Self::F32 | Self::F64 => None,
        }
    }
}

/// A property of an element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    /// Type of the number, or of a list's items.
    pub(super) scalar: Scalar,
    /// Type of a list's length.
    pub(super) list: Option<Scalar>,
}

/// An element: `count` records of the same properties.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The fewest bytes that a record can take.
    pub(super) fn smallest_record(&self, encoding: Encoding) -> u64 {
        let each = |p: &Property| match encoding {
            // A digit and a blank.
            Encoding::Ascii => 2,
            _ => p.list.unwrap_or(p.scalar).size() as u64,
        };
        self.properties.iter().map(each).sum()
    }

    /// The place of the first property with one of some names.
    pub(super) fn find(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| names.contains(&p.name.as_str()))
    }
}

/// A whole header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// From a `comment TextureFile NAME`, as MeshLab writes it.
    pub(super) texture: Option<String>,
    /// Where the body begins.
    pub(super) body: usize,
}

/// The largest header that is read.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// The most properties of all elements.
const MAX_PROPERTIES: usize = 4096;

/// Reads the header; an error says the line and the reason.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, (u32, String)> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut texture = None;
    let mut properties = 0;
    let mut at = 0;
    let mut number = 0;
    loop {
        number += 1;
        let fail = |reason: String| Err((number, reason));
        let window = &bytes[at..bytes.len().min(MAX_HEADER_BYTES)];
        let Some((line, next)) = line_of(window) else {
            return fail("the header has no end_header".to_owned());
        };
        at += next;
        let line = String::from_utf8_lossy(line);
        let mut words = line.split_ascii_whitespace();
        let keyword = words.next().unwrap_or("");
        let rest: Vec<&str> = words.collect();
        if number == 1 && keyword != "ply" {
            return fail("it does not begin with 'ply'".to_owned());
        }
        match (keyword, rest.as_slice()) {
            ("format", [name, ..]) => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return fail(format!("'{name}' is no PLY format")),
                });
            }
            ("comment", ["TextureFile", ..]) => {
                let name = line.split_once("TextureFile").map_or("", |(_, name)| name.trim());
                texture.get_or_insert_with(|| name.to_owned());
            }
            ("element", [name, count]) => {
                let Ok(count) = count.parse() else {
                    return fail(format!("'{count}' is no number of elements"));
                };
                elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
                properties += 1;
            }
            ("property", words) => {
                let property = match words {
                    ["list", length, item, name] => {
                        let (length, item) = (Scalar::parse(length), Scalar::parse(item));
                        length.zip(item).map(|(l, s)| (s, Some(l), *name))
                    }
                    [scalar, name] => Scalar::parse(scalar).map(|s| (s, None, *name)),
                    _ => None,
                };
                let Some((scalar, list, name)) = property else {
                    return fail(format!("'{}' is no property", line.trim()));
                };
                let Some(element) = elements.last_mut() else {
                    return fail("a property comes before the first element".to_owned());
                };
                element.properties.push(Property { name: name.to_owned(), scalar, list });
                properties += 1;
            }
            ("end_header", _) => break,
            ("ply", _) if number == 1 => {}
            ("comment" | "obj_info" | "", _) => {}
            _ => return fail(format!("'{}' is no statement of a PLY header", line.trim())),
        }
        if properties > MAX_PROPERTIES {
            return fail(format!("more than {MAX_PROPERTIES} elements and properties"));
        }
    }
    match encoding {
        Some(encoding) => Ok(Header { encoding, elements, texture, body: at }),
        None => Err((number, "the header has no format".to_owned())),
    }
}

/// A line without its end, and where the next begins. Lines end with `\n`, `\r\n` or a lone `\r`.
fn line_of(bytes: &[u8]) -> Option<(&[u8], usize)> {
    let end = bytes.iter().position(|&b| b == b'\n' || b == b'\r')?;
    let is_pair = bytes[end] == b'\r' && bytes.get(end + 1) == Some(&b'\n');
    Some((&bytes[..end], end + 1 + usize::from(is_pair)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_all_statements_with_all_line_ends() {
        let text = "ply\nformat binary_big_endian 1.0\ncomment made by hand\ncomment TextureFile my wood.png\n\
                    obj_info x\nelement vertex 3\nproperty float x\nproperty uint8 red\n\
                    element face 18446744073709551615\nproperty list uchar int vertex_indices\nend_header\n";
        for text in [text.to_owned(), text.replace('\n', "\r\n"), text.replace('\n', "\r")] {
            let bytes = [text.as_bytes(), b"\x01\x02"].concat();
            let header = parse(&bytes).expect("header");
            assert_eq!(header.encoding, Encoding::Big);
            assert_eq!(header.texture.as_deref(), Some("my wood.png"));
            assert_eq!(&bytes[header.body..], b"\x01\x02");
            assert_eq!(header.elements[0].find(&["r", "red"]), Some(1));
            assert_eq!(header.elements[0].smallest_record(header.encoding), 5);
            assert_eq!(header.elements[1].count, u64::MAX);
            let list = &header.elements[1].properties[0];
            assert_eq!((list.scalar, list.list), (Scalar::I32, Some(Scalar::U8)));
        }
    }

    #[test]
    fn errors_name_the_line() {
        for (text, line) in [
            ("", 1),
            ("plx\n", 1),
            ("ply\nformat ebcdic 1.0\n", 2),
            ("ply\nelement vertex -3\n", 2),
            ("ply\nproperty float x\n", 2),
            ("ply\nelement v 1\nproperty quad x\n", 3),
            ("ply\nelement v 1\nproperty list uchar x\n", 3),
            ("ply\nend_header\n", 2),
            ("ply\nformat ascii 1.0\nelement vertex 1\n", 4),
            ("ply\nnonsense\n", 2),
        ] {
            let (at, reason) = parse(text.as_bytes()).expect_err(text);
            assert_eq!(at, line, "{text:?}: {reason}");
        }
    }
}
