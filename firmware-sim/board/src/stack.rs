//! How much of the stack was ever used: it is painted before, and looked at after.

use core::hint::black_box;
use core::ptr;

const PAINT: u32 = 0xA55A_C33C;
/// Not painted: the frames of this module [bytes].
const OWN_BYTES: usize = 512;

unsafe extern "C" {
    static _stack_bottom: u32;
    static _stack_start: u32;
}

/// Addresses of the lowest word of the stack, and of the word above its highest. As numbers: the symbols have no size.
fn bounds() -> (usize, usize) {
    ((&raw const _stack_bottom).expose_provenance(), (&raw const _stack_start).expose_provenance())
}

/// Paints what is not used now.
#[inline(never)]
pub fn paint() {
    let here = 0u32;
    let end = black_box(&raw const here).addr().saturating_sub(OWN_BYTES);
    let (bottom, _) = bounds();
    for address in (bottom..end).step_by(size_of::<u32>()) {
        // SAFETY: between the stack's bottom and the frames in use: nobody's memory. Volatile, for nobody reads it here.
        unsafe { ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(PAINT) };
    }
}

/// Most that was used since [`paint`] [bytes].
#[inline(never)]
pub fn peak_bytes() -> usize {
    let (bottom, top) = bounds();
    let painted = |address: &usize| {
        // SAFETY: within the stack, word by word; reading what nobody owns is what this is about.
        unsafe { ptr::with_exposed_provenance::<u32>(*address).read_volatile() == PAINT }
    };
    let untouched = (bottom..top).step_by(size_of::<u32>()).take_while(painted).count();
    top - bottom - untouched * size_of::<u32>()
}
