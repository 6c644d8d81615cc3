//! `hilare plot`, and `hilare compare` of runs that are over: what was drawn is drawn again, SVG and PNG agree, bad input
//! is one line.

mod support;

use serde_json::Value;
use std::fs;
use std::path::Path;
use support::{Lab, text};

const DRAWN_BY_RUN: [&str; 3] = ["path.svg", "speed.svg", "cross_track.svg"];

fn run(lab: &Lab, out: &str, args: &[&str]) {
    lab.hilare(&[&["run", "--clock", "in-process", "--out", out], args].concat()).expect_code(0);
}

/// Exit code 2 and one line that says all of `parts`.
fn refused(lab: &Lab, args: &[&str], parts: &[&str]) {
    let ended = lab.hilare(args).expect_code(2);
    assert_eq!(ended.stderr.lines().count(), 1, "{args:?}: {}", ended.stderr);
    for part in parts {
        assert!(ended.stderr.contains(part), "{args:?}: {part:?} is not in {}", ended.stderr);
    }
}

#[test]
fn what_the_run_has_drawn_is_drawn_again_to_the_byte() {
    let lab = Lab::new();
    // An arc driven sideways, obstacles, noise, a path of the user's in lockstep.
    run(&lab, "agv", &["agv-course"]);
    run(&lab, "platform", &["platform"]);
    run(&lab, "slip", &["rectangle-open", "--set", "plant.slip_sd=0.1", "--seed", "3", "--controller", "qp"]);
    let (path, robot) = (lab.straight(0.1), lab.robot());
    let args =
        ["run", "--path", &path.to_string_lossy(), "--clock", "lockstep", "--robot", &robot, "--out", "own"];
    lab.hilare(&args).expect_code(0);
    for dir in ["agv", "platform", "slip", "own"] {
        let read = |file: &str| fs::read(lab.dir().join(dir).join(file)).expect("a picture of the run");
        let before = DRAWN_BY_RUN.map(read);
        for file in DRAWN_BY_RUN {
            fs::remove_file(lab.dir().join(dir).join(file)).expect("it was there");
        }
        lab.hilare(&["plot", dir]).expect_code(0);
        assert!(DRAWN_BY_RUN.map(read) == before, "{dir}: another picture than the run's own");
        for file in ["heading.svg", "yaw_rate.svg", "estimate.svg", "late.svg", "sheet.svg"] {
            let svg = String::from_utf8(read(file)).expect("text");
            assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"), "{dir}/{file}");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{dir}/{file}");
        }
        // The recording alone gives the same.
        lab.hilare(&["plot", &format!("{dir}/run.mcap"), "--out", "alone"]).expect_code(0);
        let alone = DRAWN_BY_RUN.map(|file| fs::read(lab.dir().join("alone").join(file)).expect("a picture"));
        assert!(alone == before, "{dir}: another picture of the recording than the run's own");
        // Chosen ones only, somewhere else.
        lab.hilare(&["plot", dir, "--what", "path,speed", "--out", "elsewhere"]).expect_code(0);
        let elsewhere = lab.dir().join("elsewhere");
        assert_eq!(fs::read_dir(&elsewhere).expect("it was made").count(), 2);
        assert!(fs::read(elsewhere.join("path.svg")).expect("a picture") == before[0]);
    }
}

