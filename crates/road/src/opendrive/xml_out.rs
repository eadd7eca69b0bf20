//! The model's records as XML text. Numbers are written with all their digits.

use core::fmt::Write as _;

use super::model::{Contact, Header, Junction, Lane, LaneOutline, LaneSection, Link, RoadRecord};
use crate::{Cubics, Line, Placed, Shape};

/// The text being written.
pub(super) struct Xml(String);

impl Xml {
    pub(super) fn new(header: &Header) -> Self {
        let mut out =
            Self(String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<OpenDRIVE>\n"));
        let (major, minor) = (header.rev_major, header.rev_minor);
        let name = escape(&header.name);
        out.line(&format!("<header revMajor=\"{major}\" revMinor=\"{minor}\" name=\"{name}\">"));
        let geo = &header.geo_reference;
        if !geo.projection.is_empty() {
            let text = escape(&geo.projection);
            out.line(&format!("<geoReference>{text}</geoReference>"));
            let ([x, y, z], heading) = (geo.offset_m, geo.offset_heading_rad);
            out.line(&format!("<offset x=\"{x}\" y=\"{y}\" z=\"{z}\" hdg=\"{heading}\"/>"));
        }
        out.line("</header>");
        out
    }

    fn line(&mut self, text: &str) {
        self.0.push_str(text);
        self.0.push('\n');
    }

    pub(super) fn finish(mut self) -> String {
        self.line("</OpenDRIVE>");
        self.0
    }

    pub(super) fn road(&mut self, r: &RoadRecord) {
        let (id, name) = (escape(&r.id), escape(&r.name));
        let junction = escape(r.junction.as_deref().unwrap_or("-1"));
        let rule = if r.left_hand { "LHT" } else { "RHT" };
        let length = r.length_m;
        self.line(&format!(
            "<road name=\"{name}\" length=\"{length}\" id=\"{id}\" junction=\"{junction}\" rule=\"{rule}\">"
        ));
        self.line("<link>");
        self.link("predecessor", r.predecessor.as_ref());
        self.link("successor", r.successor.as_ref());
        self.line("</link>");
        for (i, (s, kind)) in r.types.iter().enumerate() {
            self.line(&format!("<type s=\"{s}\" type=\"{}\">", escape(kind)));
            if let Some(limit) = r.speed_limits.get(i) {
                let max = limit_text(limit.1);
                self.line(&format!("<speed max=\"{max}\" unit=\"m/s\"/>"));
            }
            self.line("</type>");
        }
        self.line("<planView>");
        for e in &r.plan {
            self.element(e);
        }
        self.line("</planView>");
        self.profiles(&r.line);
        self.line("<lanes>");
        self.cubics("laneOffset", "s", &r.lane_offset);
        for section in &r.sections {
            self.section(r, section);
        }
        self.line("</lanes>");
        self.line("<objects>");
        for (i, o) in r.objects.iter().enumerate() {
            let (kind, name, s) = (escape(&o.kind), escape(&o.name), o.s_start_m);
            let length = o.s_end_m - o.s_start_m;
            self.line(&format!(
                "<{kind} s=\"{s}\" length=\"{length}\" name=\"{name}\" id=\"{i}\" type=\"standard\"/>"
            ));
        }
        self.line("</objects>");
        self.line("</road>");
    }

    pub(super) fn junction(&mut self, j: &Junction) {
        let kind = if j.direct { " type=\"direct\"" } else { "" };
        let key = if j.direct { "linkedRoad" } else { "connectingRoad" };
        let (id, name) = (escape(&j.id), escape(&j.name));
        self.line(&format!("<junction id=\"{id}\" name=\"{name}\"{kind}>"));
        for (i, c) in j.connections.iter().enumerate() {
            let (incoming, connecting) = (escape(&c.incoming_road), escape(&c.connecting_road));
            let end = contact(c.contact);
            self.line(&format!(
                "<connection id=\"{i}\" incomingRoad=\"{incoming}\" {key}=\"{connecting}\" contactPoint=\"{end}\">"
            ));
            for (from, to) in &c.lane_links {
                self.line(&format!("<laneLink from=\"{from}\" to=\"{to}\"/>"));
            }
            self.line("</connection>");
        }
        self.line("</junction>");
    }

    fn link(&mut self, name: &str, link: Option<&Link>) {
        match link {
            None => {}
            Some(Link::Junction { id }) => {
                let id = escape(id);
                self.line(&format!("<{name} elementType=\"junction\" elementId=\"{id}\"/>"));
            }
            Some(Link::Road { id, contact: end }) => {
                let (id, end) = (escape(id), contact(*end));
                self.line(&format!(
                    "<{name} elementType=\"road\" elementId=\"{id}\" contactPoint=\"{end}\"/>"
                ));
            }
        }
    }

    fn element(&mut self, e: &Placed) {
        let Placed { s_m, x_m, y_m, heading_rad, length_m, shape } = e;
        self.line(&format!(
            "<geometry s=\"{s_m}\" x=\"{x_m}\" y=\"{y_m}\" hdg=\"{heading_rad}\" length=\"{length_m}\">"
        ));
        let text = match shape {
            Shape::Line => "<line/>".into(),
            Shape::Arc { curvature_1_m } => format!("<arc curvature=\"{curvature_1_m}\"/>"),
            Shape::Spiral { start_1_m, end_1_m } => {
                format!("<spiral curvStart=\"{start_1_m}\" curvEnd=\"{end_1_m}\"/>")
            }
            Shape::Poly3 { v } => format!("<poly3{}/>", coefficients(*v, "")),
            Shape::ParamPoly3 { u, v, normalized } => {
                let range = if *normalized { "normalized" } else { "arcLength" };
                let (u, v) = (coefficients(*u, "U"), coefficients(*v, "V"));
                format!("<paramPoly3{u}{v} pRange=\"{range}\"/>")
            }
        };
        self.line(&text);
        self.line("</geometry>");
    }

    fn profiles(&mut self, line: &Line) {
        self.line("<elevationProfile>");
        self.cubics("elevation", "s", line.elevation());
        self.line("</elevationProfile>\n<lateralProfile>");
        self.cubics("superelevation", "s", line.bank());
        self.line("</lateralProfile>");
    }

    fn cubics(&mut self, record: &str, station: &str, cubics: &Cubics) {
        for (s, c) in cubics.pieces() {
            self.line(&format!("<{record} {station}=\"{s}\"{}/>", coefficients(c, "")));
        }
    }

    fn section(&mut self, road: &RoadRecord, section: &LaneSection) {
        self.line(&format!("<laneSection s=\"{}\">", section.s_m));
        for (side, sign) in [("left", 1), ("center", 0), ("right", -1)] {
            if sign == 0 {
                self.line("<center><lane id=\"0\" type=\"none\" level=\"false\"/></center>");
                continue;
            }
            self.line(&format!("<{side}>"));
            for lane in section.lanes.iter().filter(|l| l.id.signum() == sign) {
                self.lane(road, section, lane);
            }
            self.line(&format!("</{side}>"));
        }
        self.line("</laneSection>");
    }

    fn lane(&mut self, road: &RoadRecord, section: &LaneSection, lane: &Lane) {
        let kind = escape(&lane.kind);
        self.line(&format!("<lane id=\"{}\" type=\"{kind}\" level=\"false\">", lane.id));
        self.line("<link>");
        for (name, ids) in [("predecessor", &lane.predecessors), ("successor", &lane.successors)] {
            for id in ids {
                self.line(&format!("<{name} id=\"{id}\"/>"));
            }
        }
        self.line("</link>");
        match &lane.outline {
            LaneOutline::Width(c) => self.cubics("width", "sOffset", c),
            LaneOutline::Border(c) => self.cubics("border", "sOffset", c),
        }
        let mut limits = lane.speed_limits.clone();
        if limits.is_empty() && lane.is_drivable() {
            let here = |s: f64| road.lane_limit_m_s(section, lane, s).map(|v| (s - section.s_m, v));
            let inside = |s: &f64| *s > section.s_m && *s < section.end_m;
            let later = road.speed_limits.iter().map(|l| l.0).filter(inside);
            limits = core::iter::once(section.s_m).chain(later).filter_map(here).collect();
        }
        for (s, limit) in limits {
            let max = limit_text(limit);
            self.line(&format!("<speed sOffset=\"{s}\" max=\"{max}\" unit=\"m/s\"/>"));
        }
        self.line("</lane>");
    }
}

const fn contact(contact: Contact) -> &'static str {
    match contact {
        Contact::Start => "start",
        Contact::End => "end",
    }
}

fn limit_text(limit_m_s: f64) -> String {
    if limit_m_s.is_finite() { limit_m_s.to_string() } else { "no limit".into() }
}

fn coefficients(values: [f64; 4], suffix: &str) -> String {
    let mut out = String::new();
    for (letter, value) in ["a", "b", "c", "d"].into_iter().zip(values) {
        // Writing to a String cannot fail.
        let _ = write!(out, " {letter}{suffix}=\"{value}\"");
    }
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
