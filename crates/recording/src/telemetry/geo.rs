//! Latitude, longitude and the earth's frame from a road's geo reference (PROJ string).
//!
//! The projection is evaluated by `proj4rs`. Heights are taken as they are in the map: without a
//! model of the geoid they may be up to 100 m off the ellipsoid's.

use proj4rs::proj::Proj;
use proj4rs::transform::transform;
use road::{GeoReference, Road};

use crate::error::RecordingError;
use crate::ros::standard::{Pose, Quaternion, Vector3};

const GEODETIC: &str = "+proj=longlat +datum=WGS84 +no_defs";
/// Earth-centred, earth-fixed (EPSG 4978).
const GEOCENTRIC: &str = "+proj=geocent +datum=WGS84 +units=m +no_defs";

/// A place on the earth, WGS 84.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OnEarth {
    pub(super) latitude_deg: f64,
    pub(super) longitude_deg: f64,
    pub(super) altitude_m: f64,
}

/// The map's projection, ready for use.
#[derive(Debug)]
pub struct Geodesy {
    reference: GeoReference,
    projection: Proj,
    geodetic: Proj,
    earth_from_map: Pose,
}

impl Geodesy {
    /// The projection of a road; none if it has no geo reference.
    ///
    /// # Errors
    /// [`RecordingError::GeoReference`] names the projection that cannot be used, and why.
    pub fn of(road: &Road) -> Result<Option<Self>, RecordingError> {
        let Some(reference) = road.geo_reference().cloned() else { return Ok(None) };
        let text = &reference.projection;
        let refused = |why: &str| RecordingError::GeoReference {
            projection: text.clone(),
            why: why.to_owned(),
        };
        let parse = |text: &str| Proj::from_proj_string(text).map_err(|e| refused(&e.to_string()));
        let projection = parse(text)?;
        if projection.is_latlong() || projection.is_geocent() {
            return Err(refused("the map's x and y would not be metres"));
        }
        let geocentric = parse(GEOCENTRIC)?;
        let start = road.at(0.0, 0.0);
        let earth_from_map = earth_from_map(&reference, &projection, &geocentric, start)
            .ok_or_else(|| refused("the road is outside its range"))?;
        let geodetic = parse(GEODETIC)?;
        Ok(Some(Self { reference, projection, geodetic, earth_from_map }))
    }

    /// Latitude, longitude and height of a map point; none outside the projection's range.
    pub(super) fn on_earth(&self, x_m: f64, y_m: f64, z_m: f64) -> Option<OnEarth> {
        let at = project(&self.reference, &self.projection, &self.geodetic, [x_m, y_m, z_m])?;
        let [longitude_rad, latitude_rad, altitude_m] = at;
        let (latitude_deg, longitude_deg) = (latitude_rad.to_degrees(), longitude_rad.to_degrees());
        Some(OnEarth { latitude_deg, longitude_deg, altitude_m })
    }

    /// Pose of the map in the earth-centred frame: exact at the road's start, where its x and y
    /// axes touch the ellipsoid. Away from it the earth is round (8 cm over 1 km).
    pub(super) const fn earth_from_map(&self) -> Pose {
        self.earth_from_map
    }
}

/// A map point in another system.
fn project(geo: &GeoReference, from: &Proj, to: &Proj, [x, y, z]: [f64; 3]) -> Option<[f64; 3]> {
    let [x, y, z] = geo.projected_m(x, y, z);
    let mut point = (x, y, z);
    transform(from, to, &mut point).ok()?;
    let point = [point.0, point.1, point.2];
    point.iter().all(|v| v.is_finite()).then_some(point)
}

