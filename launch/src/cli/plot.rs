//! `hilare plot`: the pictures of a run that is over.

use super::{VerbResult, print, refused};
use crate::manager::Failure;
use crate::report::PastRun;
use crate::report::pictures::{PICTURES, Picture, SHEET};
use crate::report::raster::{Format, WIDTHS_PX, save};
use clap::{Args, ValueEnum};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Options of `hilare plot`.
#[derive(Args)]
pub struct PlotArgs {
    /// A run's directory, or a recording (.mcap)
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Pictures, separated by commas: path, cross-track, heading, speed, yaw-rate, estimate, late (recordings), sheet
    /// [default: all; into a file: sheet]
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',')]
    what: Vec<String>,
    /// Directory for the pictures, or a file (.svg, .png) for one of them [default: the run's directory;
    /// of a recording a directory of its name]
    #[arg(long, value_name = "DIR|FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    shape: ShapeArgs,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// What pictures are written as.
#[derive(Args)]
pub(super) struct ShapeArgs {
    /// svg or png [default: as the file is called, else svg]
    #[arg(long, value_name = "FORMAT")]
    format: Option<Format>,
    /// Width of the pictures, pixels [default: svg 800, png 1600]
    #[arg(long, value_name = "PX")]
    width: Option<u32>,
}

impl ShapeArgs {
    /// The width, if it can be drawn.
    pub(super) fn width_px(&self) -> Result<Option<u32>, Failure> {
        match self.width {
            Some(px) if !WIDTHS_PX.contains(&px) => {
                let (least, most) = (WIDTHS_PX.start(), WIDTHS_PX.end());
                Err(refused(format!("--width {px}: {least} to {most} pixels can be drawn")))
            }
            width => Ok(width),
        }
    }

    /// The format of files whose names are ours to choose.
    pub(super) fn format(&self) -> Format {
        self.format.unwrap_or(Format::Svg)
    }
}

/// Where pictures go.
enum Target {
    File(PathBuf, Format),
    Dir(PathBuf, Format),
}

impl Target {
    fn of(args: &PlotArgs) -> Result<Self, Failure> {
        let asked = args.shape.format;
        let Some(out) = &args.out else {
            // A recording lies among others; its pictures go into a directory of its name.
            let dir = if args.run.is_dir() { args.run.clone() } else { args.run.with_extension("") };
            return Ok(Self::Dir(dir, args.shape.format()));
        };
        let extension = out.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let is_word = !extension.is_empty() && extension.chars().all(|c| c.is_ascii_alphabetic());
        if out.is_dir() || !is_word {
            return Ok(Self::Dir(out.clone(), args.shape.format()));
        }
        let shown = out.display();
        let named = Format::from_str(extension, true).map_err(|_| {
            refused(format!(
                "--out {shown}: .{extension} cannot be drawn; .svg and .png can, or name a directory"
            ))
        })?;
        match asked {
            Some(asked) if asked != named => Err(refused(format!(
                "--out {shown}: --format {} contradicts its name; leave one away",
                asked.name()
            ))),
            _ => Ok(Self::File(out.clone(), named)),
        }
    }
}

/// Draws the pictures of a run.
pub fn plot(args: &PlotArgs) -> VerbResult {
    let chosen = args.what.iter().map(|name| find(name.trim())).collect::<Result<Vec<_>, _>>()?;
    let width_px = args.shape.width_px()?;
    let target = Target::of(args)?;
    if let Target::File(file, _) = &target
        && chosen.len() > 1
    {
        return Err(refused(format!(
            "--out {}: one file, but {} pictures; name a directory",
            file.display(),
            chosen.len()
        )));
    }
    let run = PastRun::open(&args.run).map_err(refused)?;
    let title = run.title();
    let input = run.plot_input(&title);
    if let Some(picture) = chosen.iter().find(|picture| !picture.can_be_drawn(&input)) {
        let place = args.run.display();
        return Err(refused(format!("--what {}: {place} has no recording of every tick", picture.name)));
    }
    let chosen: Vec<&Picture> = match (&target, chosen.is_empty()) {
        (Target::File(..), true) => vec![SHEET],
        (Target::Dir(..), true) => PICTURES.iter().filter(|picture| picture.can_be_drawn(&input)).collect(),
        (_, false) => chosen,
    };
    let mut written = Vec::new();
    for picture in chosen {
        let (file, format) = match &target {
            Target::File(file, format) => (file.clone(), *format),
            Target::Dir(dir, format) => {
                make(dir)?;
                (dir.join(format!("{}.{}", picture.file, format.name())), *format)
            }
        };
        let svg =
            picture.svg(&input, Some(&run.summary)).map_err(|error| Failure::Fault(error.to_string()))?;
        save(&file, &svg, format, width_px)
            .map_err(|error| refused(format!("{error}; choose another place with --out")))?;
        written.push((picture, file));
    }
    if args.json {
        let files: Vec<_> = written
            .iter()
            .map(|(picture, file)| json!({"what": picture.name, "shows": picture.about, "file": file}))
            .collect();
        print(&format!(
            "{:#}\n",
            json!({"run": args.run, "title": title, "written": files, "lacking": run.lacking})
        ));
    } else {
        for (picture, file) in &written {
            print(&format!("{:<13}{:<28}{}\n", picture.name, picture.about, file.display()));
        }
        for lacking in &run.lacking {
            print(&format!("{lacking}\n"));
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn find(name: &str) -> Result<&'static Picture, Failure> {
    PICTURES.iter().find(|picture| picture.name == name).ok_or_else(|| {
        let known: Vec<&str> = PICTURES.iter().map(|picture| picture.name).collect();
        refused(format!("--what: unknown picture {name:?}; known: {}", known.join(", ")))
    })
}

fn make(dir: &Path) -> Result<(), Failure> {
    fs::create_dir_all(if dir.as_os_str().is_empty() { Path::new(".") } else { dir }).map_err(|error| {
        refused(format!("--out {}: {error}; choose a directory you can write", dir.display()))
    })
}
