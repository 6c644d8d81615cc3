//! A sheet of paper for one plot: title, legend, axes.
//!
//! ```text
//!     title                                  the legend has a strip of its own, so it never lies
//!     ── estimate  ── truth  ● start         over a curve
//!   y ┌─────────────────────────┐
//!     │                         │            plotters rounds to whole pixels; everything is drawn
//!     └─────────────────────────┘            FINE times larger and the sheet is then shown at its
//!                 x                          size, so that curves are smooth
//! ```

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::io;
use std::ops::Range;

/// Sub-pixels to a pixel.
const FINE: i32 = 4;
/// Width of a sheet, pixels.
pub const WIDTH: i32 = 800;
/// Obstacles.
pub const STONE: RGBColor = RGBColor(140, 140, 140);
/// Left of the plot: axis description and labels, pixels.
pub const LEFT: i32 = 92;
/// Of it, air left of the axis description, which plotters would put half off the sheet.
const EDGE: i32 = 12;
/// Right of the plot, pixels.
pub const RIGHT: i32 = 32;
/// Under the plot, pixels.
pub const BOTTOM: i32 = 54;
/// Pixels of the title's line.
const TITLE: i32 = 40;
/// Pixels of a line of the legend.
const LEGEND: i32 = 22;

// The colours of Okabe and Ito: told apart with any kind of colour vision, and in grey.
/// Blue.
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
/// Orange.
pub const ORANGE: RGBColor = RGBColor(230, 159, 0);
/// Vermilion.
pub const VERMILION: RGBColor = RGBColor(213, 94, 0);
/// Bluish green.
pub const GREEN: RGBColor = RGBColor(0, 158, 115);
/// What is planned.
pub const DARK: RGBColor = RGBColor(70, 70, 70);
/// What stands back.
pub const LIGHT: RGBColor = RGBColor(170, 170, 170);
/// Blue that stands back, for many of a kind.
pub const FAINT_BLUE: RGBColor = RGBColor(166, 206, 227);
/// Orange that stands back.
pub const FAINT_ORANGE: RGBColor = RGBColor(246, 216, 160);
/// What stands farther back.
pub const PALE: RGBColor = RGBColor(205, 205, 205);

/// Text.
pub const INK: RGBColor = RGBColor(40, 40, 40);
const GRID: RGBColor = RGBColor(232, 232, 232);

/// A drawing area on a sheet.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A plot's axes.
pub type Axes<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
/// How drawing ends.
pub type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<io::Error>>;

/// A line of the legend.
#[derive(Clone, Debug)]
pub struct Key {
    /// What is drawn before the text.
    pub sample: Sample,
    /// What it means.
    pub text: String,
}

/// A sample of what is drawn.
#[derive(Clone, Copy, Debug)]
pub enum Sample {
    /// A line of this colour and width.
    Line(RGBColor, i32),
    /// A line with a waypoint on it.
    Waypoint(RGBColor),
    /// A circle.
    Ring(RGBColor),
    /// A band filled with a part of this colour.
    Band(RGBColor, f64),
    /// Where it starts.
    Start,
    /// Where it ends.
    End,
}

impl Key {
    /// A line of the legend.
    pub fn new(sample: Sample, text: impl Into<String>) -> Self {
        Self { sample, text: text.into() }
    }

    fn width(&self) -> i32 {
        34 + text_width(&self.text, 13) + 18
    }
}

/// Pixels to sub-pixels.
pub fn px(pixels: i32) -> i32 {
    pixels * FINE
}

/// Pixels a text takes at a font size, estimated for the wider of the common sans-serifs: which one
/// is used is known only where the picture is shown.
pub fn text_width(text: &str, size: i32) -> i32 {
    (text.chars().map(letter_width).sum::<f64>() * f64::from(size)).ceil() as i32
}

/// Width of a letter in units of the font size.
fn letter_width(letter: char) -> f64 {
    match letter {
        'i' | 'j' | 'l' | 'f' | 't' | 'r' | ' ' | '.' | ',' | ':' | ';' | '|' | '\'' | '-' | '(' | ')' => {
            0.38
        }
        'm' | 'w' | 'M' | 'W' | '@' | '%' | '…' => 1.0,
        'A'..='Z' => 0.72,
        _ if letter.is_ascii() => 0.63,
        // Letters of other scripts are up to a square wide.
        _ => 1.0,
    }
}