/// The map's axes at a point of it, by differences over a metre, and its origin if they were
/// straight.
fn earth_from_map(geo: &GeoReference, from: &Proj, to: &Proj, at: road::RoadPoint) -> Option<Pose> {
    let [x, y, z] = [at.x_m, at.y_m, at.z_m];
    let earth = |x, y, z| project(geo, from, to, [x, y, z]);
    let here = earth(x, y, z)?;
    let ahead = minus(earth(x + 1.0, y, z)?, here);
    let up = unit(minus(earth(x, y, z + 1.0)?, here))?;
    let left = unit(cross(up, ahead))?;
    let orientation = Quaternion::from_axes(cross(left, up), left, up);
    let offset = orientation.turn(Vector3 { x, y, z });
    let position = Vector3 { x: here[0] - offset.x, y: here[1] - offset.y, z: here[2] - offset.z };
    Some(Pose { position, orientation })
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = a.iter().map(|v| v * v).sum::<f64>().sqrt();
    (length > 1e-6).then(|| a.map(|v| v / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn road(projection: &str, offset_m: [f64; 3]) -> Road {
        let geo =
            GeoReference { projection: projection.to_owned(), offset_m, offset_heading_rad: 0.0 };
        road::builtin::flat(1000.0).with_geo_reference(&geo)
    }

    /// On the central meridian the northing is k0 times the arc from the equator, so that
    /// 48.75301300 degrees north lie at 5,400,000 m (k0 = 0.9996, WGS 84).
    #[test]
    fn utm_gives_latitude_and_longitude() {
        let road = road("+proj=utm +zone=32 +datum=WGS84", [500_000.0, 5_400_000.0, 100.0]);
        let geodesy = Geodesy::of(&road).unwrap().unwrap();
        let at = geodesy.on_earth(0.0, 0.0, 20.0).unwrap();
        assert!((at.longitude_deg - 9.0).abs() < 1e-12);
        assert!((at.latitude_deg - 48.753_013_004).abs() < 1e-8);
        assert!((at.altitude_m - 120.0).abs() < 1e-6);
        let east = geodesy.on_earth(1000.0, 0.0, 20.0).unwrap();
        let radius_m =
            6_378_137.0 / (1.0 - 0.006_694_38 * at.latitude_deg.to_radians().sin().powi(2)).sqrt();
        let moved_m =
            (east.longitude_deg - 9.0).to_radians() * radius_m * at.latitude_deg.to_radians().cos();
        assert!((moved_m - 1000.0 / 0.9996).abs() < 0.1, "{moved_m}");
    }

    /// Closes the loop between two outputs: the earth-fixed position of `/tf_static` and `/fix`.
    #[test]
    fn the_map_stands_upright_on_the_earth_where_the_road_starts() {
        let road = road("+proj=utm +zone=32 +datum=WGS84", [600_000.0, 5_400_000.0, 0.0]);
        let geodesy = Geodesy::of(&road).unwrap().unwrap();
        let at = geodesy.on_earth(0.0, 0.0, 0.0).unwrap();
        let (lat, lon) = (at.latitude_deg.to_radians(), at.longitude_deg.to_radians());
        let up = geodesy.earth_from_map().orientation.turn(Vector3 { x: 0.0, y: 0.0, z: 1.0 });
        let normal = [lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin()];
        for (got, want) in [up.x, up.y, up.z].into_iter().zip(normal) {
            assert!((got - want).abs() < 1e-9, "{up:?} {normal:?}");
        }
        // East of the central meridian grid north points east of true north by about dlon sin(lat).
        let north = geodesy.earth_from_map().orientation.turn(Vector3 { x: 0.0, y: 1.0, z: 0.0 });
        let east = [-lon.sin(), lon.cos(), 0.0];
        let convergence = (lon - 9.0_f64.to_radians()) * lat.sin();
        let turned = north.x * east[0] + north.y * east[1];
        assert!((turned - convergence).abs() < 1e-4, "{turned} {convergence}");
    }

    #[test]
    fn what_cannot_be_projected_is_said_by_name() {
        for (text, why) in [
            ("+lat_0=49 +lon_0=8", "projection"),
            ("+proj=no_such", "no_such"),
            ("EPSG:25832", "EPSG:25832"),
            ("+proj=longlat +datum=WGS84", "metres"),
            ("PROJCS[\"WGS 84 / UTM zone 32N\"]", "PROJCS"),
            ("+proj=tmerc +nadgrids=/etc/hostname", "nadgrids"),
            ("+proj=utm +zone=99", "zone=99"),
            ("+proj=", "geoReference"),
            ("+ = =", "geoReference"),
        ] {
            let error = Geodesy::of(&road(text, [0.0; 3])).unwrap_err().to_string();
            assert!(error.contains(why), "{text}: {error}");
        }
        assert!(Geodesy::of(&road("", [0.0; 3])).unwrap().is_none());
    }
}
