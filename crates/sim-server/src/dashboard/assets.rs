//! The pages, embedded in the binary.

use std::sync::LazyLock;

use axum::http::header;
use axum::response::{IntoResponse, Response};

use crate::picture::plotly_js;

const HTML: &str = include_str!("page/index.html");
/// What stands around the pages of tables and forms.
const FRAME: &str = include_str!("page/frame.html");
/// Those pages: path, title and what stands on them.
const PAGES: [(&str, &str, &str); 4] = [
    ("/runs", "Runs", include_str!("page/runs.html")),
    ("/compare", "Compare", include_str!("page/compare.html")),
    ("/scenario", "Scenario", include_str!("page/scenario.html")),
    ("/bus", "Bus", include_str!("page/bus.html")),
];
/// Style sheets and modules by path.
const FILES: [(&str, &str, &str); 19] = [
    ("/assets/theme.css", STYLE, include_str!("page/theme.css")),
    ("/assets/style.css", STYLE, include_str!("page/style.css")),
    ("/assets/pages.css", STYLE, include_str!("page/pages.css")),
    ("/assets/app.js", SCRIPT, include_str!("page/app.js")),
    ("/assets/ahead.js", SCRIPT, include_str!("page/ahead.js")),
    ("/assets/bus.js", SCRIPT, include_str!("page/bus.js")),
    ("/assets/common.js", SCRIPT, include_str!("page/common.js")),
    ("/assets/compare.js", SCRIPT, include_str!("page/compare.js")),
    ("/assets/controls.js", SCRIPT, include_str!("page/controls.js")),
    ("/assets/minimap.js", SCRIPT, include_str!("page/minimap.js")),
    ("/assets/runs.js", SCRIPT, include_str!("page/runs.js")),
    ("/assets/scenario.js", SCRIPT, include_str!("page/scenario.js")),
    ("/assets/source.js", SCRIPT, include_str!("page/source.js")),
    ("/assets/strips.js", SCRIPT, include_str!("page/strips.js")),
    ("/assets/theme.js", SCRIPT, include_str!("page/theme.js")),
    ("/assets/timebar.js", SCRIPT, include_str!("page/timebar.js")),
    ("/assets/values.js", SCRIPT, include_str!("page/values.js")),
    ("/assets/view.js", SCRIPT, include_str!("page/view.js")),
    ("/assets/words.js", SCRIPT, include_str!("page/words.js")),
];

static PLOTLY: LazyLock<String> = LazyLock::new(plotly_js);

/// The link to the report, hidden and shown.
const LINK: [&str; 2] =
    ["<a id=\"report\" href=\"/report\" hidden>", "<a id=\"report\" href=\"/report\">"];
static LIVE: LazyLock<String> = LazyLock::new(|| HTML.replace("{{nav}}", &nav("/")));
static LIVE_WITH_REPORT: LazyLock<String> = LazyLock::new(|| LIVE.replace(LINK[0], LINK[1]));
static FRAMED: LazyLock<[String; PAGES.len()]> = LazyLock::new(|| {
    PAGES.map(|(path, title, body)| {
        let page = FRAME.replace("{{nav}}", &nav(path)).replace("{{title}}", title);
        page.replace("{{name}}", &path[1..]).replace("{{body}}", body)
    })
});

/// Links to all pages, seen from one of them.
fn nav(here: &str) -> String {
    let link = |(path, title): (&str, &str)| {
        let current = if path == here { " aria-current=\"page\"" } else { "" };
        format!("<a href=\"{path}\"{current}>{title}</a>")
    };
    let pages = PAGES.iter().map(|(path, title, _)| (*path, *title));
    std::iter::once(("/", "Live")).chain(pages).map(link).collect()
}

/// One embedded file by its path; none if there is no such file. The page links to a report if
/// there is one.
pub(super) fn asset(path: &str, report: bool) -> Option<Response> {
    let (kind, body): (_, &'static str) = match path {
        "/" if report => (PAGE, LIVE_WITH_REPORT.as_str()),
        "/" => (PAGE, LIVE.as_str()),
        "/assets/plotly.js" => (SCRIPT, PLOTLY.as_str()),
        _ => match PAGES.iter().position(|page| page.0 == path) {
            Some(number) => (PAGE, FRAMED.get(number)?.as_str()),
            None => FILES.iter().find(|f| f.0 == path).map(|f| (f.1, f.2))?,
        },
    };
    Some(
        ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], body).into_response(),
    )
}

const SCRIPT: &str = "text/javascript; charset=utf-8";
const PAGE: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
