//! Prefetches data from memory, so that it arrives while the processor computes with other data.
//!
//! The processor itself prefetches only accesses that are near in time and within a page of memory. A loop over more
//! data than the caches hold, with many operations or with indirect accesses, waits for memory unless it prefetches. No
//! result depends on it.

/// Length of a line of the caches in bytes; a shorter one on some machine would only make the requests incomplete.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Prefetches the item that lies `ahead` items after `item` in memory. Does not read it: if there is no such item,
/// nothing happens.
#[inline(always)]
pub fn prefetch<T>(item: &T, ahead: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(sse) = pulp::core_arch::x86::Sse::try_new() {
        let first = std::ptr::from_ref(item).wrapping_add(ahead).cast::<i8>();
        let mut offset = 0;
        while offset < size_of::<T>() {
            sse._mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(first.wrapping_add(offset));
            offset += LINE;
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (item, ahead);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_need_not_exist() {
        let items = vec![[1.0; 32]; 4];
        for ahead in [0, 3, 4, 1 << 20, usize::MAX] {
            prefetch(&items[0], ahead);
        }
        assert_eq!(items, vec![[1.0; 32]; 4]);
    }
}
