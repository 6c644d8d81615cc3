//! Pictures as PNG: the SVG itself, rendered with a font of our own, so that a machine without fonts draws the
//! same.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};
use std::io;
use std::sync::{Arc, OnceLock};

/// DejaVu Sans, cut down to Latin, Greek, Cyrillic and what formulas need; its licence lies beside it.
const FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Least and greatest width of a picture, pixels; at the greatest the tallest takes 200 MB while it is drawn.
pub const WIDTHS_PX: std::ops::RangeInclusive<u32> = 100..=4000;

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
