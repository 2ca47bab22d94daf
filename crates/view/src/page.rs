//! The files of the page.

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
pub(crate) const MODULES: [(&str, &str); 16] = [
    ("colors.js", include_str!("static/colors.js")),
    ("bits.js", include_str!("static/bits.js")),
    ("rate_image.js", include_str!("static/rate_image.js")),
    ("sources.js", include_str!("static/sources.js")),
    ("plots.js", include_str!("static/plots.js")),
    ("image_view.js", include_str!("static/image_view.js")),
    ("labels.js", include_str!("static/labels.js")),
    ("page.js", include_str!("static/page.js")),
    ("address.js", include_str!("static/address.js")),
    ("drawing.js", include_str!("static/drawing.js")),
    ("player.js", include_str!("static/player.js")),
    ("pixel_panel.js", include_str!("static/pixel_panel.js")),
    ("region_panel.js", include_str!("static/region_panel.js")),
    ("defect_panel.js", include_str!("static/defect_panel.js")),
    ("file_panel.js", include_str!("static/file_panel.js")),
    ("app.js", include_str!("static/app.js")),
];

/// Returns the file at `path`, which is the path after the token.
pub(crate) fn file(path: &str) -> Option<PageFile> {
    let text = |content_type, text: &'static str| Some(PageFile { content_type, bytes: text.as_bytes() });
    match path {
        "" => text("text/html; charset=utf-8", INDEX),
        "icon.svg" => text("image/svg+xml", include_str!("static/icon.svg")),
        "style.css" => text("text/css; charset=utf-8", STYLE),
        _ => MODULES
            .iter()
            .find(|(name, _)| *name == path)
            .and_then(|(_, module)| text("text/javascript; charset=utf-8", module)),
    }
}