/// A line style.
pub fn line(color: RGBColor, pixels: i32) -> ShapeStyle {
    ShapeStyle { color: color.to_rgba(), filled: false, stroke_width: px(pixels) as u32 }
}

/// A text style; plotters writes 1/1.24 of the size it is given.
pub fn text_style<'a>(size: i32, color: RGBColor, h: HPos, v: VPos) -> TextStyle<'a> {
    let size = f64::from(px(size)) * 1.24;
    let mut style = TextStyle::from(("sans-serif", size).into_font()).pos(Pos::new(h, v));
    style.color = color.to_backend_color();
    style
}

/// Pixels above the plot for a legend.
pub fn top(legend: &[Key]) -> i32 {
    TITLE + LEGEND * legend_rows(legend).len() as i32 + 6
}

/// Draws a sheet `height` pixels high; `draw` gets what is left under title and legend.
pub fn sheet(
    height: i32,
    title: &str,
    legend: &[Key],
    draw: impl FnOnce(&Area<'_>) -> Drawn,
) -> io::Result<String> {
    let mut svg = String::new();
    let size = (px(WIDTH) as u32, px(height) as u32);
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let all = || -> Drawn {
            root.fill(&WHITE)?;
            let style = text_style(16, INK, HPos::Left, VPos::Center);
            root.draw_text(&fit(title, 16, WIDTH - 32), &style, (px(16), px(TITLE / 2)))?;
            draw_legend(&root, legend)
        };
        all()
            .and_then(|()| draw(&root.margin(px(top(legend)), 0, 0, 0)))
            .and_then(|()| root.present())
            .map_err(|error| io::Error::other(format!("cannot draw: {error}")))?;
    }
    // Shown at its size, drawn finer; round joints, or a noisy curve grows spikes.
    let fine = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    let shown =
        format!("width=\"{WIDTH}\" height=\"{height}\" stroke-linejoin=\"round\" stroke-linecap=\"round\"");
    Ok(svg.replacen(&fine, &shown, 1))
}

/// Axes over `x` and `y` with descriptions, filling `area`.
pub fn axes<'a, 'b>(
    area: &'a Area<'b>,
    (x, x_name): (Range<f64>, &str),
    (y, y_name): (Range<f64>, &str),
) -> Drawn<Axes<'a, 'b>> {
    let (_, height) = area.dim_in_pixel();
    let labels = (9, (height as i32 / px(55)).clamp(5, 12) as usize);
    let (x_decimals, y_decimals) = (decimals(&x, labels.0), decimals(&y, labels.1));
    let (write_x, write_y) = (|x: &f64| number(*x, x_decimals), |y: &f64| number(*y, y_decimals));
    labelled_axes(area, (x, x_name), (y, y_name), labels, (&write_x, &write_y))
}

/// Axes over powers of ten: `x` and `y` are whole exponents.
pub fn log_axes<'a, 'b>(
    area: &'a Area<'b>,
    (x, x_name): (Range<f64>, &str),
    (y, y_name): (Range<f64>, &str),
) -> Drawn<Axes<'a, 'b>> {
    let labels = [&x, &y].map(|range| (range.end - range.start) as usize + 1);
    let power = |exponent: &f64| format!("{}", 10f64.powi(exponent.round() as i32));
    labelled_axes(area, (x, x_name), (y, y_name), (labels[0], labels[1]), (&power, &power))
}

/// How a number on an axis is written.
type Label<'a> = &'a dyn Fn(&f64) -> String;

fn labelled_axes<'a, 'b>(
    area: &'a Area<'b>,
    (x, x_name): (Range<f64>, &str),
    (y, y_name): (Range<f64>, &str),
    (x_labels, y_labels): (usize, usize),
    (write_x, write_y): (Label<'_>, Label<'_>),
) -> Drawn<Axes<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .margin_left(px(EDGE))
        .margin_right(px(RIGHT))
        .x_label_area_size(px(BOTTOM))
        .y_label_area_size(px(LEFT - EDGE))
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .x_desc(x_name)
        .y_desc(y_name)
        .x_labels(x_labels)
        .y_labels(y_labels)
        .x_label_formatter(&write_x)
        .y_label_formatter(&write_y)
        .label_style(("sans-serif", f64::from(px(13)) * 1.24, &INK))
        .axis_desc_style(("sans-serif", f64::from(px(14)) * 1.24, &INK))
        .bold_line_style(line(GRID, 1))
        .light_line_style(TRANSPARENT)
        .axis_style(line(LIGHT, 1))
        .set_all_tick_mark_size(px(4))
        .draw()?;
    Ok(chart)
}

