//! Every format, its options, and its errors.
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "tests and benchmarks have files, clocks, output and an environment"
)]

use hilare_planner::map::moving_ai::load_scenarios;
use hilare_planner::map::{Layer, UNKNOWN, Unknown};
use hilare_planner::{ClearanceField, LoadOptions, Map, WorldPoint};

const YAML: &str = "image: x.pgm\nresolution: 0.05\norigin: [1.0, -2.0, 0.0]\n";

fn ros(yaml: &str, image: &[u8]) -> Result<Map, String> {
    Map::from_ros_bytes(yaml.as_bytes(), image, &LoadOptions::default()).map_err(|e| e.to_string())
}

fn cells(map: &Map) -> &[u8] {
    match map.layer() {
        Layer::Cells(cells) => cells,
        Layer::Obstacles(_) => panic!("not a grid"),
    }
}

#[test]
fn pgm_variants_agree() {
    let bottom_up = [0, 0, UNKNOWN, 0, 100, UNKNOWN];
    let variants: [&[u8]; 7] = [
        b"P5\n3 2\n255\n\xfe\x00\xcd\xfe\xfe\xcd",
        b"P5 3 2 255 \xfe\x00\xcd\xfe\xfe\xcd",
        b"P5\n# made by hand\n3 # width\n2\n# 255 follows\n255\n\xfe\x00\xcd\xfe\xfe\xcd",
        b"P2\n3 2\n255\n254 0 205\n254 254 205\n",
        b"P2 3 2 255 254 0 205 254 254 205",
        b"P2\n3 2\n15\n15 0 12 # row\n15 15 12",
        b"P5\n3 2\n65535\n\xff\xff\x00\x00\xcd\xcd\xff\xff\xff\xff\xcd\xcd",
    ];
    for (index, image) in variants.iter().enumerate() {
        let map = ros(YAML, image).unwrap();
        assert_eq!(cells(&map), bottom_up, "variant {index}");
        let frame = map.frame();
        assert_eq!((frame.width_cells(), frame.height_cells(), frame.resolution_m()), (3, 2, 0.05));
        assert_eq!(frame.origin(), WorldPoint::new(1.0, -2.0));
    }
}

/// 16-bit and small maximum values scale to the same shades (0 to 1).
#[test]
fn modes_thresholds_and_negate() {
    let image = b"P5 6 1 255 \x00\x32\x64\x7f\xc8\xff";
    let with = |more: &str| cells(&ros(&format!("{YAML}{more}"), image).unwrap()).to_vec();
    let u = UNKNOWN;
    assert_eq!(with(""), [100, 100, u, u, u, 0]);
    assert_eq!(with("negate: 1\n"), [0, u, u, u, 100, 100]);
    for truth in ["true", "yes", "True", "on", "1", "2"] {
        assert_eq!(with(&format!("negate: {truth}\n")), with("negate: 1\n"), "{truth}");
    }
    for falsehood in ["false", "no", "0"] {
        assert_eq!(with(&format!("negate: {falsehood}\n")), with(""), "{falsehood}");
    }
    assert_eq!(with("mode: raw\n"), [0, 50, 100, u, u, u]);
    let scale = with("mode: scale\noccupied_thresh: 0.9\nfree_thresh: 0.1\n");
    assert_eq!(scale, [100, 88, 63, 50, 14, 0]);
    assert_eq!(with("free_thresh: 0.25\n"), [100, 100, u, u, 0, 0]);
    assert_eq!(with("unused: [1, 2]\nmode: trinary\n"), with(""));
}

#[test]
fn unknown_by_choice_and_blocked_percentage() {
    let image = b"P5 3 1 255 \xfe\x00\xcd";
    let options = LoadOptions { unknown: Unknown::Free, ..Default::default() };
    let map = Map::from_ros_bytes(YAML.as_bytes(), image, &options).unwrap();
    assert!(!map.blocks(UNKNOWN) && map.blocks(100) && !map.blocks(0));
    assert!(ros(YAML, image).unwrap().blocks(UNKNOWN));
}

#[test]
fn origin_with_yaw_turns_the_grid() {
    let yaml = "image: x\nresolution: 0.5\norigin: [1, 2, 1.5707963267948966]\n";
    let map = ros(yaml, b"P5 4 2 255 \xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe").unwrap();
    let p = map.frame().cell_centre(3, 0);
    assert!((p.x_m - 0.75).abs() < 1e-12 && (p.y_m - 3.75).abs() < 1e-12, "{p:?}");
    assert!(map.frame().contains(p) && !map.frame().contains(WorldPoint::new(1.5, 2.5)));
}

