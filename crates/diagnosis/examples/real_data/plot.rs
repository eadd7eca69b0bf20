//! Line and point pictures as SVG, for the documentation.

use std::fmt::Write as _;
use std::path::Path;

/// One panel: axes with lines and points.
pub(crate) struct Panel<'a> {
    pub(crate) title: &'a str,
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    pub(crate) series: Vec<Series<'a>>,
}

/// Points in order; without a name they belong to the series before them.
pub(crate) struct Series<'a> {
    pub(crate) name: &'a str,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) line: bool,
}

const COLOURS: [&str; 5] = ["#1f5fa8", "#d1602a", "#3a8f4d", "#8a4fa0", "#777777"];
const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 240.0;
const LEFT: f64 = 64.0;

/// Round distance of grid lines for about `count` of them.
fn step(span: f64, count: f64) -> f64 {
    let raw = span / count;
    let power = 10.0_f64.powf(raw.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(raw)
}

/// Writes panels below each other.
pub(crate) fn write(path: &Path, panels: &[Panel<'_>]) -> std::io::Result<()> {
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {}' font-family='sans-serif' font-size='12'>\n<rect width='100%' height='100%' fill='white'/>\n",
        panels.len() as f64 * (HEIGHT + 70.0)
    );
    for (k, panel) in panels.iter().enumerate() {
        draw(&mut svg, panel, k as f64 * (HEIGHT + 70.0) + 30.0);
    }
    svg.push_str("</svg>\n");
    std::fs::write(path, svg)
}

fn draw(svg: &mut String, panel: &Panel<'_>, top: f64) {
    let all = || {
        panel.series.iter().flat_map(|s| &s.points).filter(|p| p.0.is_finite() && p.1.is_finite())
    };
    let range = |f: fn(&(f64, f64)) -> f64| {
        let (lo, hi) =
            all().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |r, v| (r.0.min(v), r.1.max(v)));
        let pad = 0.04 * (hi - lo).max(1e-9);
        (lo - pad, hi + pad)
    };
    let ((x0, x1), (y0, y1)) = (range(|p| p.0), range(|p| p.1));
    let px = |x: f64| LEFT + (x - x0) / (x1 - x0) * (WIDTH - LEFT - 10.0);
    let py = |y: f64| top + HEIGHT - (y - y0) / (y1 - y0) * HEIGHT;
    let bottom = top + HEIGHT;
    let mut put = |line: String| {
        svg.push_str(&line);
        svg.push('\n');
    };
    put(format!("<text x='{LEFT}' y='{}' font-weight='bold'>{}</text>", top - 10.0, panel.title));
    for (lo, hi, vertical) in [(x0, x1, true), (y0, y1, false)] {
        let s = step(hi - lo, if vertical { 8.0 } else { 5.0 });
        // Adding zero turns a negative zero into zero.
        let mut v = (lo / s).ceil() * s + 0.0;
        while v <= hi {
            let digits = (-s.log10().floor()).max(0.0) as usize;
            let (x, y) = (px(v), py(v));
            put(if vertical {
                format!(
                    "<line x1='{x:.1}' y1='{top}' x2='{x:.1}' y2='{bottom}' stroke='#eee'/><text x='{x:.1}' y='{:.1}' text-anchor='middle'>{v:.digits$}</text>",
                    bottom + 16.0
                )
            } else {
                format!(
                    "<line x1='{LEFT}' y1='{y:.1}' x2='{}' y2='{y:.1}' stroke='#eee'/><text x='{}' y='{:.1}' text-anchor='end'>{v:.digits$}</text>",
                    WIDTH - 10.0,
                    LEFT - 6.0,
                    y + 4.0
                )
            });
            v += s;
        }
    }
    put(format!(
        "<text x='{}' y='{}' text-anchor='middle'>{}</text>",
        0.5 * (WIDTH + LEFT),
        bottom + 32.0,
        panel.x
    ));
    let middle = top + 0.5 * HEIGHT;
    put(format!(
        "<text x='14' y='{middle}' text-anchor='middle' transform='rotate(-90 14 {middle})'>{}</text>",
        panel.y
    ));
    // Names stand in the right corner that holds less
    let right = |upper: bool| {
        all().filter(|p| p.0 > 0.5 * (x0 + x1) && (p.1 > 0.5 * (y0 + y1)) == upper).count()
    };
    let named = panel.series.iter().filter(|s| !s.name.is_empty()).count();
    let first =
        if right(true) > right(false) { bottom - 15.0 * named as f64 + 8.0 } else { top + 14.0 };
    let mut names = 0;
    for s in &panel.series {
        if !s.name.is_empty() {
            names += 1;
        }
        let colour = COLOURS[(names.max(1) - 1) % COLOURS.len()];
        let mut path = String::new();
        if s.line {
            for (x, y) in &s.points {
                let _ = write!(path, "{:.1},{:.1} ", px(*x), py(*y));
            }
            put(format!(
                "<polyline points='{path}' fill='none' stroke='{colour}' stroke-width='1.2'/>"
            ));
        } else {
            for (x, y) in &s.points {
                put(format!(
                    "<circle cx='{:.1}' cy='{:.1}' r='2' fill='{colour}' fill-opacity='0.5'/>",
                    px(*x),
                    py(*y)
                ));
            }
        }
        if !s.name.is_empty() {
            put(format!(
                "<text x='{}' y='{}' text-anchor='end' fill='{colour}'>{}</text>",
                WIDTH - 12.0,
                first + 15.0 * (names - 1) as f64,
                s.name
            ));
        }
    }
}
