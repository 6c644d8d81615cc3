//! No input makes a parser panic, hang or eat memory. `HILARE_FUZZ_CASES=200000` a test runs a million in all.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

use hilare_planner::{ClearanceField, LoadOptions, Map};
use proptest::prelude::*;
use proptest::sample::select;

fn cases() -> u32 {
    std::env::var("HILARE_FUZZ_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(400)
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() }
}

/// Small grids keep a case in the microseconds; a header's lies are refused all the same.
fn options() -> LoadOptions {
    LoadOptions { max_cells: 1 << 14, ..LoadOptions::default() }
}

/// A seed text with pieces cut, copied, overwritten and inserted.
fn mutated(
    seeds: &'static [&'static [u8]],
    words: &'static [&'static [u8]],
) -> impl Strategy<Value = Vec<u8>> {
    let edit = (0u8..5, any::<u16>(), any::<u16>(), any::<u8>(), select(words));
    (select(seeds), prop::collection::vec(edit, 0..6)).prop_map(|(seed, edits)| {
        let mut text = seed.to_vec();
        for (kind, at, length, byte, word) in edits {
            let at = usize::from(at) % (text.len() + 1);
            let end = (at + usize::from(length) % 16).min(text.len());
            match kind {
                0 => drop(text.drain(at..end)),
                1 => text[at..end].fill(byte),
                2 => drop(text.splice(at..end, word.iter().copied())),
                3 => text.insert(at, byte),
                _ => {
                    let piece = text[at..end].to_vec();
                    drop(text.splice(at..at, piece));
                }
            }
        }
        text
    })
}

const NUMBERS: &[&[u8]] = &[
    b"0",
    b"-1",
    b"1e999",
    b".nan",
    b"nan",
    b"4294967296",
    b"18446744073709551616",
    b"1e-320",
    b"#",
    b"\n",
    b"[[",
    b"&a *a",
];

fn judge(result: Result<Map, hilare_planner::MapError>) -> Result<(), TestCaseError> {
    match result {
        Ok(map) => {
            let cells = map.frame().width_cells() * map.frame().height_cells();
            prop_assert!(cells <= 1 << 14 && map.frame().resolution_m() > 0.0);
            let (width, height) = map.frame().extent_m();
            prop_assert!(width.is_finite() && height.is_finite());
            let field = ClearanceField::new(&map);
            let clearance = field.clearance_m(map.frame().cell_centre(0, 0));
            prop_assert!(clearance.is_none_or(|c| c >= 0.0));
        }
        Err(error) => {
            let line = error.to_string();
            prop_assert!(!line.contains('\n') && line.len() < 2000 && line.contains("; "), "{line:?}");
        }
    }
    Ok(())
}

const PGM: &[u8] = b"P5\n3 2\n255\n\xfe\x00\xcd\xfe\xfe\xcd";
const YAML: &[u8] = b"image: x.pgm\nresolution: 0.05\norigin: [1.0, -2.0, 0.0]\nnegate: 0\nmode: trinary\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

fn png_seed() -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 4, 4);
    encoder.set_color(png::ColorType::Rgba);
    let pixels: Vec<u8> = (0..64).map(|i| i * 4).collect();
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    out
}

/// Makes the checksums right again, so that damage reaches what lies behind them.
fn mend_checksums(image: &mut [u8]) {
    let mut at = 8;
    while let Some(length) =
        image.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]) as usize)
    {
        let Some(body) = image.get(at + 4..at.saturating_add(8).saturating_add(length)) else { return };
        let sum = crc32(body).to_be_bytes();
        let Some(place) = image.get_mut(at + 8 + length..at + 12 + length) else { return };
        place.copy_from_slice(&sum);
        at += 12 + length;
    }
}

/// ISO 3309's checksum, as PNG's specification has it.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn yaml(text in mutated(&[YAML], NUMBERS)) {
        judge(Map::from_ros_bytes(&text, PGM, &options()))?;
    }

    #[test]
    fn images(image in mutated(&[PGM, b"P2\n3 2\n255\n254 0 205\n254 254 205\n", b"P5 1 2 65535 abcd"], NUMBERS)) {
        judge(Map::from_ros_bytes(YAML, &image, &options()))?;
    }

    #[test]
    fn png_images(edits in prop::collection::vec((8usize..120, any::<u8>()), 0..5), cut in 0usize..200, mend: bool) {
        let mut image = png_seed();
        let length = image.len();
        for (at, byte) in edits {
            image[at % length] = byte;
        }
        image.truncate(if cut < length { length } else { cut % length });
        if mend {
            mend_checksums(&mut image);
        }
        judge(Map::from_ros_bytes(YAML, &image, &options()))?;
    }

    #[test]
    fn moving_ai(text in mutated(&[b"type octile\nheight 2\nwidth 4\nmap\n.G@T\nSWO.\n"], NUMBERS)) {
        judge(Map::from_bytes("a.map", &text, &options()))?;
    }

    #[test]
    fn lists(name in select(&["a.toml", "a.json"][..]), text in mutated(&[
        br#"{"width_mm": 100, "height_mm": 160, "boxes_mm": [[0,35,38,42]], "cylinders_mm": [[52,20,5]], "polygons_mm": [[[1,2],[3,4],[5,1]]]}"#,
        b"width_mm = 100\nheight_mm = 160\nboxes_mm = [[0,35,38,42]]\ncylinders_mm = [[52,20,5]]\npolygons_m = [[[0.1,0.2],[0.3,0.4],[0.5,0.1]]]\n",
    ], NUMBERS)) {
        judge(Map::from_bytes(name, &text, &options()))?;
    }

    #[test]
    fn csv(text in mutated(&[b"x_m,y_m,r_m\n-0.075000,0.075000,0.0750\n1,2,3\n"], NUMBERS)) {
        judge(Map::from_bytes("a.csv", &text, &options()))?;
    }

    #[test]
    fn noise(name in select(&["a.map", "a.toml", "a.json", "a.csv"][..]), bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        judge(Map::from_bytes(name, &bytes, &options()))?;
        judge(Map::from_ros_bytes(YAML, &bytes, &options()))?;
        judge(Map::from_ros_bytes(&bytes, PGM, &options()))?;
    }
}
