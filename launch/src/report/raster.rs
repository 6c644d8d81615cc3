//! Pictures as PNG: the SVG itself, rendered with a font of our own, so that a machine without fonts draws the
//! same.

use super::compose::shown_at;
use crate::whole::write_whole;
use clap::ValueEnum;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};
use std::io;
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// DejaVu Sans, cut down to Latin, Greek, Cyrillic and what formulas need; its licence lies beside it.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Least and greatest width of a picture, pixels; at the greatest the tallest takes 200 MB while it is drawn.
pub const WIDTHS_PX: std::ops::RangeInclusive<u32> = 100..=4000;

/// Width of a PNG of which none was asked, pixels: twice that of the SVG, for paper and fine screens.
const PNG_WIDTH_PX: u32 = 1600;

/// What a picture is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Lines and letters, of any size.
    Svg,
    /// Pixels.
    Png,
}

impl Format {
    /// Its name and its files' extension.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }
}

/// Writes one of our pictures whole or not at all, `width_px` wide or as wide as is usual. An error is one line that
/// names the path and the reason.
pub fn save(path: &Path, svg: &str, format: Format, width_px: Option<u32>) -> io::Result<()> {
    match (format, width_px) {
        (Format::Svg, None) => write_whole(path, svg.as_bytes()),
        (Format::Svg, Some(width_px)) => write_whole(path, shown_at(svg, width_px).as_bytes()),
        (Format::Png, width_px) => write_whole(path, &png(svg, width_px.unwrap_or(PNG_WIDTH_PX))?),
    }
}

fn fonts() -> Arc<Database> {
    static FONTS: OnceLock<Arc<Database>> = OnceLock::new();
    let load = || {
        let mut fonts = Database::new();
        fonts.load_font_source(Source::Binary(Arc::new(FONT)));
        fonts.set_sans_serif_family(FAMILY);
        Arc::new(fonts)
    };
    Arc::clone(FONTS.get_or_init(load))
}

/// Renders one of our pictures `width_px` pixels wide, as high as its shape asks.
pub fn png(svg: &str, width_px: u32) -> io::Result<Vec<u8>> {
    let failed = |what: String| io::Error::other(format!("cannot render: {what}"));
    let options = Options { fontdb: fonts(), font_family: FAMILY.to_owned(), ..Options::default() };
    let tree = Tree::from_str(svg, &options).map_err(|error| failed(error.to_string()))?;
    let size = tree.size();
    let scale = width_px as f32 / size.width();
    let height_px = (size.height() * scale).round().max(1.0) as u32;
    let mut pixels = Pixmap::new(width_px, height_px)
        .ok_or_else(|| failed(format!("{width_px} x {height_px} pixels are too many")))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| failed(error.to_string()))
}
