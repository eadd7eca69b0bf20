//! The truck file of a data sheet.

use super::DataSheet;
use super::figures::{Figures, rolling_radius_m};
use crate::{DynamicsError, KnownBy, TruckParameters};

/// Payload over the empty mass where a sheet does not say it.
const PAYLOAD_FRAC: f64 = 1.25;
/// Gears from which the second one is for pulling away.
const GEARS_OF_A_SPLITTER: usize = 9;
/// Clutches carry a fifth more than the largest torque.
const CLUTCH_RESERVE: f64 = 1.2;

/// Figures that sheets do not have: path, spread over the figure where the catalogue of causes says
/// none, and why such a figure.
const USUAL: &[(&str, f64, &str)] = &[
    ("driveline.axle_efficiency_frac", 0.01, "usual"),
    ("driveline.gearbox_efficiency_frac", 0.01, "usual"),
    ("brake.gain_n_pa", 0.2, "of a truck of this kind"),
    ("brake.dead_time_s", 0.3, "of a truck of this kind"),
    ("shift.open_s", 0.3, "of an automated gearbox"),
    ("resistance.side_force_area_m2_rad", 0.25, "typical of tractor-semitrailers"),
    ("lateral.steering.lag_s", 0.5, "of a truck of this kind"),
    ("lateral.tyres.cornering_coeff_per_rad", 0.2, "of truck tyres"),
    ("lateral.tyres.stiffness_scale[0]", 0.2, "as the tyre formula has it"),
    ("lateral.tyres.stiffness_scale[1]", 0.2, "as the tyre formula has it"),
    ("lateral.tyres.stiffness_scale[2]", 0.2, "as the tyre formula has it"),
    ("lateral.payload.cg_behind_hitch_m", 0.1, "evenly loaded"),
];

impl DataSheet {
    /// The truck with its origins.
    ///
    /// # Errors
    /// [`DynamicsError::OutOfBounds`] with every figure that no truck can have.
    pub fn truck(&self) -> Result<TruckParameters, DynamicsError> {
        let base = if self.axles.drive_axles == 1 { "vecto-40t" } else { "longhaul" };
        let truck = TruckParameters::load(base)?;
        let mut figures = Figures { truck, sheet: &self.source };
        self.put_masses_and_lengths(&mut figures)?;
        self.put_driveline(&mut figures)?;
        self.engine.put(&mut figures)?;
        let r = &mut figures.truck.resistance;
        // one figure each: what VECTO's truck has beside them belongs to its own tyres and axle
        (r.rolling_per_speed_s_m, r.parasitic_force_n) = (0.0, 0.0);
        (r.rolling_coeff, r.drag_area_m2) = (0.0053, 5.4);
        let source = "tyres of class B, a tenth more on the road than on the drum";
        figures.answer("resistance.rolling_coeff", self.tyres.rolling_coeff, 0.2, source)?;
        let source = "tractor-semitrailers are certified with 5.0 to 6.0 m2";
        figures.answer("resistance.drag_area_m2", self.air.drag_area_m2, 0.15, source)?;
        let like = format!("of truck {base}");
        figures.answer("lateral.steering.ratio", self.steering.ratio, 0.1, &like)?;
        for (path, sigma_frac, source) in USUAL {
            figures.estimated(path, *sigma_frac, source);
        }
        let mut truck = figures.truck;
        let rest =
            format!("{}; what [provenance] does not name is that of truck {base}", self.source);
        truck.name.clone_from(&self.name);
        truck.source.clone_from(&rest);
        truck.engine.source.clone_from(&rest);
        truck.driveline.source.clone_from(&rest);
        truck.resistance.source = rest;
        let text = text(&truck)?;
        TruckParameters::from_toml_str(&self.name, &text)
    }

    /// The truck as a file, with a comment at every estimate.
    ///
    /// # Errors
    /// As [`DataSheet::truck`].
    pub fn truck_file(&self) -> Result<String, DynamicsError> {
        Ok(commented(&self.truck()?, &text(&self.truck()?)?))
    }

