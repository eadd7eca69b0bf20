//! The page, embedded in the binary.

use std::sync::LazyLock;

use axum::http::header;
use axum::response::{IntoResponse, Response};

use crate::picture::plotly_js;

const HTML: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/style.css");
const APP: &str = include_str!("page/app.js");
const VIEW: &str = include_str!("page/view.js");
const STRIPS: &str = include_str!("page/strips.js");

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
        "/assets/style.css" => ("text/css; charset=utf-8", STYLE),
        "/assets/app.js" => (SCRIPT, APP),
        "/assets/view.js" => (SCRIPT, VIEW),
        "/assets/strips.js" => (SCRIPT, STRIPS),
        "/assets/plotly.js" => (SCRIPT, PLOTLY.as_str()),
        _ => return None,
    };
    Some(
        ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], body).into_response(),
    )
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
