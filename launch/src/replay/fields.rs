//! Where two messages differ, field by field, bit by bit.

use hilare_interfaces::block::Tick;
use hilare_interfaces::layout::{Field, Layout, WireMessage};
use serde::Serialize;

/// A field of a message that is not the recorded one's.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// Tick the message is of.
    pub tick: Tick,
    /// Which field: `x_m`, `counts[1]`, `current.x_m`.
    pub field: String,
    /// What the recording says.
    pub recorded: String,
    /// What the replay says.
    pub replayed: String,
    /// The bits of the recorded value, in hex; of text none.
    pub recorded_bits: String,
    /// The bits of the replayed value.
    pub replayed_bits: String,
}

impl Difference {
    /// One of words, not of a field's values.
    pub fn of_words(
        tick: Tick,
        field: &str,
        recorded: impl Into<String>,
        replayed: impl Into<String>,
    ) -> Self {
        Self {
            tick,
            field: field.to_owned(),
            recorded: recorded.into(),
            replayed: replayed.into(),
            recorded_bits: String::new(),
            replayed_bits: String::new(),
        }
    }

    /// In a line.
    pub fn in_words(&self) -> String {
        let said = |value: &str, bits: &str| match bits {
            "" => value.to_owned(),
            bits => format!("{value} ({bits})"),
        };
        format!(
            "tick {}, {}: recorded {}, replayed {}",
            self.tick,
            self.field,
            said(&self.recorded, &self.recorded_bits),
            said(&self.replayed, &self.replayed_bits)
        )
    }
}

/// True if two messages are the same bits.
pub fn same<M: WireMessage>(a: &M, b: &M) -> bool {
    a.as_bytes() == b.as_bytes()
}

/// The first field in which `replayed` differs from `recorded`.
pub fn first_difference<M: WireMessage>(tick: Tick, recorded: &M, replayed: &M) -> Option<Difference> {
    in_layout(tick, &M::LAYOUT, "", recorded.as_bytes(), replayed.as_bytes())
}

fn in_layout(tick: Tick, layout: &Layout, prefix: &str, a: &[u8], b: &[u8]) -> Option<Difference> {
    layout.fields.iter().find_map(|field| {
        let (a, b) = (&a[field.offset..], &b[field.offset..]);
        in_field(tick, field, prefix, a, b)
    })
}

fn in_field(tick: Tick, field: &Field, prefix: &str, a: &[u8], b: &[u8]) -> Option<Difference> {
    let name = |i: usize| match field.len {
        1 => format!("{prefix}{}", field.name),
        _ => format!("{prefix}{}[{i}]", field.name),
    };
    if field.type_name == "u8" {
        let (a, b) = (&a[..field.len], &b[..field.len]);
        return (a != b).then(|| Difference::of_words(tick, field.name, text(a), text(b)));
    }
    let size = field.nested.map_or(8, |nested| nested.size);
    let pairs = a.chunks_exact(size).zip(b.chunks_exact(size)).take(field.len).enumerate();
    pairs.filter(|(_, (a, b))| a != b).find_map(|(i, (a, b))| match field.nested {
        Some(nested) => in_layout(tick, nested, &format!("{}.", name(i)), a, b),
        None => Some(Difference {
            tick,
            field: name(i),
            recorded: scalar(field.type_name, a),
            replayed: scalar(field.type_name, b),
            recorded_bits: format!("{:#018x}", word(a)),
            replayed_bits: format!("{:#018x}", word(b)),
        }),
    })
}

fn text(bytes: &[u8]) -> String {
    let text = bytes.split(|byte| *byte == 0).next().unwrap_or(bytes);
    format!("{:?}", String::from_utf8_lossy(text))
}

fn word(bytes: &[u8]) -> u64 {
    bytes.try_into().map_or(0, u64::from_ne_bytes)
}

fn scalar(type_name: &str, bytes: &[u8]) -> String {
    match type_name {
        "f64" => f64::from_bits(word(bytes)).to_string(),
        "i64" => word(bytes).cast_signed().to_string(),
        _ => word(bytes).to_string(),
    }
}

/// How far the numbers of a wire's messages are from the recorded ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Deviation {
    /// Which field.
    pub field: String,
    /// Root mean square.
    pub rms: f64,
    /// Greatest.
    pub max: f64,
}