/// A PNG as rows of RGB.
struct Pixels {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl Pixels {
    fn read(path: &Path) -> Self {
        let file = std::io::BufReader::new(fs::File::open(path).expect("a picture"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        let mut bytes = vec![0; reader.output_buffer_size().expect("it fits")];
        let info = reader.next_frame(&mut bytes).expect("whole");
        let samples = info.color_type.samples();
        assert!(samples >= 3 && info.bit_depth == png::BitDepth::Eight, "{:?}", info.color_type);
        let rgb = bytes.chunks(samples).flat_map(|pixel| pixel[..3].to_vec()).collect();
        Self { width: info.width as usize, height: info.height as usize, rgb }
    }

    fn at(&self, x: f64, y: f64) -> [u8; 3] {
        let at = 3 * (y as usize * self.width + x as usize);
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    fn count(&self, color: [u8; 3]) -> usize {
        self.rgb.chunks(3).filter(|pixel| **pixel == color).count()
    }

    /// Dark pixels in a part of the picture, from and to as parts of its width and in pixels of its height.
    fn ink(&self, x: std::ops::Range<usize>, y: std::ops::Range<usize>) -> usize {
        y.flat_map(|y| x.clone().map(move |x| (x, y)))
            .filter(|(x, y)| self.at(*x as f64, *y as f64).iter().all(|part| *part < 110))
            .count()
    }
}

/// The number of an attribute in a tag.
fn attribute(tag: &str, name: &str) -> f64 {
    let value = tag.split_once(&format!(" {name}=\"")).and_then(|(_, rest)| rest.split_once('"'));
    value.and_then(|(value, _)| value.parse().ok()).unwrap_or_else(|| panic!("no {name} in {tag}"))
}

#[test]
fn svg_and_png_agree() {
    let lab = Lab::new();
    run(&lab, "run", &["rectangle-open"]);
    lab.hilare(&["plot", "run"]).expect_code(0);
    lab.hilare(&["plot", "run", "--format", "png", "--width", "1000"]).expect_code(0);
    let dir = lab.dir().join("run");
    for name in ["path", "cross_track", "heading", "speed", "yaw_rate", "estimate", "sheet"] {
        let svg = fs::read_to_string(dir.join(format!("{name}.svg"))).expect("a picture");
        let pixels = Pixels::read(&dir.join(format!("{name}.png")));
        let (tag, _) = svg.split_once('>').expect("a tag");
        let scale = 1000.0 / attribute(tag, "width");
        assert_eq!(pixels.width, 1000, "{name}");
        assert_eq!(pixels.height, (attribute(tag, "height") * scale).round() as usize, "{name}");
        assert_eq!(pixels.at(0.0, 0.0), [255; 3], "{name}: paper");
        assert!(pixels.count([0, 114, 178]) > 300, "{name}: the blue curve");
        // Letters are there though no font of the system was asked for: the title.
        assert!(pixels.ink(16..120, 8..40) > 100, "{name}: the title");
    }
    // The start, a green circle, lies where the SVG says; of the legend's and the path's the last is the path's.
    let svg = fs::read_to_string(dir.join("path.svg")).expect("a picture");
    let pixels = Pixels::read(&dir.join("path.png"));
    let start =
        svg.lines().rfind(|line| line.starts_with("<circle") && line.contains("#009E73")).expect("a start");
    let (tag, _) = svg.split_once('>').expect("a tag");
    let (_, view) = tag.split_once("viewBox=\"0 0 ").expect("a view");
    let fine: f64 = view.split(' ').next().and_then(|width| width.parse().ok()).expect("its width");
    let scale = 1000.0 / fine;
    assert_eq!(pixels.at(attribute(start, "cx") * scale, attribute(start, "cy") * scale), [0, 158, 115]);
    // As wide as asked, both.
    lab.hilare(&["plot", "run", "--what", "path", "--width", "640", "--out", "small.svg"]).expect_code(0);
    lab.hilare(&["plot", "run", "--what", "path", "--width", "640", "--out", "small.png"]).expect_code(0);
    let small = fs::read_to_string(lab.dir().join("small.svg")).expect("a picture");
    let pixels = Pixels::read(&lab.dir().join("small.png"));
    assert_eq!(attribute(&small, "width") as usize, pixels.width);
    assert_eq!(attribute(&small, "height") as usize, pixels.height);
    assert_eq!(small.split_once("viewBox").map(|part| part.1), svg.split_once("viewBox").map(|part| part.1));
}

#[test]
fn the_written_files_are_told_as_json() {
    let lab = Lab::new();
    run(&lab, "run", &["rectangle-open"]);
    fs::remove_file(lab.dir().join("run/path.csv")).expect("it was there");
    let ended = lab.hilare(&["plot", "run", "--out", "a.png", "--json"]).expect_code(0);
    let told: Value = serde_json::from_str(&ended.stdout).expect("JSON and nothing else");
    assert_eq!((text(&told["written"][0], "what"), text(&told["written"][0], "file")), ("sheet", "a.png"));
    assert!(told["lacking"][0].as_str().is_some_and(|what| what.contains("no path.csv")), "{told}");
}

#[test]
fn what_cannot_be_drawn_is_one_line() {
    let lab = Lab::new();
    run(&lab, "run", &["rectangle-open"]);
    let dir = lab.dir().join("run");
    let whole = fs::read_to_string(dir.join("trace.csv")).expect("a trace");
    lab.file("file.txt", "nothing");
    lab.file("empty.mcap", "");
    lab.file("foreign.mcap", "no recording at all");
    fs::create_dir(lab.dir().join("other")).expect("a directory");
    refused(&lab, &["plot", "nowhere"], &["nowhere", "no such run"]);
    refused(&lab, &["plot", "nowhere.mcap"], &["nowhere.mcap"]);
    refused(&lab, &["plot", "file.txt"], &["file.txt", "not a run"]);
    refused(&lab, &["plot", "empty.mcap"], &["empty.mcap", "empty"]);
    refused(&lab, &["plot", "foreign.mcap"], &["foreign.mcap", "no MCAP file"]);
    refused(&lab, &["plot", "other"], &["other", "no summary.json"]);
    refused(&lab, &["plot", "run", "--what", "paths"], &["paths", "path, cross-track", "sheet"]);
    fs::remove_file(dir.join("run.mcap")).expect("it was there");
    refused(&lab, &["plot", "run", "--what", "late"], &["late", "no recording"]);
    refused(&lab, &["plot", "run", "--out", "a.pdf"], &["a.pdf", ".svg and .png"]);
    refused(&lab, &["plot", "run", "--out", "a.svg", "--format", "png"], &["a.svg", "--format png"]);
    refused(&lab, &["plot", "run", "--out", "a.svg", "--what", "path,speed"], &["a.svg", "2 pictures"]);
    refused(&lab, &["plot", "run", "--width", "12"], &["--width 12", "100 to 4000"]);
    refused(&lab, &["plot", "run", "--out", "file.txt/deep"], &["file.txt/deep"]);
    refused(&lab, &["plot", "run", "--out", "gone/a.png"], &["gone/a.png", "--out"]);
    let mut lines: Vec<&str> = whole.lines().collect();
    lines[41] = "205,0.2,what";
    for (broken, says) in [
        (lines.join("\n"), "trace.csv:42: not a row"),
        (whole.replacen("tick,", "tock,", 1), "trace.csv:1: not the header"),
        (whole.lines().chain(whole.lines().last()).collect::<Vec<_>>().join("\n"), "does not come after"),
    ] {
        fs::write(dir.join("trace.csv"), broken).expect("it is written");
        refused(&lab, &["plot", "run"], &["run/", says]);
    }
    fs::write(dir.join("trace.csv"), whole).expect("it is written");
    fs::write(dir.join("path.csv"), "x,y\n0,0\n1,here\n").expect("it is written");
    refused(&lab, &["plot", "run"], &["run/path.csv:3: "]);
    fs::remove_file(dir.join("path.csv")).expect("it was there");
    fs::write(dir.join("summary.json"), "{\"scenario\": 3}").expect("it is written");
    refused(&lab, &["plot", "run"], &["run/summary.json"]);
    assert!(!lab.dir().join("a.svg").exists() && !dir.join("sheet.svg").exists(), "nothing half done");
}

/// Ticks and the three numbers of the pose, as trace.csv has them.
fn poses(lab: &Lab, dir: &str) -> Vec<(u64, [String; 3])> {
    let csv = fs::read_to_string(lab.dir().join(dir).join("trace.csv")).expect("a trace");
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        (cells[0].parse().expect("a tick"), [cells[1], cells[2], cells[3]].map(str::to_owned))
    };
    csv.lines().skip(1).map(row).collect()
}

#[test]
fn runs_are_compared() {
    let lab = Lab::new();
    run(&lab, "a", &["rectangle-open"]);
    run(&lab, "same", &["rectangle-open"]);
    run(&lab, "b", &["rectangle-open", "--set", "controller.law=pure-pursuit"]);
    run(&lab, "other", &["trapezoid"]);
    let compare = |runs: &[&str]| -> Value {
        let ended = lab.hilare(&[&["compare", "--json", "--out", "beside"], runs].concat()).expect_code(0);
        let told: Value = serde_json::from_str(&ended.stdout).expect("JSON and nothing else");
        let kept = fs::read_to_string(lab.dir().join("beside/compare.json")).expect("compare.json");
        assert_eq!(kept, ended.stdout);
        told
    };
    let twice = compare(&["a", "same"]);
    assert_eq!((&twice["same_scenario"], &twice["same_path"]), (&true.into(), &true.into()));
    assert_eq!(twice["poses"][0]["first_different_tick"], Value::Null);
    assert_eq!(twice["poses"][0]["same_state_hash"], Value::Bool(true));
    assert_eq!(twice["system"], Value::Array(Vec::new()));
    let figures = twice["figures"].as_array().expect("figures");
    assert!(figures.iter().all(|figure| figure["differences"][1].as_f64() == Some(0.0)), "{twice}");

    let parted = compare(&["a", "b", "same"]);
    let ours = poses(&lab, "a").into_iter().zip(poses(&lab, "b")).find(|(a, b)| a.1 != b.1);
    let ((tick, _), _) = ours.expect("another law drives another way");
    // The recordings know it to the tick; what is the same again at the next row is not in the curves.
    let first = parted["poses"][0]["first_different_tick"].as_u64().expect("a tick");
    assert!(first <= tick, "{first}, by the curves {tick}");
    assert_eq!(parted["poses"][0]["last_same_tick"], Value::from(first - 1));
    assert_eq!(parted["poses"][1]["first_different_tick"], Value::Null);
    assert_eq!(text(&parted["system"][0], "key"), "controller.law");
    for figure in parted["figures"].as_array().expect("figures") {
        let name = text(figure, "figure");
        for (n, dir) in ["a", "b", "same"].iter().enumerate() {
            let summary = lab.summary(&lab.dir().join(dir));
            // What is worked out of two of its keys has none.
            if let Some(value) = summary.get(name).and_then(Value::as_f64) {
                assert_eq!(figure["values"][n].as_f64(), Some(value), "{name} of {dir}");
            }
        }
        let [a, b] = [0, 1].map(|n| figure["values"][n].as_f64().expect("a number"));
        assert_eq!(figure["differences"][1].as_f64(), Some(b - a), "{name}");
        let percent = (a != 0.0).then(|| 100.0 * (b - a) / a.abs());
        assert_eq!(figure["differences_percent"][1].as_f64(), percent, "{name}");
    }
    for picture in ["path", "cross_track", "speed"] {
        let svg =
            fs::read_to_string(lab.dir().join(format!("beside/compare-{picture}.svg"))).expect("a picture");
        for legend in ["A: a", "B: b", "C: same"] {
            assert!(svg.lines().any(|line| line == legend), "{picture}: {legend}");
        }
    }

    let told = lab.hilare(&["compare", "a", "other", "--format", "png"]).expect_code(0).stdout;
    assert!(told.contains("Different scenarios") && told.contains("not compared"), "{told}");
    assert!(lab.dir().join("runs/compare-1/compare-path.png").is_file());
    fs::remove_file(lab.dir().join("b/run.mcap")).expect("it was there");
    let told = lab.hilare(&["compare", "a", "b"]).expect_code(0).stdout;
    assert!(told.contains(&format!("first different at tick {tick} ")), "{told}");
}

#[test]
fn runs_and_scenarios_do_not_mix() {
    let lab = Lab::new();
    run(&lab, "a", &["rectangle-open"]);
    refused(&lab, &["compare", "a"], &["a: one run"]);
    refused(&lab, &["compare", "a", "rectangle"], &["a is a run", "rectangle a scenario"]);
    refused(&lab, &["compare", "a", "a", "--laws", "qp"], &["--laws"]);
    refused(&lab, &["compare", "a", "gone.mcap"], &["gone.mcap"]);
    refused(&lab, &["compare", "a", "a", "a", "a", "a", "a", "a", "a"], &["8 runs", "7 at most"]);
    // What is built in is meant by its name, whatever lies about.
    fs::create_dir(lab.dir().join("rectangle-open")).expect("a directory");
    let args = ["compare", "rectangle-open", "--laws", "kanayama", "--out", "laws", "--format", "png"];
    lab.hilare(&args).expect_code(0);
    assert!(lab.dir().join("laws/rectangle-open-speed.png").is_file());
}