/// Decimals the labels of an axis need when it has at most `labels` of them: plotters puts them at
/// steps of 1, 2 or 5 times a power of ten.
fn decimals(range: &Range<f64>, labels: usize) -> usize {
    let least = (range.end - range.start) / labels as f64;
    let power = least.log10().floor();
    let carries = least / 10f64.powf(power) > 5.0;
    (-power - f64::from(u8::from(carries))).clamp(0.0, 9.0) as usize
}

fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let nothing = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if nothing { "0".to_owned() } else { text }
}

/// A text cut to a width, and without characters XML has no place for.
fn fit(text: &str, size: i32, width: i32) -> String {
    let clean: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text_width(&clean, size) <= width {
        return clean;
    }
    let mut cut = String::new();
    let mut room = f64::from(width) / f64::from(size) - letter_width('…');
    for letter in clean.chars() {
        room -= letter_width(letter);
        if room < 0.0 {
            break;
        }
        cut.push(letter);
    }
    cut.push('…');
    cut
}

fn legend_rows(legend: &[Key]) -> Vec<Vec<&Key>> {
    let mut rows: Vec<Vec<&Key>> = Vec::new();
    let mut used = WIDTH;
    for key in legend {
        if used + key.width() > WIDTH - 16 {
            rows.push(Vec::new());
            used = 16;
        }
        used += key.width();
        rows.last_mut().expect("just pushed").push(key);
    }
    rows
}

fn draw_legend(root: &Area<'_>, legend: &[Key]) -> Drawn {
    for (number, row) in legend_rows(legend).into_iter().enumerate() {
        let y = px(TITLE + LEGEND * number as i32 + LEGEND / 2);
        let mut x = 16;
        for key in row {
            let (from, middle, to) = ((px(x), y), (px(x + 13), y), (px(x + 26), y));
            match key.sample {
                Sample::Line(color, width) => root.draw(&PathElement::new([from, to], line(color, width)))?,
                Sample::Waypoint(color) => {
                    root.draw(&PathElement::new([from, to], line(color, 1)))?;
                    root.draw(&Circle::new(middle, px(3), color.filled()))?;
                }
                Sample::Ring(color) => root.draw(&Circle::new(middle, px(7), line(color, 1)))?,
                Sample::Band(color, part) => {
                    let corners = [(from.0, from.1 - px(6)), (to.0, to.1 + px(6))];
                    root.draw(&Rectangle::new(corners, color.mix(part).filled()))?;
                }
                Sample::Start => root.draw(&Circle::new(middle, px(5), GREEN.filled()))?,
                Sample::End => root.draw(&TriangleMarker::new(middle, px(7), VERMILION.filled()))?,
            }
            let style = text_style(13, INK, HPos::Left, VPos::Center);
            root.draw_text(&key.text, &style, (px(x + 34), y))?;
            x += key.width();
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axis_labels_have_the_decimals_they_need() {
        for (range, labels, want) in [
            (0.0..0.1, 9, 2),
            (0.0..1.0, 6, 1),
            (0.0..1.0, 12, 1),
            (0.0..35.0, 9, 0),
            (1e5..1e5 + 1e-3, 9, 4),
        ] {
            assert_eq!(decimals(&range, labels), want, "{range:?}");
        }
        assert_eq!([number(-0.0004, 2), number(-20.0, 0), number(0.125, 2)], ["0", "-20", "0.12"]);
    }

    #[test]
    fn long_titles_are_cut_to_the_sheet() {
        let long = "kanayama ".repeat(40);
        let cut = fit(&long, 16, 768);
        assert!(cut.ends_with('…') && cut.starts_with("kanayama") && text_width(&cut, 16) <= 769);
        assert_eq!(fit("a\tb", 16, 768), "a b");
    }
}
