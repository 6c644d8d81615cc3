//! The text that Prometheus reads.

use hilare_interfaces::latency::{LatencyHistogram, upper_edge_ns};
use std::fmt::Write;

/// Least and greatest bound of a histogram's buckets, as powers of two of a nanosecond: 1 µs to 0.13 s.
const BOUNDS: std::ops::RangeInclusive<u32> = 10..=27;

/// Which of the two texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Prometheus text format 0.0.4.
    Prometheus,
    /// OpenMetrics 1.0.
    OpenMetrics,
}

impl Format {
    /// The one that a reader takes.
    pub fn accepted(accept: &str) -> Self {
        if accept.contains("application/openmetrics-text") { Self::OpenMetrics } else { Self::Prometheus }
    }

    /// Its media type.
    pub const fn content_type(self) -> &'static str {
        match self {
            Self::Prometheus => "text/plain; version=0.0.4; charset=utf-8",
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
        }
    }
}

/// What a family's samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Only goes up; `_total` is put behind its name.
    Counter,
    Gauge,
    Histogram,
}

/// Names and values.
pub(super) type Labels<'l> = [(&'static str, &'l str)];

/// A text under way.
pub(super) struct Text {
    format: Format,
    text: String,
    /// Name that the samples of the family under way have.
    name: String,
}

impl Text {
    pub(super) fn new(format: Format) -> Self {
        Self { format, text: String::with_capacity(32 << 10), name: String::new() }
    }

    /// Begins a family; `name` without `_total`.
    pub(super) fn family(&mut self, name: &str, kind: Kind, help: &str) {
        let (type_name, suffix) = match kind {
            Kind::Counter => ("counter", "_total"),
            Kind::Gauge => ("gauge", ""),
            Kind::Histogram => ("histogram", ""),
        };
        self.name = format!("{name}{suffix}");
        let family = if self.format == Format::OpenMetrics { name } else { &self.name };
        let _ = writeln!(self.text, "# HELP {family} {help}\n# TYPE {family} {type_name}");
    }

    pub(super) fn sample(&mut self, labels: &Labels<'_>, value: f64) {
        self.line("", labels, None, value);
    }

    /// A family of one sample.
    pub(super) fn single(&mut self, name: &str, kind: Kind, help: &str, labels: &Labels<'_>, value: f64) {
        self.family(name, kind, help);
        self.sample(labels, value);
    }

    /// The bounds fall together with edges of the histogram's own buckets, so that no sample is on the wrong side by
    /// more than a nanosecond.
    pub(super) fn histogram(&mut self, labels: &Labels<'_>, histogram: &LatencyHistogram) {
        let edges = (0_u64..).map(upper_edge_ns);
        let mut buckets = histogram.buckets.iter().zip(edges).peekable();
        let (mut below, mut sum_ns) = (0_u64, 0.0);
        let mut before_ns = 0;
        let mut take = |up_to_ns: u64, below: &mut u64| {
            while let Some((samples, edge_ns)) = buckets.next_if(|(_, edge_ns)| *edge_ns <= up_to_ns) {
                *below = below.saturating_add(*samples);
                sum_ns += *samples as f64 * (before_ns + edge_ns) as f64 / 2.0;
                before_ns = edge_ns;
            }
            sum_ns
        };
        for power in BOUNDS {
            let bound_ns = 1_u64 << power;
            take(bound_ns, &mut below);
            let bound = format!("{}", bound_ns as f64 / 1e9);
            self.line("_bucket", labels, Some(&bound), below as f64);
        }
        let sum_ns = take(u64::MAX, &mut below);
        self.line("_bucket", labels, Some("+Inf"), below as f64);
        self.line("_sum", labels, None, sum_ns / 1e9);
        self.line("_count", labels, None, below as f64);
    }

    fn line(&mut self, suffix: &str, labels: &Labels<'_>, bound: Option<&str>, value: f64) {
        let _ = write!(self.text, "{}{suffix}", self.name);
        let bound = bound.map(|bound| ("le", bound));
        for (n, (name, value)) in labels.iter().copied().chain(bound).enumerate() {
            let _ = write!(self.text, "{}{name}=\"{}\"", if n == 0 { '{' } else { ',' }, escaped(value));
        }
        if !labels.is_empty() || bound.is_some() {
            self.text.push('}');
        }
        let _ = match value {
            f64::INFINITY => writeln!(self.text, " +Inf"),
            f64::NEG_INFINITY => writeln!(self.text, " -Inf"),
            value => writeln!(self.text, " {value}"),
        };
    }

    pub(super) fn end(mut self) -> String {
        if self.format == Format::OpenMetrics {
            self.text.push_str("# EOF\n");
        }
        self.text
    }
}

/// A label's value; a line ends nowhere else than at its end.
fn escaped(value: &str) -> String {
    let shown =
        value.chars().map(|c| if c.is_control() && c != '\n' { char::REPLACEMENT_CHARACTER } else { c });
    shown.collect::<String>().replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}
