//! The road that was driven, and where on it a fix lies.

use road::{GeoReference, Road};

use crate::{DiagnosisError, Table};

/// Step of the map table, m.
const MAP_STEP_M: f64 = 5.0;
/// A fix farther off the reference line is not on the road, m.
const OFF_ROAD_M: f64 = 30.0;

/// From latitude and longitude, deg, to a map, m.
pub type Project = Box<dyn Fn(f64, f64) -> [f64; 2]>;

/// The road that was driven.
pub struct Map {
    pub(super) name: String,
    pub(super) road: Road,
    pub(super) place: Place,
}

/// How the place on the road is found.
pub(super) enum Place {
    /// By satellite fixes.
    Fixes(Project),
    /// By the wheels, from this station, m.
    From(f64),
}

impl Map {
    /// A road; the wheels count from `start_s_m`, else satellite fixes say where on it a drive is.
    ///
    /// # Errors
    /// [`DiagnosisError::Map`]: no road, a start behind its end, or fixes on a road that does not
    /// say where on earth it lies.
    pub fn load(
        name: &str,
        start_s_m: Option<f64>,
        project: &dyn Fn(&GeoReference) -> Result<Project, String>,
    ) -> Result<Self, DiagnosisError> {
        let bad = |why: String| DiagnosisError::Map { map: name.to_owned(), why };
        let road = Road::load(name).map_err(|e| DiagnosisError::Road(e.to_string()))?;
        let place = match (start_s_m, road.geo_reference()) {
            (Some(start_m), _) if !(0.0..road.length_m()).contains(&start_m) => {
                let length_m = road.length_m();
                return Err(bad(format!(
                    "the drive begins at {start_m} m, the road ends at {length_m:.0} m"
                )));
            }
            (Some(start_m), _) => Place::From(start_m),
            (None, Some(reference)) => Place::Fixes(project(reference).map_err(bad)?),
            (None, None) => {
                return Err(bad("the road does not say where on earth it lies; say where on it \
                                the drive begins (start-s-m)"
                    .to_owned()));
            }
        };
        Ok(Self { name: name.to_owned(), road, place })
    }

    pub(super) fn station_m(
        &self,
        latitude_deg: f64,
        longitude_deg: f64,
        hint_m: Option<f64>,
    ) -> Option<f64> {
        let Place::Fixes(project) = &self.place else { return None };
        let [x_m, y_m] = project(latitude_deg, longitude_deg);
        let at = self.road.project(x_m, y_m, hint_m)?;
        (at.d_m.abs() <= OFF_ROAD_M).then_some(at.s_m)
    }

    pub(super) fn table(&self) -> Table {
        let mut table = Table::new("map".to_owned(), &["s_m", "grade_frac", "curvature_1_m"]);
        let steps = (self.road.length_m() / MAP_STEP_M) as usize;
        for k in 0..=steps {
            let at = self.road.at(MAP_STEP_M * k as f64, 0.0);
            table.push(&[MAP_STEP_M * k as f64, at.grade_rad.tan(), at.curvature_1_m]);
        }
        table
    }
}
