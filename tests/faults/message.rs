//! What can be done to a message, by what its layout says of it.

use super::plan::Forgery;
use hilare_interfaces::layout::{Field, WireMessage};
use hilare_interfaces::messages::{Authority, Command, Pose, PoseFix, Reference, Steps, Waypoint, Wheels};

/// A message that can be spoilt.
pub trait Message: WireMessage {
    /// The command of somebody else beside this one. None of other messages.
    fn forged(&self, forgery: Forgery) -> Option<Self> {
        let _ = forgery;
        None
    }

    /// Asks for `times` as much; only commands ask for anything.
    fn overdo(&mut self, times: f64) {
        let _ = times;
    }

    /// Flips one of its bits, whichever `word` says.
    fn flip(&mut self, word: u64) {
        let bytes = bytes_of(self);
        let bit = word % (bytes.len() as u64 * 8);
        bytes[(bit / 8) as usize] ^= 1 << (bit % 8);
    }

    /// Makes one of its numbers none, whichever `word` says: NaN of either sign, or infinite.
    fn spoil(&mut self, word: u64) {
        // A waypoint is nothing but numbers.
        let words = |field: &Field| match field.type_name {
            "f64" => field.len,
            Waypoint::NAME => field.len * (size_of::<Waypoint>() / size_of::<f64>()),
            _ => 0,
        };
        let count: usize = Self::FIELDS.iter().map(words).sum();
        if count == 0 {
            return;
        }
        let mut place = (word % count as u64) as usize;
        let wrong = [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY][(word >> 62) as usize];
        for field in Self::FIELDS {
            if place < words(field) {
                let at = field.offset + size_of::<f64>() * place;
                bytes_of(self)[at..at + size_of::<f64>()].copy_from_slice(&wrong.to_ne_bytes());
                return;
            }
            place -= words(field);
        }
    }
}

/// A message as it lies in shared memory.
#[allow(unsafe_code)]
fn bytes_of<T: WireMessage>(message: &mut T) -> &mut [u8] {
    // SAFETY: a WireMessage has no padding and is valid for every bit pattern (the trait's contract), so its
    // bytes are initialized and may become any others; the borrow is exclusive for as long as the slice lives.
    unsafe { std::slice::from_raw_parts_mut(std::ptr::from_mut(message).cast(), size_of::<T>()) }
}

impl Message for Command {
    fn forged(&self, forgery: Forgery) -> Option<Self> {
        // Backwards and turning, as fast as numbers go: seen at once if it acts.
        let wild = Self { vx_mps: -1e9, omega_radps: 1e9, ..*self };
        match forgery {
            Forgery::OlderEpoch => Some(Self { epoch: self.epoch - 1, ..wild }),
            Forgery::WrongSource => Some(Self { source: self.source + 40, ..wild }),
            Forgery::RepeatedSeq => Some(Self { seq: self.seq - 1, ..wild }),
            Forgery::OldSeq => self.seq.checked_sub(2).map(|seq| Self { seq, ..wild }),
        }
    }

    fn overdo(&mut self, times: f64) {
        self.vx_mps *= times;
        self.omega_radps *= times;
    }
}

impl Message for Authority {}
impl Message for Steps {}
impl Message for Pose {}
impl Message for PoseFix {}
impl Message for Reference {}
impl Message for Wheels {}
