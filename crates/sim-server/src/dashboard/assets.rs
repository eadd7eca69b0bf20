//! The page, embedded in the binary.

use std::sync::LazyLock;

use axum::http::header;
use axum::response::{IntoResponse, Response};

use crate::picture::plotly_js;

const HTML: &str = include_str!("page/index.html");
/// Style sheets and modules of the page by path.
const FILES: [(&str, &str, &str); 10] = [
    ("/assets/theme.css", STYLE, include_str!("page/theme.css")),
    ("/assets/style.css", STYLE, include_str!("page/style.css")),
    ("/assets/app.js", SCRIPT, include_str!("page/app.js")),
    ("/assets/ahead.js", SCRIPT, include_str!("page/ahead.js")),
    ("/assets/controls.js", SCRIPT, include_str!("page/controls.js")),
    ("/assets/minimap.js", SCRIPT, include_str!("page/minimap.js")),
    ("/assets/strips.js", SCRIPT, include_str!("page/strips.js")),
    ("/assets/theme.js", SCRIPT, include_str!("page/theme.js")),
    ("/assets/view.js", SCRIPT, include_str!("page/view.js")),
    ("/assets/words.js", SCRIPT, include_str!("page/words.js")),
];

static PLOTLY: LazyLock<String> = LazyLock::new(plotly_js);

/// The link to the report, hidden and shown.
const LINK: [&str; 2] =
    ["<a id=\"report\" href=\"/report\" hidden>", "<a id=\"report\" href=\"/report\">"];
static HTML_WITH_REPORT: LazyLock<String> = LazyLock::new(|| HTML.replace(LINK[0], LINK[1]));

/// One embedded file by its path; none if there is no such file. The page links to a report if
/// there is one.
pub(super) fn asset(path: &str, report: bool) -> Option<Response> {
    let (kind, body): (_, &'static str) = match path {
        "/" if report => ("text/html; charset=utf-8", HTML_WITH_REPORT.as_str()),
        "/" => ("text/html; charset=utf-8", HTML),
        "/assets/plotly.js" => (SCRIPT, PLOTLY.as_str()),
        _ => FILES.iter().find(|f| f.0 == path).map(|f| (f.1, f.2))?,
    };
    Some(
        ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], body).into_response(),
    )
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
