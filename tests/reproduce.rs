//! `hilare reproduce`: every table and every simulated figure has its rows, the printed values are those of the
//! papers, and the committed page is what the command writes.

mod support;

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use support::{Lab, PATIENCE, number, text};

/// Figures and tables of the papers: paper, item, rows it has at least, pictures it has.
const ITEMS: [(u64, &str, usize, usize); 17] = [
    (1, "table 1", 9, 0),
    (1, "table 2", 5, 0),
    (1, "figure 6", 6, 1),
    (1, "figure 7", 6, 1),
    (1, "figure 8", 1, 1),
    (1, "figure 10", 3, 2),
    (1, "figure 11", 3, 2),
    (1, "figure 12", 3, 2),
    (1, "table 3", 9, 0),
    (2, "figure 4", 4, 1),
    (2, "figure 5", 7, 2),
    (3, "table 1", 5, 0),
    (3, "table 2", 5, 0),
    (3, "figure 5", 4, 2),
    (3, "figure 6", 4, 2),
    (3, "figure 9", 3, 2),
    (3, "table 3", 12, 0),
];

/// What the papers print, read from them and not from the code: paper, item, what the row is called by, the least and
/// the greatest value.
#[rustfmt::skip]
const PRINTED: [(u64, &str, &str, Option<f64>, f64); 48] = [
    (1, "table 1", "w_T", Some(54.0), 54.0),
    (1, "table 1", "d_w", Some(40.0), 40.0),
    (1, "table 1", "step size", Some(0.13), 0.13),
    (1, "table 1", "ω1max", Some(3.25), 3.25),
    (1, "table 1", "Δt", Some(1.0), 1.0),
    (1, "table 1", "v_r", Some(40.0), 40.0),
    (1, "table 1", "ω_r", Some(0.0), 0.0),
    (1, "table 1", "v_min", Some(0.0), 0.0),
    (1, "table 1", "ω_min", Some(0.0), 0.0),
    (1, "figure 6", "evaluations", Some(20000.0), 20000.0),
    (1, "figure 6", "particles of the front", Some(50.0), 50.0),
    (1, "table 2", "k1", Some(0.0), 5.0),
    (1, "table 2", "k2", Some(0.0), 5.0),
    (1, "table 2", "k3", Some(0.0), 5.0),
    (1, "table 2", "v_max", Some(40.0), 100.0),
    (1, "table 2", "ω_max", Some(0.0), 0.75),
    (1, "figure 7", "cross-track", Some(2.63), 2.63),
    (1, "figure 8", "velocity error", Some(2.62), 2.62),
    (1, "table 3", "planner's path: waypoints", Some(28.0), 28.0),
    (1, "table 3", "planner's path: mean cross-track", Some(12.88), 12.88),
    (1, "table 3", "planner's path: mean linear velocity", Some(1.24), 1.24),
    (1, "table 3", "rectangle: waypoints", Some(4.0), 4.0),
    (1, "table 3", "rectangle: mean cross-track", Some(6.75), 6.75),
    (1, "table 3", "rectangle: mean linear velocity", Some(2.91), 2.91),
    (1, "table 3", "cursive: waypoints", Some(43.0), 43.0),
    (1, "table 3", "cursive: mean cross-track", Some(9.45), 9.45),
    (1, "table 3", "cursive: mean linear velocity", Some(2.46), 2.46),
    (2, "figure 4", "turned", Some(21.0), 21.0),
    (2, "figure 4", "way", None, 200.0),
    (2, "figure 4", "afterwards", None, 1.0),
    (2, "figure 5", "radius", Some(102.0), 102.0),
    (2, "figure 5", "speed", Some(1.5), 1.5),
    (2, "figure 5", "overshoots", Some(1.0), 1.0),
    (2, "figure 5", "way round", None, 60.0),
    (2, "figure 5", "afterwards", None, 1.0),
    (3, "table 1", "v_τ", Some(0.3), 0.3),
    (3, "table 2", "v_τ", Some(0.5), 0.5),
    (3, "table 2", "a_max", Some(0.05), 0.05),
    (3, "figure 9", "distance", None, 2.0),
    (3, "figure 9", "angle", None, 2.0),
    (3, "table 3", "state feedback", None, 130.0),
    (3, "table 3", "variable structure", Some(4.0), 5.0),
    (3, "table 3", "fuzzy-optimal", Some(10.0), 10.0),
    (3, "table 3", "PID: time", Some(6.9), 7.8),
    (3, "table 3", "PSO: time", Some(4.0), 6.2),
    (3, "table 3", "improved PSO: time", Some(2.7), 4.3),
    (3, "table 3", "the paper's method: |e_d|", None, 2.0),
    (3, "table 3", "the paper's method: time", Some(0.8), 1.2),
];