/// Sums for [`Deviation`]s of every real number of a message; those inside another message are left out.
#[derive(Clone, Debug, Default)]
pub struct Deviations {
    sums: Vec<(f64, f64)>,
    count: u64,
}

impl Deviations {
    /// Takes in a message and what was recorded in its place.
    pub fn add<M: WireMessage>(&mut self, recorded: &M, replayed: &M) {
        let (a, b) = (recorded.as_bytes(), replayed.as_bytes());
        let offsets = reals(&M::LAYOUT).map(|(_, offset)| offset);
        let differences = offsets.map(|at| number(b, at) - number(a, at)).map(f64::abs);
        let mut sums = std::mem::take(&mut self.sums).into_iter();
        self.sums = differences
            .map(|off| {
                let (squares, max) = sums.next().unwrap_or_default();
                // Of a number and none there is no distance.
                if off.is_nan() { (squares, max) } else { (squares + off * off, max.max(off)) }
            })
            .collect();
        self.count += 1;
    }

    /// What they come to.
    pub fn of<M: WireMessage>(&self) -> Vec<Deviation> {
        let mean = |squares: f64| (squares / self.count.max(1) as f64).sqrt();
        let named = reals(&M::LAYOUT).zip(&self.sums);
        named
            .map(|((field, _), (squares, max))| Deviation { field, rms: mean(*squares), max: *max })
            .collect()
    }
}

/// Name and offset of the real numbers of a message.
fn reals(layout: &Layout) -> impl Iterator<Item = (String, usize)> {
    let fields = layout.fields.iter().filter(|field| field.type_name == "f64");
    fields.flat_map(|field| {
        (0..field.len).map(move |i| {
            let name = if field.len == 1 { field.name.to_owned() } else { format!("{}[{i}]", field.name) };
            (name, field.offset + 8 * i)
        })
    })
}

fn number(bytes: &[u8], at: usize) -> f64 {
    f64::from_bits(word(&bytes[at..at + 8]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;
    use hilare_interfaces::messages::{Answer, Pose, Reference, Steps, text_field};

    #[test]
    fn the_first_field_is_named_with_values_and_bits() {
        let pose = Pose { tick: 7, x_m: 0.5, ..Pose::ZERO };
        assert_eq!(first_difference(7, &pose, &pose), None);
        let other = Pose { x_m: f64::from_bits(0.5_f64.to_bits() + 1), theta_rad: 1.0, ..pose };
        let found = first_difference(7, &pose, &other).unwrap();
        assert_eq!((found.tick, &*found.field, &*found.recorded), (7, "x_m", "0.5"));
        assert_eq!(found.recorded_bits, "0x3fe0000000000000");
        assert_eq!(found.replayed_bits, "0x3fe0000000000001");
        // Two zeros are the same number and not the same bits.
        assert_eq!(first_difference(7, &pose, &Pose { y_m: -0.0, ..pose }).unwrap().field, "y_m");
    }

    #[test]
    fn what_lies_inside_has_its_whole_name() {
        let mut reference = Reference::ZERO;
        reference.preview[3].bulge = 1.0;
        let found = first_difference(0, &Reference::ZERO, &reference).unwrap();
        assert_eq!(found.field, "preview[3].bulge");
        let steps = Steps { counts: [0, -5, 0, 0], ..Steps::ZERO };
        let found = first_difference(0, &Steps::ZERO, &steps).unwrap();
        assert_eq!((&*found.field, &*found.replayed), ("counts[1]", "-5"));
        let answer = Answer { text: text_field("no"), ..Answer::ZERO };
        let found = first_difference(0, &answer, &Answer::ZERO).unwrap();
        assert_eq!((&*found.field, &*found.recorded, &*found.replayed), ("text", "\"no\"", "\"\""));
    }

    #[test]
    fn deviations_are_those_of_each_number() {
        let mut deviations = Deviations::default();
        for (tick, x_m) in [(1, 3.0), (2, 4.0)] {
            let pose = Pose { tick, ..Pose::ZERO };
            deviations.add(&pose, &Pose { x_m, theta_rad: f64::NAN, ..pose });
        }
        let of = deviations.of::<Pose>();
        assert_eq!(of.iter().map(|d| &*d.field).collect::<Vec<_>>(), ["x_m", "y_m", "theta_rad"]);
        assert_eq!((of[0].max, of[0].rms, of[1].max, of[2].max), (4.0, 12.5_f64.sqrt(), 0.0, 0.0));
    }
}
