//! The page's own files, part of the program.

/// A file of the page.
pub struct Asset {
    /// Its path.
    pub path: &'static str,
    /// Its content type.
    pub kind: &'static str,
    /// What is in it.
    pub bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

macro_rules! asset {
    ($path:literal, $kind:expr, $file:literal) => {
        Asset { path: $path, kind: $kind, bytes: include_bytes!(concat!("../page/", $file)) }
    };
}

/// All of them.
pub const ASSETS: &[Asset] = &[
    asset!("/", HTML, "index.html"),
    asset!("/style.css", STYLE, "style.css"),
    asset!("/main.js", SCRIPT, "main.js"),
    asset!("/dom.js", SCRIPT, "dom.js"),
    asset!("/drawing.js", SCRIPT, "drawing.js"),
    asset!("/keys.js", SCRIPT, "keys.js"),
    asset!("/laws.js", SCRIPT, "laws.js"),
    asset!("/link.js", SCRIPT, "link.js"),
    asset!("/log.js", SCRIPT, "log.js"),
    asset!("/map.js", SCRIPT, "map.js"),
    asset!("/notices.js", SCRIPT, "notices.js"),
    asset!("/path.js", SCRIPT, "path.js"),
    asset!("/hands.js", SCRIPT, "hands.js"),
    asset!("/plots.js", SCRIPT, "plots.js"),
    asset!("/state.js", SCRIPT, "state.js"),
    asset!("/stopping.js", SCRIPT, "stopping.js"),
    asset!("/view.js", SCRIPT, "view.js"),
    asset!("/icon.svg", "image/svg+xml", "icon.svg"),
    asset!("/vendor/uPlot.css", STYLE, "vendor/uPlot.css"),
    asset!("/vendor/uPlot.js", SCRIPT, "vendor/uPlot.js"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_the_page_asks_for_is_there() {
        let all: Vec<&str> =
            ASSETS.iter().filter_map(|asset| std::str::from_utf8(asset.bytes).ok()).collect();
        let page = all[0];
        let named = page.split(['"', '\'']).filter(|word| word.ends_with(".js") || word.ends_with(".css"));
        let imported = all.iter().flat_map(|text| text.split('"')).filter_map(|word| word.strip_prefix("./"));
        let wanted: Vec<&str> = named.chain(imported.filter(|word| word.ends_with(".js"))).collect();
        assert!(wanted.len() > 8, "{wanted:?}");
        for name in wanted {
            assert!(ASSETS.iter().any(|asset| asset.path.strip_prefix('/') == Some(name)), "{name}");
        }
        // Nothing in the page itself that the content security policy would not let run.
        assert!(!page.contains("onclick") && !page.contains("<script>") && !page.contains("style="));
    }
}
