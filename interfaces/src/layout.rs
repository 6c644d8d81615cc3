//! Layout of wire types as data: what both ends of a wire compare before they talk.
//!
//! iceoryx2 checks a payload's name, size and alignment; two builds that swapped two fields of the
//! same size would still connect. The layout hash covers names, types, order and offsets, and
//! travels as a service attribute, so such a pair is refused with both sides named.

/// A plain value a wire message may consist of: integers, `f64`, arrays and structs of them.
pub trait WireField: Copy + 'static {
    /// Name of the scalar or struct type, C-like and stable.
    const TYPE: &'static str;
    /// Number of elements; 1 unless it is an array.
    const LEN: usize;
    /// Layout of an element that is a message itself; `None` for a scalar.
    const NESTED: Option<&'static Layout> = None;
    /// The all-zero value.
    const ZERO: Self;
}

macro_rules! scalar {
    ($($t:ty = $zero:expr),*) => {$(
        impl WireField for $t {
            const TYPE: &'static str = stringify!($t);
            const LEN: usize = 1;
            const ZERO: Self = $zero;
        }
    )*};
}
scalar!(u8 = 0, u64 = 0, i64 = 0, f64 = 0.0);

impl<T: WireField, const N: usize> WireField for [T; N] {
    const TYPE: &'static str = T::TYPE;
    const LEN: usize = N * T::LEN;
    const NESTED: Option<&'static Layout> = T::NESTED;
    const ZERO: Self = [T::ZERO; N];
}

/// One field of a wire message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Field name.
    pub name: &'static str,
    /// Element type.
    pub type_name: &'static str,
    /// Number of elements.
    pub len: usize,
    /// Byte offset in the struct.
    pub offset: usize,
    /// Layout of the element if it is a message itself.
    pub nested: Option<&'static Layout>,
    /// What it is: its documentation, a line of it a line.
    pub doc: &'static str,
}

/// A wire message as data: what a program in another language needs to know of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Versioned name, e.g. `hilare/Pose/v1`.
    pub name: &'static str,
    /// Name of the struct, e.g. `Pose`.
    pub ident: &'static str,
    /// Bytes of the struct.
    pub size: usize,
    /// The fields in order.
    pub fields: &'static [Field],
    /// What it is: its documentation, a line of it a line.
    pub doc: &'static str,
}

/// A `repr(C)` message that may lie in shared memory.
///
/// # Safety
///
/// The type must be `repr(C)`, without padding, and valid for every bit pattern. The
/// [`wire_message!`](crate::wire_message) macro, the only implementor, checks all three at compile
/// time: fields are [`WireField`]s, and their sizes add up to the size of the struct.
#[allow(unsafe_code)]
pub unsafe trait WireMessage: WireField {
    /// Versioned name, e.g. `hilare/Pose/v1`.
    const NAME: &'static str;
    /// The fields in order.
    const FIELDS: &'static [Field];
    /// All there is to know of it.
    const LAYOUT: Layout;
    /// Hash over the name and the fields.
    const LAYOUT_HASH: u64 = layout_hash(Self::NAME, Self::FIELDS);

    /// The message as it lies in memory, which its layout describes.
    fn as_bytes(&self) -> &[u8] {
        // SAFETY: repr(C) without padding, so every byte of it is initialized.
        unsafe { core::slice::from_raw_parts(core::ptr::from_ref(self).cast(), size_of::<Self>()) }
    }

    /// A number that differs wherever a bit of the message does, but for accidents: FNV-1a over its words.
    #[inline]
    fn content_hash(&self) -> u64 {
        let mix = |hash: u64, word: &[u8]| {
            let word = word.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
            // The multiplication alone carries nothing down.
            (hash ^ word).wrapping_mul(FNV_PRIME).rotate_left(29)
        };
        self.as_bytes().chunks(8).fold(FNV_BASIS, mix)
    }

    /// Messages one after the other as they lie in memory.
    fn all_bytes(all: &[Self]) -> &[u8] {
        // SAFETY: as above; a slice has no padding between its elements.
        unsafe { core::slice::from_raw_parts(all.as_ptr().cast(), size_of_val(all)) }
    }

    /// The message of which these are the bytes; `None` if there are not as many as it has.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        if bytes.len() != size_of::<Self>() {
            return None;
        }
        // SAFETY: as many bytes as it has, and every bit pattern is a value of it.
        Some(unsafe { bytes.as_ptr().cast::<Self>().read_unaligned() })
    }
}

/// Where FNV-1a begins.
const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
/// What it multiplies with.
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

const fn fnv1a(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(FNV_PRIME);
        i += 1;
    }
    // A separator, so that ("ab", "c") and ("a", "bc") differ.
    (hash ^ 0xff).wrapping_mul(FNV_PRIME)
}

/// FNV-1a over the message's name and each field's name, type, length and offset.
pub const fn layout_hash(name: &str, fields: &[Field]) -> u64 {
    let mut hash = fnv1a(FNV_BASIS, name.as_bytes());
    let mut i = 0;
    while i < fields.len() {
        hash = fnv1a(hash, fields[i].name.as_bytes());
        hash = fnv1a(hash, fields[i].type_name.as_bytes());
        hash = fnv1a(hash, &(fields[i].len as u64).to_le_bytes());
        hash = fnv1a(hash, &(fields[i].offset as u64).to_le_bytes());
        i += 1;
    }
    hash
}

/// Declares a wire message: a `repr(C)` struct, its versioned name and its layout.
#[macro_export]
macro_rules! wire_message {
    ($(#[doc = $doc:literal])* $name:ident = $wire_name:literal {
        $($(#[doc = $fdoc:literal])* $field:ident : $type:ty,)*
    }) => {
        $(#[doc = $doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $($(#[doc = $fdoc])* pub $field: $type,)* }

        impl $crate::layout::WireField for $name {
            const TYPE: &'static str = $wire_name;
            const LEN: usize = 1;
            const NESTED: Option<&'static $crate::layout::Layout> =
                Some(&<Self as $crate::layout::WireMessage>::LAYOUT);
            const ZERO: Self = Self { $($field: <$type as $crate::layout::WireField>::ZERO,)* };
        }

        impl Default for $name {
            fn default() -> Self { <Self as $crate::layout::WireField>::ZERO }
        }

        // SAFETY: repr(C); every field is a WireField (any bit pattern is a value); the assertion
        // below refuses padding.
        #[allow(unsafe_code)]
        unsafe impl $crate::layout::WireMessage for $name {
            const NAME: &'static str = $wire_name;
            const FIELDS: &'static [$crate::layout::Field] = &[$($crate::layout::Field {
                name: stringify!($field),
                type_name: <$type as $crate::layout::WireField>::TYPE,
                len: <$type as $crate::layout::WireField>::LEN,
                offset: core::mem::offset_of!($name, $field),
                nested: <$type as $crate::layout::WireField>::NESTED,
                doc: concat!($($fdoc, "\n"),*),
            },)*];
            const LAYOUT: $crate::layout::Layout = $crate::layout::Layout {
                name: $wire_name,
                ident: stringify!($name),
                size: core::mem::size_of::<$name>(),
                fields: Self::FIELDS,
                doc: concat!($($doc, "\n"),*),
            };
        }

        const _: () = assert!(
            core::mem::size_of::<$name>() == 0 $(+ core::mem::size_of::<$type>())*,
            concat!(stringify!($name), " has padding: reorder or widen its fields"),
        );
    };
}