fn png_bytes(width: u32, color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let samples = color.samples() * if depth == png::BitDepth::Sixteen { 2 } else { 1 };
    let mut encoder = png::Encoder::new(&mut out, width, (data.len() / samples) as u32 / width);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    out
}

#[test]
fn png_colours_depths_and_alpha() {
    use png::{BitDepth, ColorType};
    let u = UNKNOWN;
    let read = |yaml: &str, image: &[u8]| cells(&ros(yaml, image).unwrap()).to_vec();
    let grey = png_bytes(3, ColorType::Grayscale, BitDepth::Eight, &[254, 0, 205]);
    assert_eq!(read(YAML, &grey), [0, 100, u]);
    let deep = png_bytes(2, ColorType::Grayscale, BitDepth::Sixteen, &[255, 255, 0, 0]);
    assert_eq!(read(YAML, &deep), [0, 100]);
    let rgb = png_bytes(2, ColorType::Rgb, BitDepth::Eight, &[255, 255, 255, 255, 0, 0]);
    assert_eq!(read(YAML, &rgb), [0, 100]);
    // trinary averages opacity with the colours: white but transparent is 0.75 bright
    let rgba =
        png_bytes(3, ColorType::Rgba, BitDepth::Eight, &[255, 255, 255, 255, 255, 255, 255, 0, 0, 0, 0, 0]);
    assert_eq!(read(YAML, &rgba), [0, u, 100]);
    let scale = format!("{YAML}mode: scale\n");
    let alpha = png_bytes(3, ColorType::GrayscaleAlpha, BitDepth::Eight, &[0, 255, 0, 254, 255, 255]);
    assert_eq!(read(&scale, &alpha), [100, u, 0]);
}

/// An 8-bit grey PNG, interlaced with Adam7 and stored without compression, built from the specification.
fn interlaced_png(width: usize, height: usize, pixel: impl Fn(usize, usize) -> u8) -> Vec<u8> {
    // first column and row of each pass, and its strides
    const PASSES: [(usize, usize, usize, usize); 7] =
        [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)];
    let mut raw = Vec::new();
    for (x0, y0, dx, dy) in PASSES {
        for y in (y0..height).step_by(dy).filter(|_| x0 < width) {
            raw.push(0);
            raw.extend((x0..width).step_by(dx).map(|x| pixel(x, y)));
        }
    }
    let (a, b) = raw
        .iter()
        .fold((1u32, 0u32), |(a, b), &v| ((a + u32::from(v)) % 65521, (a + b + u32::from(v)) % 65521));
    let length = raw.len() as u16;
    let mut zlib = vec![0x78, 0x01, 1];
    zlib.extend(length.to_le_bytes());
    zlib.extend((!length).to_le_bytes());
    zlib.extend(raw);
    zlib.extend((b << 16 | a).to_be_bytes());
    let mut header = [(width as u32).to_be_bytes(), (height as u32).to_be_bytes()].concat();
    header.extend([8, 0, 0, 0, 1]);
    let mut image = Vec::from(*b"\x89PNG\r\n\x1a\n");
    for (kind, body) in [(b"IHDR", header), (b"IDAT", zlib), (b"IEND", Vec::new())] {
        image.extend((body.len() as u32).to_be_bytes());
        let start = image.len();
        image.extend(kind);
        image.extend(body);
        let crc = !image[start..].iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
        });
        image.extend(crc.to_be_bytes());
    }
    image
}

#[test]
fn interlaced_png_equals_pgm() {
    for (width, height) in [(1, 1), (5, 3), (8, 8), (13, 17)] {
        let pixel = |x: usize, y: usize| ((x * 37 + y * 101) % 256) as u8;
        let mut pgm = format!("P5 {width} {height} 255 ").into_bytes();
        pgm.extend((0..width * height).map(|i| pixel(i % width, i / width)));
        let yaml = format!("{YAML}mode: raw\n");
        let (png, pgm) =
            (ros(&yaml, &interlaced_png(width, height, pixel)).unwrap(), ros(&yaml, &pgm).unwrap());
        assert_eq!(cells(&png), cells(&pgm), "{width} x {height}");
    }
}

