//! Large values are made in place.
//!
//! An assignment `*place = Enum::Variant(payload)` of tens of kilobytes would go over the stack or be copied
//! out of flash. Here the payload is written into its place at once. A payload that is a constant of zero
//! bits costs neither stack nor flash then: the compiler fills the place.

/// Layout of a variant with one field of an enum with `repr(u8)`: fixed by the language (RFC 2195).
#[repr(C)]
struct Variant<P> {
    tag: u8,
    payload: P,
}

/// Is an enum with `repr(u8)` that owns nothing.
///
/// # Safety
/// The enum has `repr(u8)`, and its variant with the tag `TAG` has one field, of type `P`. Neither needs to
/// be dropped.
pub(crate) unsafe trait HasVariant<P, const TAG: u8>: Sized {
    /// The payload to begin with.
    const UNUSED: P;
}

/// Makes `place` its variant with the tag `TAG`, which holds a `P`, as it is before it is set up.
#[inline(always)]
pub(crate) fn begin<E: HasVariant<P, TAG>, P, const TAG: u8>(place: &mut E) {
    const { assert!(!core::mem::needs_drop::<E>()) }
    let variant = core::ptr::from_mut(place).cast::<Variant<P>>();
    // SAFETY: the trait's promise makes this the variant's layout; both fields are written, none is read, and
    // there is nothing to drop.
    unsafe {
        (&raw mut (*variant).payload).write(E::UNUSED);
        (&raw mut (*variant).tag).write(TAG);
    }
}