/// The command as the page says it was run: its directory, and what it printed.
fn whole() -> &'static (Lab, PathBuf, Value) {
    static WHOLE: OnceLock<(Lab, PathBuf, Value)> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let lab = Lab::new();
        // The search behind figure 6 is 740 million ticks.
        let ended = lab.start(&["reproduce", "--json"]).wait(4 * PATIENCE).expect_code(0);
        assert_eq!(ended.stderr, "");
        let printed = serde_json::from_str(&ended.stdout).expect("JSON and nothing else");
        let out = lab.dir().join("runs/reproduce-1");
        (lab, out, printed)
    })
}

fn section(paper: u64) -> &'static Value {
    let papers = whole().2["papers"].as_array().expect("a list of papers");
    papers.iter().find(|section| section["paper"] == paper).expect("the paper")
}

fn list<'v>(value: &'v Value, key: &str) -> &'v [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("no list {key:?}"))
}

fn rows(paper: u64, item: &str) -> Vec<&'static Value> {
    list(section(paper), "rows").iter().filter(|row| row["item"] == item).collect()
}

#[track_caller]
fn row(paper: u64, item: &str, what: &str) -> &'static Value {
    let rows = rows(paper, item);
    let named = rows.iter().find(|row| text(row, "what").starts_with(what));
    let found = named.or_else(|| rows.iter().find(|row| text(row, "what").contains(what)));
    found.unwrap_or_else(|| panic!("paper {paper}, {item}: no row of {what}"))
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

#[test]
fn every_table_and_every_simulated_figure_is_there() {
    for (paper, item, least, pictures) in ITEMS {
        let rows = rows(paper, item);
        assert!(rows.len() >= least, "paper {paper}, {item}: {} rows", rows.len());
        let drawn = list(section(paper), "pictures").iter().filter(|picture| picture["item"] == item);
        assert_eq!(drawn.count(), pictures, "pictures of paper {paper}, {item}");
    }
}

#[test]
fn what_is_called_printed_is_what_the_papers_print() {
    for (paper, item, what, low, high) in PRINTED {
        let published = &row(paper, item, what)["published"];
        assert_eq!(published["low"].as_f64(), low, "paper {paper}, {item}, {what}");
        assert_eq!(published["high"].as_f64(), Some(high), "paper {paper}, {item}, {what}");
    }
    // The scenarios have some of them as well, in metres.
    let lab = Lab::new();
    for (scenario, [cross_track, speed]) in [
        ("trapezoid", [("figure 7", "mean cross-track"), ("figure 8", "mean linear velocity")]),
        (
            "platform",
            ["planner's path: mean cross-track", "planner's path: mean lin"].map(|what| ("table 3", what)),
        ),
        ("rectangle", ["rectangle: mean cross-track", "rectangle: mean lin"].map(|what| ("table 3", what))),
        ("so", ["cursive: mean cross-track", "cursive: mean lin"].map(|what| ("table 3", what))),
    ] {
        let verdict = lab.hilare(&["run", scenario, "--clock", "in-process", "--out", "one"]).expect_code(0);
        for ((item, what), unit) in [(cross_track, "mm"), (speed, "mm/s")] {
            let printed = number(&row(1, item, what)["published"], "high");
            let words = format!("{printed:.2} {unit}");
            assert!(verdict.stdout.contains(&words), "{scenario}: no {words} in {}", verdict.stdout);
        }
    }
}

