//! From latitude and longitude to the map: transverse Mercator on WGS 84.
//!
//! Krüger's series to the fourth order (C. F. F. Karney, "Transverse Mercator with an accuracy of a
//! few nanometers", J. Geodesy 85, 2011): below a millimetre within 3000 km of the meridian.

use alloc::format;
use alloc::string::{String, ToString};
use road::GeoReference;

use super::LocaliseError;

/// Semi-major axis of WGS 84 and GRS 80, m.
const A_M: f64 = 6_378_137.0;
/// Third flattening of WGS 84 (that of GRS 80 differs in the ninth digit: below 0.1 mm).
const N: f64 = 0.001_679_220_386_383_7;
/// Keys of a PROJ string that change nothing here.
const WITHOUT_EFFECT: [&str; 6] = ["no_defs", "type", "vunits", "towgs84", "wktext", "geoidgrids"];

/// The projection of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapProjection {
    lon_0_rad: f64,
    scale: f64,
    /// Projected coordinates of the origin, false easting and northing taken in, m.
    origin_m: [f64; 2],
    offset_m: [f64; 2],
    heading_rad: f64,
}

impl MapProjection {
    /// The projection that a map's file names: `+proj=tmerc` or `+proj=utm` on WGS 84 or GRS 80.
    ///
    /// # Errors
    /// [`LocaliseError::Projection`] names what cannot be used.
    pub fn new(reference: &GeoReference) -> Result<Self, LocaliseError> {
        let refuse = |why: String| LocaliseError::Projection(why);
        let (mut lat_0, mut lon_0, mut scale) = (0.0, 0.0, 1.0);
        let (mut east_m, mut north_m, mut zone, mut kind, mut south) = (0.0, 0.0, None, "", false);
        for word in reference.projection.split_whitespace() {
            let (key, text) = word.trim_start_matches('+').split_once('=').unwrap_or((word, ""));
            let number = || match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(refuse(format!("{word}: not a number"))),
            };
            match (key.trim_start_matches('+'), text) {
                ("proj", "tmerc" | "utm") => kind = text,
                ("lat_0", _) => lat_0 = number()?,
                ("lon_0", _) => lon_0 = number()?,
                ("k" | "k_0", _) => scale = number()?,
                ("x_0", _) => east_m = number()?,
                ("y_0", _) => north_m = number()?,
                ("zone", _) => zone = Some(number()?),
                ("south", _) => south = true,
                ("ellps" | "datum", "WGS84" | "GRS80") | ("units", "m") => {}
                (key, _) if WITHOUT_EFFECT.contains(&key) => {}
                _ => return Err(refuse(format!("{word} is not supported"))),
            }
        }
        match (kind, zone) {
            ("tmerc", None) => {}
            ("utm", Some(zone)) if (1.0..=60.0).contains(&zone) => {
                (lat_0, lon_0, scale) = (0.0, 6.0 * zone - 183.0, 0.9996);
                (east_m, north_m) = (500_000.0, if south { 10_000_000.0 } else { 0.0 });
            }
            ("utm", _) => return Err(refuse("+proj=utm needs +zone=1 to 60".to_string())),
            _ => return Err(refuse("+proj=tmerc or +proj=utm is needed".to_string())),
        }
        if !(lat_0.abs() <= 90.0 && lon_0.abs() <= 360.0 && (0.5..2.0).contains(&scale)) {
            return Err(refuse(format!("{:?} is out of range", reference.projection)));
        }
        let [x_m, y_m, _] = reference.offset_m;
        let mut projection = Self {
            lon_0_rad: lon_0.to_radians(),
            scale,
            origin_m: [0.0; 2],
            offset_m: [x_m, y_m],
            heading_rad: reference.offset_heading_rad,
        };
        let [_, meridian_m] = projection.projected_m(lat_0, lon_0);
        projection.origin_m = [east_m, north_m - meridian_m];
        Ok(projection)
    }

    /// Map x and y, m.
    #[must_use]
    pub fn to_map_m(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        let [east_m, north_m] = self.projected_m(latitude_deg, longitude_deg);
        let (x, y) = (east_m - self.offset_m[0], north_m - self.offset_m[1]);
        let (sin, cos) = libm::sincos(self.heading_rad);
        [cos * x + sin * y, cos * y - sin * x]
    }

    /// Latitude and longitude, degrees, of a map point: [`Self::to_map_m`] turned round by Newton's
    /// method, below a millimetre. `None` where that does not come to an end: far outside of the
    /// projection's range, or for what is no number.
    #[must_use]
    pub fn on_earth_deg(&self, x_m: f64, y_m: f64) -> Option<[f64; 2]> {
        // A degree for the differences would be too coarse, less than this drowns in rounding
        const STEP_DEG: f64 = 1e-6;
        let mut at = [0.0, self.lon_0_rad.to_degrees()];
        for _ in 0..30 {
            let [x, y] = self.to_map_m(at[0], at[1]);
            let (dx, dy) = (x_m - x, y_m - y);
            if libm::hypot(dx, dy) < 1e-5 {
                return Some(at);
            }
            let north = self.to_map_m(at[0] + STEP_DEG, at[1]);
            let east = self.to_map_m(at[0], at[1] + STEP_DEG);
            let [xn, yn, xe, ye] = [north[0] - x, north[1] - y, east[0] - x, east[1] - y];
            let det = xn * ye - xe * yn;
            let latitude = at[0] + STEP_DEG * (dx * ye - dy * xe) / det;
            let longitude = at[1] + STEP_DEG * (dy * xn - dx * yn) / det;
            // Steps from the equator may shoot over a pole
            at = [latitude.clamp(-89.9, 89.9), longitude];
            if !(at[0].is_finite() && at[1].is_finite()) {
                return None;
            }
        }
        None
    }

    /// Heading of true north on the map, rad, counter-clockwise from x.
    #[must_use]
    pub fn north_rad(&self, latitude_deg: f64, longitude_deg: f64) -> f64 {
        let south = self.to_map_m(latitude_deg - 1e-5, longitude_deg);
        let north = self.to_map_m(latitude_deg + 1e-5, longitude_deg);
        libm::atan2(north[1] - south[1], north[0] - south[0])
    }

    fn projected_m(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        let n2 = N * N;
        let alpha = [
            N / 2.0 - 2.0 / 3.0 * n2 + 5.0 / 16.0 * n2 * N + 41.0 / 180.0 * n2 * n2,
            13.0 / 48.0 * n2 - 3.0 / 5.0 * n2 * N + 557.0 / 1440.0 * n2 * n2,
            61.0 / 240.0 * n2 * N - 103.0 / 140.0 * n2 * n2,
            49_561.0 / 161_280.0 * n2 * n2,
        ];
        let radius_m = A_M / (1.0 + N) * (1.0 + n2 / 4.0 + n2 * n2 / 64.0);
        let sin = libm::sin(latitude_deg.to_radians());
        let e = 2.0 * libm::sqrt(N) / (1.0 + N);
        let t = libm::sinh(libm::atanh(sin) - e * libm::atanh(e * sin));
        let (sin_l, cos_l) = libm::sincos(longitude_deg.to_radians() - self.lon_0_rad);
        let xi = libm::atan2(t, cos_l);
        let eta = libm::atanh(sin_l / libm::sqrt(1.0 + t * t));
        let (mut east, mut north) = (eta, xi);
        for (j, a) in (1..).zip(alpha) {
            let k = 2.0 * f64::from(j);
            east += a * libm::cos(k * xi) * libm::sinh(k * eta);
            north += a * libm::sin(k * xi) * libm::cosh(k * eta);
        }
        let scale_m = self.scale * radius_m;
        [scale_m * east + self.origin_m[0], scale_m * north + self.origin_m[1]]
    }
}
