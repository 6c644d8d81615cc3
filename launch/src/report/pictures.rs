//! The pictures there are of a run, and all of them on one sheet.

use super::compose::{stacked, text_sheet};
use super::moments::{cross_track_svg, estimate_svg, heading_svg, mishaps_svg, speed_svg, yaw_rate_svg};
use super::plots::{PlotInput, path_svg};
use super::timeline::HEIGHT;
use super::{Summary, make_dir};
use crate::whole::write_whole;
use std::io;
use std::path::{Path, PathBuf};

/// Height of a picture over time on the sheet, pixels.
const PANEL: i32 = 250;

/// One picture of a run.
pub struct Picture {
    /// What it is called on the command line.
    pub name: &'static str,
    /// Its file, without extension.
    pub file: &'static str,
    /// What it shows.
    pub about: &'static str,
    /// `hilare run` draws it.
    pub by_run: bool,
    /// Only a recording of every tick has what it shows.
    pub from_recording: bool,
    draw: Draw,
}

enum Draw {
    /// In the plane.
    Plane(fn(&PlotInput<'_>) -> io::Result<String>),
    /// Over time, so high.
    Time(fn(&PlotInput<'_>, i32) -> io::Result<String>),
    /// All of them.
    Sheet,
}

const fn picture(name: &'static str, file: &'static str, about: &'static str, draw: Draw) -> Picture {
    Picture { name, file, about, by_run: false, from_recording: false, draw }
}

/// Every picture, in the order they stand on the sheet.
pub const PICTURES: [Picture; 8] = [
    Picture { by_run: true, ..picture("path", "path", "where it went", Draw::Plane(path_svg)) },
    Picture {
        by_run: true,
        ..picture("cross-track", "cross_track", "distance to the path", Draw::Time(cross_track_svg))
    },
    picture("heading", "heading", "heading less the path's", Draw::Time(heading_svg)),
    Picture { by_run: true, ..picture("speed", "speed", "commanded and true speed", Draw::Time(speed_svg)) },
    picture("yaw-rate", "yaw_rate", "commanded and true yaw rate", Draw::Time(yaw_rate_svg)),
    picture("estimate", "estimate", "estimate off truth", Draw::Time(estimate_svg)),
    Picture {
        from_recording: true,
        ..picture("late", "late", "late ticks and commands", Draw::Time(mishaps_svg))
    },
    picture("sheet", "sheet", "all of them on one sheet", Draw::Sheet),
];

/// The sheet, which is what a picture without a name is.
pub const SHEET: &Picture = &PICTURES[7];

impl Picture {
    /// What is known suffices for it.
    pub fn can_be_drawn(&self, input: &PlotInput<'_>) -> bool {
        !self.from_recording || !input.mishaps.is_empty()
    }

    /// As SVG.
    pub fn svg(&self, input: &PlotInput<'_>, summary: Option<&Summary>) -> io::Result<String> {
        match self.draw {
            Draw::Plane(draw) => draw(input),
            Draw::Time(draw) => draw(input, HEIGHT),
            Draw::Sheet => sheet_svg(input, summary),
        }
    }
}

/// Writes the pictures every run has, as SVG, into `dir`, which is made if need be, and returns their paths. Values
/// that are not finite are left out. An error is one line that names the path and the reason.
pub fn write_plots(dir: &Path, input: &PlotInput<'_>) -> io::Result<Vec<PathBuf>> {
    make_dir(dir)?;
    let of_run = PICTURES.iter().filter(|picture| picture.by_run);
    let write = |picture: &Picture| {
        let path = dir.join(format!("{}.svg", picture.file));
        write_whole(&path, picture.svg(input, None)?.as_bytes())?;
        Ok(path)
    };
    of_run.map(write).collect()
}

fn sheet_svg(input: &PlotInput<'_>, summary: Option<&Summary>) -> io::Result<String> {
    let lines = summary.map(figures).unwrap_or_default();
    let mut parts = vec![text_sheet(input.title, &lines)?];
    // The sheet says once what ran.
    let untitled = PlotInput { title: "", ..*input };
    for picture in PICTURES.iter().filter(|picture| picture.can_be_drawn(input)) {
        match picture.draw {
            Draw::Plane(draw) => parts.push(draw(&untitled)?),
            Draw::Time(draw) => parts.push(draw(&untitled, PANEL)?),
            Draw::Sheet => {}
        }
    }
    Ok(stacked(&parts))
}

/// What a run came to, in lines.
fn figures(summary: &Summary) -> Vec<String> {
    let mm = |metres: f64| metres * 1e3;
    let ended = if summary.reached { "arrived" } else { "not arrived" };
    let late = &summary.lateness_us;
    let mut lines = vec![
        format!(
            "{ended} after {:.3} s; cross-track mean {:.2} mm, max {:.2} mm; speed error mean {:.2} mm/s",
            summary.duration_s,
            mm(summary.cross_track_mean_m),
            mm(summary.cross_track_max_m),
            mm(summary.speed_error_mean_mps)
        ),
        format!(
            "{} ticks late, {} lost to pauses (longest {}); {} commands late, {} rejected, {} cycles without a command",
            summary.ticks_late,
            summary.paused_ticks,
            summary.paused_max_ticks,
            summary.commands_late,
            summary.commands_rejected,
            summary.cycles_without_command
        ),
    ];
    let timed = late.max > 0.0;
    let lateness = format!(
        "lateness p50 {:.1} us, p99 {:.1} us, p99.9 {:.1} us, max {:.1} us; ",
        late.p50, late.p99, late.p99_9, late.max
    );
    lines.push(format!("{}state {}", if timed { &lateness } else { "" }, summary.state_hash));
    lines
}