#[test]
fn moving_ai_map_and_scenarios() {
    let text = b"type octile\nheight 2\nwidth 4\nmap\n.G@T\nSWO.\n";
    let options = LoadOptions { moving_ai_resolution_m: 0.5, ..Default::default() };
    let map = Map::from_bytes("a.map", text, &options).unwrap();
    assert_eq!(cells(&map), [0, 0, 100, 100, 0, 100, 100, 0]);
    assert_eq!(map.frame().cell_centre(3, 1), WorldPoint::new(1.75, 0.75));
    let crlf = Map::from_bytes("a.map", b"type octile\r\nheight 1\r\nwidth 2\r\nmap\r\n.@\r\n", &options);
    assert_eq!(cells(&crlf.unwrap()), [0, 100]);
    let scratch = tempfile::tempdir().unwrap();
    let dir = scratch.path();
    let file = dir.join("a.map.scen");
    std::fs::write(&file, "version 1\n0\ta b.map\t4\t2\t0\t0\t1\t0\t1.5\n").unwrap();
    let list = load_scenarios(&file).unwrap();
    assert_eq!((list[0].start, list[0].goal, list[0].octile_length_cells), ((0, 0), (1, 0), 1.5));
    std::fs::write(&file, "version 1\n0\tx\t4\t2\t0\t0\t1\n").unwrap();
    assert!(load_scenarios(&file).unwrap_err().to_string().contains("a.map.scen:2: bad query line"));
}

#[test]
fn obstacle_lists_in_both_units() {
    let json = br#"{"width_mm": 2000, "height_mm": 1000, "boxes_mm": [[0, 0, 100, 100]], "discs_mm": [[500, 500, 50]],
        "polygons_mm": [[[1000, 200], [1400, 200], [1200, 600]]], "robot_radius_mm": 37, "start_mm": [300, 300], "comment": 1}"#;
    let toml = b"width_m = 2.0\nheight_m = 1.0\nboxes_m = [[0.1, 0.1, 0.0, 0.0]]\ncylinders_m = [[0.5, 0.5, 0.05]]\n\
        polygons_m = [[[1.0, 0.2], [1.4, 0.2], [1.2, 0.6]]]\nrobot_radius_m = 0.037\nstart_m = [0.3, 0.3]\n";
    let options = LoadOptions::default();
    let a = Map::from_bytes("a.json", json, &options).unwrap();
    let b = Map::from_bytes("a.toml", toml, &options).unwrap();
    assert_eq!(a, b);
    assert_eq!(a.job().unwrap().start, Some(WorldPoint::new(0.3, 0.3)));
    let field = ClearanceField::new(&a);
    for (x, y, expected) in [
        (0.2, 0.05, 0.1),
        (0.5, 0.6, 0.05),
        (1.2, 0.1, 0.1),
        (1.2, 0.3, 0.0),
        (0.05, 0.05, 0.0),
        (1.6, 0.1, 0.05f64.hypot(0.05) * 2.0f64.sqrt() * 2.0),
    ] {
        let clearance = field.clearance_m(WorldPoint::new(x, y)).unwrap();
        if x == 1.6 {
            assert!((clearance - 0.2f64.hypot(0.1)).abs() < 1e-12, "{clearance}");
        } else {
            assert!((clearance - expected).abs() < 1e-12, "{x} {y}: {clearance}");
        }
    }
    let discs = Map::from_bytes("a.csv", b"x_m,y_m,r_m\n1,2,0.5\n-1.0, 0.0, 0.25\n", &options).unwrap();
    assert!(
        discs.frame().contains(WorldPoint::new(1.5, 2.5))
            && discs.frame().contains(WorldPoint::new(-1.25, -0.25))
    );
}

