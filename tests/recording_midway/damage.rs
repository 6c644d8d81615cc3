//! Recordings that somebody has changed.

use crate::midway::Midway;
use crate::support::{number, text};
use hilare::recording::Entry;
use serde_json::Value;
use std::fs;

pub fn a_flipped_bit_is_found(midway: &Midway) {
    type Number = fn(&mut Entry) -> Option<&mut f64>;
    let numbers: [(&str, Number); 5] = [
        (
            "steps",
            |entry| {
                if let Entry::Steps(steps) = entry { Some(&mut steps.wheel_speed_radps[0]) } else { None }
            },
        ),
        ("pose", |entry| if let Entry::Pose(pose) = entry { Some(&mut pose.x_m) } else { None }),
        ("truth", |entry| if let Entry::Truth(truth) = entry { Some(&mut truth.theta_rad) } else { None }),
        ("reference", |entry| {
            if let Entry::Reference(reference) = entry { Some(&mut reference.speed_mps) } else { None }
        }),
        (
            "command",
            |entry| if let Entry::Command(command) = entry { Some(&mut command.vx_mps) } else { None },
        ),
    ];
    for (wire, number_in) in numbers {
        let total = midway.count(|entry| number_in(&mut entry.clone()).is_some());
        let mut seen = 0.0;
        let other = midway.rewritten("flipped.mcap", |entry| {
            if let Some(number) = number_in(entry) {
                seen += 1.0;
                if seen == (total / 2.0).floor() {
                    *number = f64::from_bits(number.to_bits() ^ 1);
                }
            }
        });
        let ended = other.replay(&["--json"]).expect_code(1);
        let report: Value = serde_json::from_str(&ended.stdout).expect("JSON");
        let boxes = report["boxes"].as_array().expect("boxes").iter();
        let mut tallies = boxes.flat_map(|found| found["wires"].as_array().expect("wires"));
        let found = tallies.any(|tally| text(tally, "wire") == wire && number(tally, "differing") >= 1.0);
        assert!(found, "{wire}: {report:#}");
    }
    // Rewritten without a change, it is as it was.
    let same = midway.rewritten("same.mcap", |_| {});
    same.replay(&[]).expect_code(0);
}

/// The bytes of a file's standings, and of their checksum.
fn standings_in(bytes: &[u8]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let begin = b"{\"version\":1,\"hilare\"";
    let at = bytes.windows(begin.len()).position(|part| part == begin).expect("standings");
    let length = u64::from_le_bytes(bytes[at - 8..at].try_into().expect("eight")) as usize;
    (at..at + length, at + length..at + length + 4)
}

pub fn standings_that_are_none_are_said_so(midway: &Midway) {
    let whole = fs::read(&midway.file).expect("a file");
    let (place, crc) = standings_in(&whole);
    let file = midway.lab.dir().join("other.mcap");
    let replay = |change: &dyn Fn(&mut Vec<u8>), checked: bool| {
        let mut bytes = whole.clone();
        let mut inside = bytes[place.clone()].to_vec();
        change(&mut inside);
        assert_eq!(inside.len(), place.len(), "as long as it was");
        bytes[place.clone()].copy_from_slice(&inside);
        if !checked {
            bytes[crc.clone()].fill(0);
        }
        fs::write(&file, bytes).expect("a file");
        let ended = midway.lab.hilare(&["replay", &file.to_string_lossy()]);
        assert!(matches!(ended.code, Some(0 | 1)) && !ended.stderr.contains("panicked"), "{ended:#?}");
        ended
    };
    let find = |inside: &[u8], what: &str| {
        inside.windows(what.len()).position(|part| part == what.as_bytes()).expect("it is there") + what.len()
    };
    let said = replay(&|inside| inside[100] ^= 1, true).stdout;
    assert!(said.contains("standings.json") && said.contains("is damaged"), "{said}");
    let foreign = |inside: &mut Vec<u8>| {
        let at = find(inside, "\"hilare\":\"");
        inside[at] = b'9';
    };
    let said = replay(&foreign, false).stdout;
    assert!(said.contains("is of hilare \"9"), "{said}");
    let said = replay(&|inside| *inside.last_mut().expect("text") = b' ', false).stdout;
    assert!(said.contains("is not what it should be"), "{said}");
    // Words of one box that are too few, and that are none.
    for (filler, words) in [(b' ', 20), (b'f', 16)] {
        for role in ["waypoint_selector", "controller", "step_generator", "pose_estimator", "plant"] {
            let change = |inside: &mut Vec<u8>| {
                let stand = find(inside, &format!("\"role\":\"{role}\""));
                let begin = stand + find(&inside[stand..], "\"words\":\"");
                let end = begin + inside[begin..].iter().position(|byte| *byte == b'"').expect("an end");
                let from = if filler == b' ' { begin + 2 } else { begin };
                let to = if filler == b' ' { end } else { end.min(begin + words) };
                inside[from..to].fill(filler);
            };
            let ended = replay(&change, false);
            let noticed = ended.code == Some(1) || ended.stdout.contains("not one it can go on from");
            assert!(noticed, "{role}: {ended:#?}");
        }
    }
    // A tick that never was.
    let later = |inside: &mut Vec<u8>| {
        let begin = find(inside, "\"done\":");
        let digits = inside[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        inside[begin..begin + digits].fill(b'9');
    };
    let ended = replay(&later, false);
    assert!(
        ended.code == Some(1) || ended.stdout.contains("at work before the recording began"),
        "{ended:#?}"
    );
}
