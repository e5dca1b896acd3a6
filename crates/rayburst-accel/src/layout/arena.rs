//! The memory of a traced structure: one allocation of cache lines, in huge pages where possible.

use std::mem::MaybeUninit;

use bytemuck::{Pod, Zeroable, allocation::try_zeroed_vec};
use rayon::prelude::*;

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
    /// Lines that one task zeroes.
    const PART: usize = 1 << 14;
    let mut sizes = vec![PART; count / PART];
    sizes.push(count % PART);
    allocate_parts(&sizes, 0, |_, _| ()).map(|(lines, _)| lines)
}

/// Lines in consecutive parts of the given sizes, each zeroed and then written by a task of its own,
/// which gets the part's number. There is room for some more lines at the end.
pub(crate) fn allocate_parts<R: Send>(
    sizes: &[usize],
    more: usize,
    write: impl Fn(usize, &mut [Line]) -> R + Sync,
) -> Result<(Vec<Line>, Vec<R>), BuildError> {
    let count = sizes.iter().fold(0usize, |sum, &size| sum.saturating_add(size));
    let mut lines = reserve(count.saturating_add(more))?;
    let mut rest = &mut lines.spare_capacity_mut()[..count];
    let mut parts = Vec::with_capacity(sizes.len());
    for &size in sizes {
        let (part, others) = rest.split_at_mut(size);
        parts.push(part);
        rest = others;
    }
    let task = |(number, part): (usize, &mut [MaybeUninit<Line>])| {
        part.fill(MaybeUninit::new(Line::zeroed()));
        // SAFETY: `MaybeUninit<Line>` is laid out as `Line`, and every element was just written.
        let part = unsafe { &mut *(std::ptr::from_mut(part) as *mut [Line]) };
        write(number, part)
    };
    let results = parts.into_par_iter().enumerate().map(task).collect();
    // SAFETY: the parts make up `count` elements within the capacity, and all were written.
    unsafe { lines.set_len(count) };
    Ok((lines, results))
}

fn check(count: usize) -> Result<(), BuildError> {
    if count > MAX_LINES {
        return Err(BuildError::TooMany { what: "cache lines", count, limit: MAX_LINES });
    }
    Ok(())
}

fn reserve(count: usize) -> Result<Vec<Line>, BuildError> {
    check(count)?;
    let mut lines = Vec::new();
    lines.try_reserve_exact(count).map_err(|_| BuildError::OutOfMemory {
        what: "the structure",
        bytes: count * size_of::<Line>(),
    })?;
    // Before anything is written: memory that is in use stays in the pages it has.
    advise_huge_pages(&lines);
    collapse_pages(&lines);
    Ok(lines)
}

/// Asks for huge pages: without them rays in large scenes wait for page tables.
pub(crate) fn advise_huge_pages<T>(items: &Vec<T>) {
    #[cfg(target_os = "linux")]
    advise(items, libc::MADV_HUGEPAGE);
    #[cfg(not(target_os = "linux"))]
    let _ = items;
}

/// Makes huge pages at once of memory that an allocator may have used before, which small pages hold. It
/// does not keep larger pieces, which come fresh (glibc's greatest threshold); there it would only take
/// time. Fails without harm before Linux 6.1.
fn collapse_pages<T>(items: &Vec<T>) {
    const LARGEST_USED: usize = 32 << 20;
    #[cfg(target_os = "linux")]
    if items.capacity() * size_of::<T>() <= LARGEST_USED {
        advise(items, libc::MADV_COLLAPSE);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (items, LARGEST_USED);
}

/// Tells the kernel how to back the whole pages of an allocation, if a huge one fits.
#[cfg(target_os = "linux")]
fn advise<T>(items: &Vec<T>, advice: libc::c_int) {
    const PAGE: usize = 4096;
    const HUGE_PAGE: usize = 1 << 21;
    let start = items.as_ptr().addr();
    let end = start + items.capacity() * size_of::<T>();
    let (first, last) = (start.next_multiple_of(PAGE), end & !(PAGE - 1));
    if first + HUGE_PAGE <= last {
        let pages = items.as_ptr().cast::<u8>().wrapping_add(first - start).cast_mut();
        // SAFETY: whole pages within an allocation of ours; the advice changes nothing but how the
        // kernel backs them, and failing (no such kernel feature) is harmless.
        unsafe { libc::madvise(pages.cast(), last - first, advice) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_zero_and_too_many_are_refused() {
        let lines = allocate(100_000).unwrap();
        assert!(lines.len() == 100_000 && lines.iter().all(|line| line.words == [0; 16]));
        assert!(matches!(allocate(MAX_LINES + 1), Err(BuildError::TooMany { .. })));
        let sizes = [MAX_LINES, usize::MAX];
        assert!(matches!(allocate_parts(&sizes, 0, |_, _| ()), Err(BuildError::TooMany { .. })));
    }

    #[test]
    fn parts_follow_each_other() {
        let (lines, lengths) = allocate_parts(&[3, 0, 1, 7], 5, |number, part| {
            assert!(part.iter().all(|line| line.words == [0; 16]));
            part.iter_mut().for_each(|line| line.words[5] = number as u32);
            part.len()
        })
        .unwrap();
        assert_eq!(lengths, [3, 0, 1, 7]);
        assert!(lines.capacity() >= 16);
        assert!(lines.iter().map(|l| l.words[5]).eq([0, 0, 0, 2, 3, 3, 3, 3, 3, 3, 3]));
    }
}
