//! Markdown, JSON, pictures, and the tables for a terminal.

use super::rows::{Nearness, Row};
use super::{Reproduction, Section};
use crate::report::{make_dir, write_file};
use std::fmt::Write;
use std::io;
use std::path::Path;

/// Directory of the pictures, beside the Markdown.
const IMAGES: &str = "images";

/// Writes `reproduction.md`, `reproduction.json` and `images/*.svg` into `dir`, which is there. An error is one line
/// that names the path and the reason.
pub fn write(dir: &Path, reproduction: &Reproduction) -> io::Result<()> {
    let images = dir.join(IMAGES);
    make_dir(&images)?;
    for picture in reproduction.papers.iter().flat_map(|paper| &paper.pictures) {
        write_file(&images, &picture.file, &picture.svg)?;
    }
    write_file(dir, "reproduction.json", &json(reproduction)?)?;
    write_file(dir, "reproduction.md", &markdown(reproduction))?;
    Ok(())
}

/// As JSON, ends in a newline.
pub fn json(reproduction: &Reproduction) -> io::Result<String> {
    Ok(serde_json::to_string_pretty(reproduction)? + "\n")
}

/// As Markdown.
pub fn markdown(reproduction: &Reproduction) -> String {
    let mut text = String::from("# The papers, reproduced\n\n");
    let papers = reproduction.papers.iter().map(|paper| paper.paper.to_string());
    let papers =
        if reproduction.papers.len() == 3 { String::new() } else { format!(" {}", join(papers, " ")) };
    let seeds = reproduction.seeds;
    let _ = writeln!(
        text,
        "Written by `hilare reproduce{papers} --seeds {seeds}`; the same command writes the same file. *Ours* with two numbers \
         in brackets is the mean of {seeds} runs with the seeds 1 to {seeds}, and the least and the greatest of them. The \
         difference is ours less the printed number, or how far ours is beyond a printed bound. *Not printed* is what \
         the paper does not say, or only draws: the texts we have of the papers are without their pictures."
    );
    let _ = writeln!(text, "\n## In short\n\n{}", in_short(reproduction));
    for row in off(reproduction) {
        let _ = writeln!(text, "- {}", in_table(&row));
    }
    for section in &reproduction.papers {
        section_markdown(&mut text, section);
    }
    text
}

/// How many rows come how near.
fn in_short(reproduction: &Reproduction) -> String {
    let rows = || reproduction.papers.iter().flat_map(|section| &section.rows);
    let count = |nearness| rows().filter(|row| row.nearness() == nearness).count();
    let [met, near, far] = [Nearness::Met, Nearness::WithinATenth, Nearness::Off].map(count);
    format!(
        "{} rows, {} with a printed number to hold ours against: {met} meet it to its last digit, or keep the printed bounds \
         in every run; {near} are within a tenth; {far} are farther off, or beyond the bounds in some run:\n",
        rows().count(),
        met + near + far
    )
}

/// The rows that are farthest off, each a line.
fn off(reproduction: &Reproduction) -> Vec<String> {
    let mut lines = Vec::new();
    for section in &reproduction.papers {
        for row in section.rows.iter().filter(|row| row.nearness() == Nearness::Off) {
            let (paper, item, what) = (section.paper, row.item, row.what);
            lines.push(format!("paper {paper}, {item}, {what}: {}", row.difference_text));
        }
    }
    lines
}

fn join(words: impl Iterator<Item = String>, between: &str) -> String {
    words.collect::<Vec<_>>().join(between)
}

fn section_markdown(text: &mut String, section: &Section) {
    let _ = writeln!(text, "\n## Paper {}\n\n{}\n", section.paper, section.source);
    for line in &section.set_up {
        let _ = writeln!(text, "- {line}");
    }
    for rows in section.rows.chunk_by(|a, b| a.item == b.item) {
        let Some(first) = rows.first() else { continue };
        let _ = writeln!(text, "\n### Paper {}, {} ({})\n", section.paper, first.item, first.published.page);
        text.push_str("| what | published | ours | difference | why |\n|---|---|---|---|---|\n");
        for row in rows {
            let cells = [row.what, &row.published.text, &row.ours.text, &row.difference_text, &row.why];
            let _ = writeln!(text, "| {} |", cells.map(in_table).join(" | "));
        }
        for picture in section.pictures.iter().filter(|picture| picture.item == first.item) {
            let _ = writeln!(text, "\n![{0}]({IMAGES}/{1})\n\n{0}", picture.caption, picture.file);
        }
    }
}

/// A bar ends a cell of a table.
fn in_table(cell: &str) -> String {
    cell.replace('|', "\\|")
}

/// For a terminal: without the reasons, which are in the Markdown.
pub fn text(reproduction: &Reproduction) -> String {
    let mut text = String::new();
    for section in &reproduction.papers {
        let _ = writeln!(text, "Paper {}", section.paper);
        for rows in section.rows.chunk_by(|a, b| a.item == b.item) {
            let Some(first) = rows.first() else { continue };
            let _ = writeln!(text, "  {}", first.item);
            rows.iter().for_each(|row| text_row(&mut text, row));
        }
        text.push('\n');
    }
    text + &in_short(reproduction)
        + &off(reproduction).into_iter().map(|line| format!("  {line}\n")).collect::<String>()
}

fn text_row(text: &mut String, row: &Row) {
    let line = format!("    {:<50} {:<26} {}", row.what, row.published.text, row.ours.text);
    let difference =
        if row.difference.is_some() { format!("  [{}]", row.difference_text) } else { String::new() };
    let _ = writeln!(text, "{line}{difference}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_do_not_end_a_cell() {
        assert_eq!(in_table("|e_d| ≤ 2 mm"), "\\|e_d\\| ≤ 2 mm");
    }
}
