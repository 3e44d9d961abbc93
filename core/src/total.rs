//! Sorting and collecting that cannot panic: what `core` and `heapless` offer does, at least in the eyes of the linker, and
//! the hot path must not.

use heapless::Vec;

/// Up to this many values, moving each into place is quickest.
const FEW: usize = 24;

/// Sorts by an order; equal values may change places. At most about 2 n log2 n comparisons, whatever the values; an order
/// that contradicts itself gives some order.
pub fn sort_by<T: Copy>(values: &mut [T], less: impl Fn(&T, &T) -> bool) {
    if values.len() <= FEW {
        return insert_each(values, less);
    }
    for root in (0..values.len() / 2).rev() {
        sift_down(values, root, &less);
    }
    for end in (1..values.len()).rev() {
        let Some((last, heap)) = values.get_mut(..=end).and_then(<[T]>::split_last_mut) else { return };
        if let Some(largest) = heap.first_mut() {
            core::mem::swap(largest, last);
        }
        sift_down(heap, 0, &less);
    }
}

fn insert_each<T: Copy>(values: &mut [T], less: impl Fn(&T, &T) -> bool) {
    for end in 1..values.len() {
        let Some((moving, before)) = values.get_mut(..=end).and_then(<[T]>::split_last_mut) else { return };
        let mut gap = moving;
        for place in before.iter_mut().rev() {
            if !less(gap, place) {
                break;
            }
            core::mem::swap(gap, place);
            gap = place;
        }
    }
}

/// Lets the value at `root` sink until no child is larger.
fn sift_down<T: Copy>(heap: &mut [T], root: usize, less: &impl Fn(&T, &T) -> bool) {
    let Some(&moving) = heap.get(root) else { return };
    let mut at = root;
    loop {
        let (left, right) = (2 * at + 1, 2 * at + 2);
        let Some(mut larger) = heap.get(left) else { break };
        let mut child = left;
        if let Some(other) = heap.get(right).filter(|other| less(larger, other)) {
            (larger, child) = (other, right);
        }
        if !less(&moving, larger) {
            break;
        }
        let risen = *larger;
        if let Some(place) = heap.get_mut(at) {
            *place = risen;
        }
        at = child;
    }
    if let Some(place) = heap.get_mut(at) {
        *place = moving;
    }
}

/// The first `N` values.
pub fn collect<T, const N: usize>(values: impl Iterator<Item = T>) -> Vec<T, N> {
    let mut all = Vec::new();
    for value in values {
        if all.push(value).is_err() {
            break;
        }
    }
    all
}
