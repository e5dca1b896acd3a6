//! The memory of a traced structure: one allocation of cache lines, in huge pages where possible.

use bytemuck::{Pod, Zeroable};

use crate::BuildError;

/// A cache line.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line {
    pub(crate) words: [u32; 16],
}

/// How many lines references can address: 31 bits of half lines.
const MAX_LINES: usize = 1 << 30;

/// Lines of zeros.
pub(crate) fn allocate(count: usize) -> Result<Vec<Line>, BuildError> {
    if count > MAX_LINES {
        return Err(BuildError::TooMany { what: "cache lines", count, limit: MAX_LINES });
    }
    let mut lines = Vec::new();
    lines.try_reserve_exact(count).map_err(|_| BuildError::OutOfMemory {
        what: "the structure",
        bytes: count * size_of::<Line>(),
    })?;
    advise_huge_pages(&lines);
    lines.resize(count, Line::zeroed());
    Ok(lines)
}

/// Asks for huge pages: without them rays in large scenes wait for page tables.
#[cfg(target_os = "linux")]
fn advise_huge_pages(lines: &Vec<Line>) {
    const PAGE: usize = 4096;
    const HUGE_PAGE: usize = 1 << 21;
    let start = lines.as_ptr().addr();
    let end = start + lines.capacity() * size_of::<Line>();
    let (first, last) = (start.next_multiple_of(PAGE), end & !(PAGE - 1));
    if first + HUGE_PAGE <= last {
        let pages = lines.as_ptr().cast::<u8>().wrapping_add(first - start).cast_mut();
        // SAFETY: whole pages within an allocation of ours; the advice changes nothing but how the
        // kernel backs them, and failing (no such kernel feature) is harmless.
        unsafe { libc::madvise(pages.cast(), last - first, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn advise_huge_pages(_: &Vec<Line>) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_zero_and_too_many_are_refused() {
        let lines = allocate(100_000).unwrap();
        assert!(lines.len() == 100_000 && lines.iter().all(|line| line.words == [0; 16]));
        assert!(matches!(allocate(MAX_LINES + 1), Err(BuildError::TooMany { .. })));
    }
}