#[test]
fn errors_name_place_cause_and_cure() {
    let ok = b"P5 1 1 255 \xfe";
    let yaml = |text: &str| ros(text, ok).unwrap_err();
    let cases = [
        (yaml("image: x\nresolution: 0\norigin: [0,0,0]\n"), ":2: resolution is 0; give metres"),
        (yaml("image: x\nresolution: -1\norigin: [0,0,0]\n"), ":2: resolution is -1"),
        (yaml("image: x\nresolution: .nan\norigin: [0,0,0]\n"), ":2: resolution is NaN"),
        (yaml("image: x\nresolution: 1\norigin: [0,.nan,0]\n"), ":3: origin is not finite"),
        (yaml("image: x\nresolution: 1\norigin: [0,.inf,0]\n"), ":3: origin is not finite"),
        (yaml("image: x\nresolution: 1\norigin: [0]\n"), ":3: origin has 1 numbers"),
        (
            yaml("image: x\nresolution: 1\norigin: [0,0,0]\nmode: grey\n"),
            ":4: unknown mode \"grey\"; use trinary",
        ),
        (yaml("image: x\nresolution: 1\norigin: [0,0,0]\nnegate: maybe\n"), "negate as 0, 1, true or false"),
        (
            yaml("image: x\nresolution: 1\norigin: [0,0,0]\nfree_thresh: 0.7\n"),
            ":4: free_thresh 0.7 is not below",
        ),
        (
            yaml("image: x\nresolution: 1\norigin: [0,0,0]\noccupied_thresh: 65\n"),
            ":4: threshold 65; thresholds",
        ),
        (yaml("resolution: 1\norigin: [0,0,0]\n"), "image"),
        (yaml("image: [\n"), ":"),
        (ros(YAML, b"P6 1 1 255 abc").unwrap_err(), ":1: not a P5 or P2 image"),
        (ros(YAML, b"P5 99999 99999 255 a").unwrap_err(), "is more than"),
        (ros(YAML, b"P5 9999 9999 255 a").unwrap_err(), "the file can hold at most"),
        (ros(YAML, b"P5 0 3 255 a").unwrap_err(), "the size is 0 x 3"),
        (ros(YAML, b"P5 1 1 70000 aa").unwrap_err(), "maximum grey value 70000"),
        (ros(YAML, b"P5 1 1 0 a").unwrap_err(), "maximum grey value 0"),
        (ros(YAML, b"P5 3 x").unwrap_err(), "the height has the character 'x'"),
        (ros(YAML, b"P2 2 2 255\n1 2\n3").unwrap_err(), ":3: the file ends before a grey value"),
        (ros(YAML, b"\x89PNG\r\n\x1a\nnonsense").unwrap_err(), "PNG"),
        (ros(YAML, b"").unwrap_err(), "cut short"),
    ];
    for (error, expected) in cases {
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
        assert!(!error.contains('\n') && error.len() < 500, "{error:?} is not one line");
    }
    let list = |name: &str, text: &str| {
        Map::from_bytes(name, text.as_bytes(), &LoadOptions::default()).unwrap_err().to_string()
    };
    let cases = [
        (list("a.toml", "width_mm = 1\nheigth_mm = 1\n"), "a.toml:2: unknown field `heigth_mm`"),
        (list("a.toml", "width_mm = 1000\nheight_mm = nan\n"), "the extent is NaN m"),
        (list("a.json", "{\n\"width_mm\": }"), "a.json:2: "),
        (list("a.json", "{\"width_mm\": 1000}"), "width or height is missing"),
        (
            list("a.json", "{\"width_mm\":1,\"height_mm\":1,\"discs_mm\":[[0,0,-1]]}"),
            "obstacle 1 is malformed",
        ),
        (list("a.csv", "x,y,r\n1,2,3\n1,2\n"), "a.csv:3: bad disc \"1,2\""),
        (list("a.csv", "x,y,r\n"), "no disc"),
        (list("a.map", "type octile\nheight 2\nwidth 2\nmap\n..\n.\n"), "a.map:6: the row has 1 tiles"),
        (list("a.map", "type octile\nheight 2\nwidth 2\nmap\n..\n.?\n"), "a.map:6: unknown tile '?'"),
        (list("a.map", "type octile\nheight 9999\nwidth 9999\nmap\n..\n"), "can hold at most"),
        (list("a.map", "P5 1 1 255 x"), "a.map:1: not a Moving AI header"),
        (list("a.bmp", ""), "unknown map format \".bmp\""),
    ];
    for (error, expected) in cases {
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    }
}

/// Image paths are followed as map_server follows them: relative to the YAML file, through `..`, absolute.
#[test]
fn image_paths_are_followed() {
    let scratch = tempfile::tempdir().unwrap();
    let dir = scratch.path();
    let sub = dir.join("sub");
    std::fs::create_dir_all(&sub).unwrap();
    std::fs::write(dir.join("image.pgm"), b"P5 1 1 255 \xfe").unwrap();
    let absolute = dir.join("image.pgm");
    for image in ["../image.pgm", absolute.to_str().unwrap()] {
        std::fs::write(sub.join("a.yaml"), format!("image: {image}\nresolution: 1\norigin: [0, 0, 0]\n"))
            .unwrap();
        assert_eq!(cells(&Map::load(sub.join("a.yaml"), &LoadOptions::default()).unwrap()), [0]);
    }
    std::fs::write(sub.join("a.yaml"), "image: gone.pgm\nresolution: 1\norigin: [0, 0, 0]\n").unwrap();
    let error = Map::load(sub.join("a.yaml"), &LoadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("gone.pgm: cannot read") && error.ends_with("check the path"), "{error}");
    std::fs::write(sub.join("a.yaml"), "image: ..\nresolution: 1\norigin: [0, 0, 0]\n").unwrap();
    let error = Map::load(sub.join("a.yaml"), &LoadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("not a regular file"), "{error}");
}