    fn put_masses_and_lengths(&self, figures: &mut Figures<'_>) -> Result<(), DynamicsError> {
        let (m, a) = (&self.masses, &self.axles);
        let like = format!("of truck {}, by mass and length", figures.truck.name);
        let base = figures.truck.lateral;
        let (tractor, trailer) = (base.tractor, base.trailer);
        let base_wheelbase_m = tractor.steer_axle_ahead_of_cg_m + tractor.drive_group_behind_cg_m;
        figures.said("lateral.tractor.mass_kg", m.tractor_kg)?;
        figures.said("lateral.trailer.mass_kg", m.trailer_kg)?;
        let empty_kg = m.tractor_kg + m.trailer_kg;
        figures
            .set("lateral.payload.mass_kg", (PAYLOAD_FRAC * empty_kg / 500.0).round() * 500.0)?;
        let source = "usual; every drive says its own";
        figures.answer("lateral.payload.mass_kg", m.payload_kg, 0.5, source)?;
        let steer_frac = m
            .steer_axle_load_kg
            .map_or(tractor.drive_group_behind_cg_m / base_wheelbase_m, |load_kg| {
                load_kg / m.tractor_kg
            });
        let behind_m = steer_frac * a.wheelbase_m;
        let (ahead, behind) =
            ("lateral.tractor.steer_axle_ahead_of_cg_m", "lateral.tractor.drive_group_behind_cg_m");
        figures.set(ahead, a.wheelbase_m - behind_m)?;
        figures.set(behind, behind_m)?;
        let said = m.steer_axle_load_kg.is_some();
        figures.answer(ahead, said.then_some(a.wheelbase_m - behind_m), 0.1, &like)?;
        figures.answer(behind, said.then_some(behind_m), 0.1, &like)?;
        let stretch = a.wheelbase_m / base_wheelbase_m;
        let yaw_kg_m2 =
            tractor.yaw_inertia_kg_m2 * m.tractor_kg / tractor.mass_kg * stretch * stretch;
        figures.set("lateral.tractor.yaw_inertia_kg_m2", yaw_kg_m2.round())?;
        figures.estimated("lateral.tractor.yaw_inertia_kg_m2", 0.2, &like);
        let half_m = match (a.drive_axles, a.drive_axle_distance_m) {
            (1, _) => 0.0,
            (_, Some(distance_m)) => 0.5 * distance_m,
            (_, None) => tractor.drive_half_spread_m,
        };
        figures.set("lateral.tractor.drive_half_spread_m", half_m)?;
        let ahead_m = a
            .fifth_wheel_ahead_m
            .unwrap_or(tractor.drive_group_behind_cg_m - tractor.hitch_behind_cg_m);
        let hitch = "lateral.tractor.hitch_behind_cg_m";
        figures.set(hitch, behind_m - ahead_m)?;
        figures.answer(hitch, a.fifth_wheel_ahead_m.map(|x| behind_m - x), 0.1, &like)?;
        let length = "lateral.trailer.axle_group_behind_hitch_m";
        figures.answer(length, a.kingpin_to_trailer_axles_m, 0.05, &like)?;
        let stretch = a
            .kingpin_to_trailer_axles_m
            .map_or(1.0, |length_m| length_m / trailer.axle_group_behind_hitch_m);
        let spread = "lateral.trailer.axle_half_spread_m";
        figures.answer(spread, a.trailer_axle_distance_m, 0.05, &like)?;
        for (path, now) in [
            ("lateral.trailer.cg_behind_hitch_m", trailer.cg_behind_hitch_m),
            ("lateral.payload.cg_behind_hitch_m", base.payload.cg_behind_hitch_m),
        ] {
            figures.set(path, stretch * now)?;
            figures.estimated(path, 0.1, &like);
        }
        let yaw_kg_m2 =
            trailer.yaw_inertia_kg_m2 * m.trailer_kg / trailer.mass_kg * stretch * stretch;
        figures.set("lateral.trailer.yaw_inertia_kg_m2", yaw_kg_m2.round())?;
        figures.estimated("lateral.trailer.yaw_inertia_kg_m2", 0.2, &like);
        figures.answer("body.width_m", a.width_m, 0.02, "usual")
    }

    fn put_driveline(&self, figures: &mut Figures<'_>) -> Result<(), DynamicsError> {
        let d = &self.driveline;
        figures.truck.driveline.gear_ratios.clone_from(&d.gear_ratios);
        figures.listed("driveline.gear_ratios");
        figures.said("driveline.final_drive_ratio", d.final_drive_ratio)?;
        let radius = "driveline.wheel_radius_m";
        match (self.tyres.rolling_radius_m, &self.tyres.drive_size) {
            (Some(radius_m), _) => figures.said(radius, radius_m)?,
            (None, Some(size)) => {
                let radius_m = rolling_radius_m(size).unwrap_or(f64::NAN);
                figures.set(radius, (1e4 * radius_m).round() / 1e4)?;
                let source = format!("tyres {size}, circumference 3.03 diameters");
                figures.estimated(radius, 0.015, &source);
            }
            (None, None) => {}
        }
        let truck = &mut figures.truck.driveline;
        truck.launch_gear = if d.gear_ratios.len() < GEARS_OF_A_SPLITTER { 1 } else { 2 };
        let torque_nm = self.engine.full_load_torque_nm.iter().flatten().copied();
        let torque_nm = torque_nm.fold(self.engine.max_torque_nm.unwrap_or(0.0), f64::max);
        truck.clutch_torque_nm = truck.clutch_torque_nm.max(CLUTCH_RESERVE * torque_nm);
        // no retarder where the sheet has none
        figures.said("driveline.retarder_torque_nm", d.retarder_torque_nm.unwrap_or(0.0))
    }
}

fn text(truck: &TruckParameters) -> Result<String, DynamicsError> {
    toml::to_string(truck).map_err(|e| DynamicsError::Parse {
        name: truck.name.clone(),
        why: format!("cannot be written: {e}"),
    })
}

/// A truck file with a comment at every figure that is an estimate.
fn commented(truck: &TruckParameters, text: &str) -> String {
    let estimates = truck.provenance.values().filter(|o| o.known_by == KnownBy::Estimate).count();
    let mut out = format!(
        "# Truck {}, made of its data sheet by `sim-server truck new`.\n\
         # {estimates} figures are estimates: nobody said them. [provenance] has the source and the\n\
         # standard deviation of each; `sim-server identify` puts what drives say in their place.\n\n",
        truck.name
    );
    let mut block = String::new();
    for line in text.lines() {
        out.push_str(line);
        if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
            block = format!("{name}.");
        } else if let Some((key, _)) = line.split_once(" = ")
            && let Some(origin) = truck.provenance.get(&format!("{block}{key}"))
            && origin.known_by == KnownBy::Estimate
        {
            let sigma = origin.sigma.unwrap_or(f64::NAN);
            out.push_str(&format!(" # estimate, sd {}: {}", short(sigma), origin.source));
        }
        out.push('\n');
    }
    out
}

/// Two digits.
fn short(x: f64) -> String {
    let text = format!("{x:.1e}");
    text.parse::<f64>().map_or(text, |x| x.to_string())
}
