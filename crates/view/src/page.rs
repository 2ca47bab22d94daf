//! The files of the page.

use std::sync::OnceLock;

/// A file of the page.
pub(crate) struct PageFile {
    pub(crate) content_type: &'static str,
    pub(crate) bytes: &'static [u8],
}

/// The HTML of the page.
pub(crate) const INDEX: &str = include_str!("static/index.html");

/// The styles of the page.
pub(crate) const STYLE: &str = include_str!("static/style.css");

/// The modules of the page. Each module imports only modules before it.
const MODULES: [&str; 16] = [
    include_str!("static/colors.js"),
    include_str!("static/bits.js"),
    include_str!("static/rate_image.js"),
    include_str!("static/sources.js"),
    include_str!("static/plots.js"),
    include_str!("static/image_view.js"),
    include_str!("static/labels.js"),
    include_str!("static/page.js"),
    include_str!("static/address.js"),
    include_str!("static/drawing.js"),
    include_str!("static/player.js"),
    include_str!("static/pixel_panel.js"),
    include_str!("static/region_panel.js"),
    include_str!("static/defect_panel.js"),
    include_str!("static/file_panel.js"),
    include_str!("static/app.js"),
];

/// Returns the modules as one module, without the lines that import and the words that export.
///
/// With one file, the browser waits for one request instead of several requests in a row.
pub(crate) fn code() -> &'static str {
    static CODE: OnceLock<String> = OnceLock::new();
    CODE.get_or_init(|| {
        let lines =
            MODULES.iter().flat_map(|module| module.lines()).filter(|line| !line.starts_with("import "));
        lines.map(|line| format!("{}\n", line.strip_prefix("export ").unwrap_or(line))).collect()
    })
}

/// Returns the file at `path`, which is the path after the token.
pub(crate) fn file(path: &str) -> Option<PageFile> {
    let text = |content_type, text: &'static str| Some(PageFile { content_type, bytes: text.as_bytes() });
    match path {
        "" => text("text/html; charset=utf-8", INDEX),
        "icon.svg" => text("image/svg+xml", include_str!("static/icon.svg")),
        "style.css" => text("text/css; charset=utf-8", STYLE),
        "app.js" => text("text/javascript; charset=utf-8", code()),
        _ => None,
    }
}
