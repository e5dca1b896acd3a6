//! What a program finds in memory once it is loaded: an ELF file and its relocations, as far as
//! `asm-check` needs them.

use std::collections::BTreeMap;

/// A loaded program.
pub(super) struct Image {
    bytes: Vec<u8>,
    /// Address, size in the file, place in the file.
    segments: Vec<[u64; 3]>,
    /// Addresses that hold addresses.
    pointers: BTreeMap<u64, u64>,
    /// Addresses that hold those of functions, and their names.
    slots: BTreeMap<u64, String>,
}

/// Where in the source something panics.
pub(super) struct Location {
    pub(super) file: String,
    pub(super) line: u32,
}

impl Image {
    /// From a 64-bit little-endian file, what `objdump -R` says of it, and where functions begin.
    pub(super) fn new(bytes: Vec<u8>, relocations: &str, names: &BTreeMap<u64, &str>) -> Self {
        let (mut pointers, mut slots) = (BTreeMap::new(), BTreeMap::new());
        for line in relocations.lines() {
            let words: Vec<_> = line.split_whitespace().collect();
            let [at, _, what] = words[..] else { continue };
            let Ok(at) = u64::from_str_radix(at, 16) else { continue };
            let to = what.strip_prefix("*ABS*+0x").and_then(|a| u64::from_str_radix(a, 16).ok());
            if let Some(to) = to {
                pointers.insert(at, to);
            }
            let name = to.map_or(Some(what), |to| names.get(&to).copied());
            if let Some(name) = name {
                slots.insert(at, name.to_owned());
            }
        }
        let mut image = Self { bytes, segments: vec![], pointers, slots };
        let header = |image: &Self, at: u64| image.number(at).unwrap_or(0);
        let (start, count) = (header(&image, 32), header(&image, 56) & 0xFFFF);
        for entry in (0..count).map(|i| start + 56 * i) {
            // Kind 1 is what is loaded.
            if header(&image, entry) & 0xFFFF_FFFF == 1 {
                let part = [16, 32, 8].map(|field| header(&image, entry + field));
                image.segments.push(part);
            }
        }
        image
    }

    /// The function whose address is kept at this one.
    pub(super) fn slot(&self, address: u64) -> Option<&str> {
        self.slots.get(&address).map(String::as_str)
    }

    /// The place in the source that is kept at an address: a path, its length, a line, a column.
    pub(super) fn location(&self, address: u64) -> Option<Location> {
        const LONGEST: u64 = 4096;
        let path = self.place(*self.pointers.get(&address)?)?;
        let length = self.number(self.place(address + 8)?)?;
        let line = self.number(self.place(address + 16)?)? as u32;
        if length > LONGEST || line == 0 {
            return None;
        }
        let path = self.bytes.get(path as usize..(path + length) as usize)?;
        let file = std::str::from_utf8(path).ok()?;
        file.ends_with(".rs").then(|| Location { file: file.to_owned(), line })
    }

    /// Where an address is in the file.
    fn place(&self, address: u64) -> Option<u64> {
        let within = |[start, size, _]: &&[u64; 3]| (*start..*start + *size).contains(&address);
        self.segments.iter().find(within).map(|[start, _, at]| at + (address - start))
    }

    /// Eight bytes of the file.
    fn number(&self, at: u64) -> Option<u64> {
        let bytes = self.bytes.get(at as usize..at as usize + 8)?;
        Some(u64::from_le_bytes(bytes.try_into().ok()?))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A file with one segment, at an address, that holds a location whose path follows it.
    pub(in super::super) fn elf(address: u64, file: &str, line: u32) -> Vec<u8> {
        let mut bytes = vec![0; 64 + 56];
        let mut put = |at: usize, number: u64| {
            bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
        };
        put(32, 64);
        put(56, 1);
        put(64, 1);
        put(64 + 8, 120);
        put(64 + 16, address);
        put(64 + 32, 24 + file.len() as u64);
        bytes.extend(0u64.to_le_bytes());
        bytes.extend((file.len() as u64).to_le_bytes());
        bytes.extend(line.to_le_bytes());
        bytes.extend(1u32.to_le_bytes());
        bytes.extend(file.as_bytes());
        bytes
    }

    #[test]
    fn locations_and_slots_are_found() {
        let relocations = "\
0000000000004000 R_X86_64_RELATIVE  *ABS*+0x0000000000004018
0000000000005000 R_X86_64_GLOB_DAT  free@GLIBC_2.2.5";
        let image = Image::new(elf(0x4000, "a/b.rs", 42), relocations, &BTreeMap::new());
        let location = image.location(0x4000).unwrap();
        assert_eq!((location.file.as_str(), location.line), ("a/b.rs", 42));
        assert!(image.location(0x4008).is_none());
        assert_eq!(image.slot(0x5000), Some("free@GLIBC_2.2.5"));
    }
}
