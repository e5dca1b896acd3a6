//! The memory of a traced structure: one allocation of cache lines, in huge pages where possible.

use bytemuck::{Pod, Zeroable, allocation::try_zeroed_vec};

use crate::BuildError;

/// A cache line.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Line {
    pub(crate) words: [u32; 16],
}

/// How many lines references can address: 31 bits of half lines.
const MAX_LINES: usize = 1 << 30;

/// Zeros, in huge pages, of which no memory is touched before it is written.
pub(crate) fn zeroed_vec<T: Zeroable>(
    count: usize,
    what: &'static str,
) -> Result<Vec<T>, BuildError> {
    let bytes = count.saturating_mul(size_of::<T>());
    let items = try_zeroed_vec(count).map_err(|()| BuildError::OutOfMemory { what, bytes })?;
    advise_huge_pages(&items);
    Ok(items)
}

/// Lines of zeros.
pub(crate) fn allocate(count: usize) -> Result<Vec<Line>, BuildError> {
    if count > MAX_LINES {
        return Err(BuildError::TooMany { what: "cache lines", count, limit: MAX_LINES });
    }
    zeroed_vec(count, "the structure")
}

/// Asks for huge pages: without them rays in large scenes wait for page tables.
#[cfg(target_os = "linux")]
pub(crate) fn advise_huge_pages<T>(items: &Vec<T>) {
    const PAGE: usize = 4096;
    const HUGE_PAGE: usize = 1 << 21;
    let start = items.as_ptr().addr();
    let end = start + items.capacity() * size_of::<T>();
    let (first, last) = (start.next_multiple_of(PAGE), end & !(PAGE - 1));
    if first + HUGE_PAGE <= last {
        let pages = items.as_ptr().cast::<u8>().wrapping_add(first - start).cast_mut();
        // SAFETY: whole pages within an allocation of ours; the advice changes nothing but how the
        // kernel backs them, and failing (no such kernel feature) is harmless.
        unsafe { libc::madvise(pages.cast(), last - first, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn advise_huge_pages<T>(_: &Vec<T>) {}

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
