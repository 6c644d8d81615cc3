//! CDR (XCDR version 1, little endian), as ROS 2 puts messages into files.
//!
//! ```text
//! 00 01 00 00 | body, every number at a multiple of its own size from here on
//! ```
//!
//! Our own messages consist of numbers of eight bytes, and text that ends them: the body is the message as it lies in
//! memory, bit for bit.

use hilare_interfaces::layout::Layout;

/// Its name, as channels have it.
pub const ENCODING: &str = "cdr";
/// What precedes every body: how numbers lie in it, and no options.
pub const HEADER: [u8; 4] = [0, cfg!(target_endian = "little") as u8, 0, 0];

/// A number at a multiple of its own size.
const ALIGNMENT: usize = 8;

/// Writes a message, or a header and what follows it.
pub fn write_message(out: &mut Vec<u8>, message: &[u8], elements: Option<(usize, &[u8])>) {
    out.extend_from_slice(&HEADER);
    let start = out.len();
    out.extend_from_slice(message);
    let Some((count, bytes)) = elements else { return };
    out.extend_from_slice(&(count as u32).to_ne_bytes());
    if count > 0 {
        while !(out.len() - start).is_multiple_of(ALIGNMENT) {
            out.push(0);
        }
        out.extend_from_slice(bytes);
    }
}

/// What follows the header; `None` if it is not in our order of bytes.
pub fn body(cdr: &[u8]) -> Option<&[u8]> {
    cdr.strip_prefix(&HEADER)
}

/// Bytes of a header message and of the elements that follow it; `None` unless that is all there is.
pub fn slice_parts<'a>(cdr: &'a [u8], header: &Layout, element: &Layout) -> Option<(&'a [u8], &'a [u8])> {
    let body = body(cdr)?;
    let (header_bytes, rest) = body.split_at_checked(header.size)?;
    let (count, rest) = rest.split_first_chunk()?;
    let count = u32::from_ne_bytes(*count) as usize;
    if count == 0 {
        return rest.is_empty().then_some((header_bytes, rest));
    }
    let padding =
        (header.size + size_of::<u32>()).next_multiple_of(ALIGNMENT) - header.size - size_of::<u32>();
    let elements = rest.get(padding..)?;
    (Some(elements.len()) == count.checked_mul(element.size)).then_some((header_bytes, elements))
}

/// Writes one message of numbers, text and lists into a file's buffer.
pub struct Writer<'a> {
    out: &'a mut Vec<u8>,
    start: usize,
}

impl<'a> Writer<'a> {
    /// Begins a message at the end of `out`.
    pub fn new(out: &'a mut Vec<u8>) -> Self {
        out.extend_from_slice(&[0, 1, 0, 0]);
        let start = out.len();
        Self { out, start }
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        while !(self.out.len() - self.start).is_multiple_of(N) {
            self.out.push(0);
        }
        self.out.extend_from_slice(&bytes);
    }

    /// A byte.
    pub fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    /// An unsigned number of four bytes; also the length of a list.
    pub fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    /// A signed number of four bytes.
    pub fn i32(&mut self, value: i32) {
        self.put(value.to_le_bytes());
    }

    /// A real number.
    pub fn f64(&mut self, value: f64) {
        self.put(value.to_le_bytes());
    }

    /// A real number of four bytes.
    pub fn f32(&mut self, value: f32) {
        self.put(value.to_le_bytes());
    }

    /// A list of signed bytes: its length, then they.
    pub fn i8s(&mut self, values: &[i8]) {
        self.u32(values.len() as u32);
        self.out.extend(values.iter().map(|value| value.cast_unsigned()));
    }

    /// Text: its length with the zero that ends it, then both.
    pub fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.out.extend_from_slice(text.as_bytes());
        self.out.push(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_lie_at_multiples_of_their_size() {
        let mut out = vec![9];
        let mut writer = Writer::new(&mut out);
        writer.u8(1);
        writer.u32(2);
        writer.string("ab");
        writer.f64(1.0);
        let expected = [
            &[9, 0, 1, 0, 0][..],
            &[1, 0, 0, 0, 2, 0, 0, 0],
            &[3, 0, 0, 0, b'a', b'b', 0, 0],
            &1.0_f64.to_le_bytes(),
        ];
        assert_eq!(out, expected.concat());
    }
}