#[test]
fn every_row_is_whole_and_its_keys_are_stable() {
    assert_eq!(keys(&whole().2), ["papers", "seeds"]);
    let numbers = |cell: &Value, names: [&str; 2]| names.map(|name| cell[name].as_f64());
    for paper in 1..=3 {
        let section = section(paper);
        assert_eq!(keys(section), ["paper", "pictures", "rows", "runs", "set_up", "source"]);
        assert!(!list(section, "set_up").is_empty() && !list(section, "runs").is_empty(), "paper {paper}");
        for row in list(section, "rows") {
            let names =
                ["difference", "difference_text", "item", "key", "ours", "published", "unit", "what", "why"];
            assert_eq!(keys(row), names);
            assert_eq!(keys(&row["published"]), ["high", "low", "page", "text"]);
            assert_eq!(keys(&row["ours"]), ["max", "mean", "min", "runs", "text"]);
            for cell in [&row["what"], &row["why"], &row["difference_text"]] {
                assert!(cell.as_str().is_some_and(|cell| !cell.is_empty()), "{row}");
            }
            assert!(text(&row["published"], "page").starts_with("p. "), "{row}");
            assert!(!text(&row["published"], "text").is_empty() && !text(&row["ours"], "text").is_empty());
            let [mean, high] = [row["ours"]["mean"].as_f64(), row["published"]["high"].as_f64()];
            assert_eq!(row["difference"].is_number(), mean.is_some() && high.is_some(), "{row}");
            if let (Some(mean), [Some(low), Some(high)]) = (mean, numbers(&row["published"], ["low", "high"]))
                && low == high
            {
                assert!((number(row, "difference") - (mean - low)).abs() < 1e-12, "{row}");
            }
            if let (Some(mean), [Some(min), Some(max)]) = (mean, numbers(&row["ours"], ["min", "max"])) {
                assert!((min - 1e-9..=max + 1e-9).contains(&mean), "{row}");
            }
        }
    }
}

#[test]
fn the_measured_values_have_their_spread() {
    let seeds = number(&whole().2, "seeds");
    assert!(seeds >= 20.0);
    for what in
        ["planner's path: mean cross-track", "rectangle: mean cross-track", "cursive: mean cross-track"]
    {
        let row = row(1, "table 3", what);
        let ours = &row["ours"];
        assert_eq!(number(ours, "runs"), seeds);
        assert!(
            number(ours, "min") < number(ours, "mean") && number(ours, "mean") < number(ours, "max"),
            "{row}"
        );
        // One size of the disturbances is fitted to three printed values: all three have to be met with it.
        let printed = number(&row["published"], "high");
        assert!((number(ours, "mean") / printed - 1.0).abs() <= 0.1, "{row}");
        assert!(number(ours, "min") < printed && printed < number(ours, "max"), "{row}");
    }
}

#[test]
fn a_run_of_the_list_ends_in_the_same_bits_alone() {
    let lab = Lab::new();
    for paper in 1..=3 {
        let runs = list(section(paper), "runs");
        for note in [&runs[0], &runs[runs.len() / 2], &runs[runs.len() - 1]] {
            let seed = number(note, "seed").to_string();
            let clock = if paper == 3 { "in-process" } else { "lockstep" };
            let robot = lab.robot();
            let mut args = vec!["run", text(note, "scenario"), "--clock", clock, "--json", "--seed", &seed];
            args.extend(["--robot", &robot]);
            args.extend(text(note, "set").split_whitespace().flat_map(|key| ["--set", key]));
            let alone: Value = serde_json::from_str(&lab.hilare(&args).expect_code(0).stdout).expect("JSON");
            // A robot that counts its steps believes the same whatever its seed: the truth is what differs.
            for key in ["state_hash", "cross_track_mean_m"] {
                assert_eq!(alone[key], note[key], "{note}");
            }
        }
    }
}

/// An error where elements do not nest, or a quote, a bracket or an ampersand is loose.
fn check_xml(svg: &str) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    let mut seen = 0;
    for part in svg.split('<').skip(1) {
        let (tag, text) = part.split_once('>').ok_or_else(|| format!("a tag does not end: {part:.40}"))?;
        if tag.starts_with(['?', '!']) {
            continue;
        }
        if tag.matches('"').count() % 2 != 0 || text.contains('>') {
            return Err(format!("quotes or brackets do not match: {part:.60}"));
        }
        let loose =
            text.split('&').skip(1).find(|rest| rest.split_once(';').is_none_or(|(name, _)| name.len() >= 6));
        if let Some(loose) = loose {
            return Err(format!("a bare ampersand: {loose:.40}"));
        }
        seen += 1;
        if let Some(name) = tag.strip_prefix('/') {
            let last = open.pop();
            if last != Some(name.trim()) {
                return Err(format!("</{name}> closes {last:?}"));
            }
        } else if !tag.ends_with('/') {
            open.push(tag.split_whitespace().next().unwrap_or_default());
        }
    }
    if open.is_empty() && seen > 10 { Ok(()) } else { Err(format!("{seen} tags, open at the end: {open:?}")) }
}

