//! Pictures put together and shown at another size. Works on pictures of [`super::canvas`], whose first tag says
//! `width` and `height` in pixels.

use super::canvas::{BOTTOM, INK, WIDTH, px, sheet, text_style, top};
use plotters::style::text_anchor::{HPos, VPos};
use std::io;

/// Pixels of a line of text.
const LINE: i32 = 21;

/// Title and lines of text.
pub(super) fn text_sheet(title: &str, lines: &[String]) -> io::Result<String> {
    let height = top(&[]) + LINE * lines.len() as i32;
    sheet(height, title, &[], |area| {
        for (n, text) in lines.iter().enumerate() {
            let style = text_style(13, INK, HPos::Left, VPos::Center);
            area.draw_text(text, &style, (px(16), px(LINE * n as i32 + LINE / 2)))?;
        }
        Ok(())
    })
}

/// Pictures of the usual width below each other.
pub(super) fn stacked(pictures: &[String]) -> String {
    let mut inner = String::new();
    let mut y = 0;
    for picture in pictures {
        inner.push_str(&picture.replacen("<svg ", &format!("<svg y=\"{y}\" "), 1));
        y += attribute(picture, "height").unwrap_or(BOTTOM);
    }
    format!(
        "<svg width=\"{WIDTH}\" height=\"{y}\" viewBox=\"0 0 {WIDTH} {y}\" xmlns=\"http://www.w3.org/2000/svg\">\n{inner}</svg>\n"
    )
}

/// The same picture shown `width_px` wide.
pub fn shown_at(picture: &str, width_px: u32) -> String {
    let Some((width, height)) = attribute(picture, "width").zip(attribute(picture, "height")) else {
        return picture.to_owned();
    };
    let height_px = (f64::from(height) * f64::from(width_px) / f64::from(width)).round();
    let size = format!("width=\"{width}\" height=\"{height}\"");
    picture.replacen(&size, &format!("width=\"{width_px}\" height=\"{height_px}\""), 1)
}

/// A number in the first tag.
fn attribute(picture: &str, name: &str) -> Option<i32> {
    let (tag, _) = picture.split_once('>')?;
    let (_, value) = tag.split_once(&format!(" {name}=\""))?;
    value.split_once('"')?.0.parse().ok()
}