#[test]
fn the_pictures_are_there_and_well_formed() {
    assert!(check_xml(&"<a><b></a></b>".repeat(9)).is_err() && check_xml(&"<a><b/></a>".repeat(9)).is_ok());
    let (_, out, _) = whole();
    let markdown = fs::read_to_string(out.join("reproduction.md")).expect("reproduction.md");
    let mut named = BTreeSet::new();
    for paper in 1..=3 {
        for picture in list(section(paper), "pictures") {
            let file = text(picture, "file");
            let svg = fs::read_to_string(out.join("images").join(file)).expect("the picture");
            check_xml(&svg).unwrap_or_else(|error| panic!("{file}: {error}"));
            assert!(svg.starts_with("<svg") && !svg.contains("NaN"), "{file}");
            assert!(markdown.contains(&format!("(images/{file})")), "{file} is not on the page");
            named.insert(file.to_owned());
        }
    }
    assert_eq!(files(&out.join("images")), named);
}

fn files(dir: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(dir).expect("a directory").flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

#[test]
fn the_committed_page_is_what_the_command_writes() {
    let (_, out, printed) = whole();
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let read = |path: PathBuf| {
        fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let written = read(out.join("reproduction.json"));
    assert_eq!(&serde_json::from_str::<Value>(&written).expect("JSON"), printed);
    let images = files(&out.join("images")).into_iter().map(|file| format!("images/{file}"));
    for file in ["reproduction.md".to_owned(), "reproduction.json".to_owned()].into_iter().chain(images) {
        let (ours, committed) = (read(out.join(&file)), read(docs.join(&file)));
        let line = ours.lines().zip(committed.lines()).find(|(a, b)| a != b);
        assert!(ours == committed, "docs/{file} is stale ({line:?}); write it: hilare reproduce --out docs");
    }
    let stale = files(&docs.join("images")).into_iter().filter(|file| file.starts_with("paper"));
    let stale: Vec<String> = stale.filter(|file| !out.join("images").join(file).is_file()).collect();
    assert!(stale.is_empty(), "docs/images has pictures the command does not write: {stale:?}");
}

#[test]
fn one_paper_alone_has_the_rows_it_has_among_all() {
    let lab = Lab::new();
    let ended = lab.hilare(&["reproduce", "2", "--json", "--out", "two"]).expect_code(0);
    let two: Value = serde_json::from_str(&ended.stdout).expect("JSON");
    assert_eq!(two["papers"].as_array().map(Vec::len), Some(1));
    assert_eq!(&two["papers"][0], section(2));
    // Other seeds, other numbers; without --json a table.
    let ended = lab.hilare(&["reproduce", "2", "--seeds", "3", "--out", "three"]).expect_code(0);
    for words in ["Paper 2", "figure 4", "figure 5", "in 3 of 3 runs", "Report: three"] {
        assert!(ended.stdout.contains(words), "{words:?} is missing in {}", ended.stdout);
    }
    let page = fs::read_to_string(lab.dir().join("three/reproduction.md")).expect("reproduction.md");
    assert!(page.contains("`hilare reproduce 2 --seeds 3`") && !page.contains("Paper 1"), "{page}");
}

#[test]
fn bad_arguments_are_one_line_and_leave_nothing() {
    let lab = Lab::new();
    let file = lab.file("a_file", "");
    let under_a_file = file.join("report").to_string_lossy().into_owned();
    for (args, word) in [
        (&["4"][..], "4"),
        (&["0"], "0"),
        (&["one"], "one"),
        (&["1", "1"], "twice"),
        (&["--seeds", "1"], "--seeds"),
        (&["--seeds", "-3"], "--seeds"),
        (&["--seeds", "many"], "many"),
        (&["2", "--out", &under_a_file], "a_file"),
        (&["--figures"], "--figures"),
    ] {
        let ended = lab.hilare(&[&["reproduce"], args].concat()).expect_code(2);
        assert_eq!(ended.stdout, "", "{args:?}");
        assert!(
            ended.stderr.lines().count() == 1 && ended.stderr.contains(word),
            "{args:?}: {}",
            ended.stderr
        );
    }
    assert_eq!(files(lab.dir()), BTreeSet::from(["a_file".to_owned()]));
}
