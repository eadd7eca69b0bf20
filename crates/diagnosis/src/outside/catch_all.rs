//! Forces that the catalogue does not name, but that any error of the road load, the driveline or
//! the load resembles. Where one of them adds much to named causes, these stand in for something
//! else: a headwind explained as drag leaves a force that grows with speed. Winds differ from drive
//! to drive in trucks that are in order, so forces that follow the heading are left out.

use nalgebra::DVector;
use tractrix_core::{GRAVITY_M_S2, RPM_PER_RAD_S};

use crate::Drive;
use crate::problem::Problem;
use crate::problem::course::Course;
use crate::problem::stats::evidence;
use crate::replay::{Module, Prepared};
use crate::search::free::{directions, prior};
use crate::search::refit::Fit;

/// Prior deviations: a force, N; a force per mass, m/s²; the speed that forms are scaled with, m/s.
const FORCE_N: f64 = 500.0;
const PER_MASS_M_S2: f64 = 0.012;
const USUAL_M_S: f64 = 20.0;
/// Time constant of what fades after the start, s.
const FADES_S: f64 = 1200.0;

/// What is known of the truck at a sample.
struct At<'a> {
    d: &'a Prepared,
    i: usize,
    reference_torque_nm: f64,
}

impl At<'_> {
    /// Acceleration by a force of one prior deviation, m/s².
    fn force(&self) -> f64 {
        FORCE_N / self.d.mass_kg
    }

    /// Speed over the usual.
    fn speed(&self) -> f64 {
        self.d.speed[self.i] / USUAL_M_S
    }

    /// Acceleration by a torque at the crank, m/s².
    fn crank(&self, torque_nm: f64) -> f64 {
        let turns_rad_m = self.d.rpm[self.i] / RPM_PER_RAD_S / self.d.speed[self.i].max(2.0);
        torque_nm * turns_rad_m / self.d.mass_kg
    }

    /// What is left of an acceleration that fades after the start, m/s².
    fn fading(&self) -> f64 {
        PER_MASS_M_S2 * (-(self.i as f64) * Drive::STEP_S / FADES_S).exp()
    }
}

/// A form in words, the signal that it follows, and its acceleration at one prior deviation, m/s².
type Form = (&'static str, &'static str, fn(&At<'_>) -> f64);

const FORMS: &[Form] =
    &[
        ("a constant force", "speed_m_s", |x| x.force()),
        ("a force that grows with speed", "speed_m_s", |x| x.force() * x.speed()),
        ("a force that grows with the square of speed", "speed_m_s", |x| {
            x.force() * x.d.density[x.i] * x.speed() * x.speed()
        }),
        ("a force that grows with the load", "reported_mass_kg", |_| PER_MASS_M_S2),
        ("a force that grows with load and speed", "speed_m_s", |x| PER_MASS_M_S2 * x.speed()),
        ("a factor on the grade", "grade_frac", |x| 0.05 * GRAVITY_M_S2 * x.d.grade[x.i]),
        ("a factor on the engine's pull", "engine_torque_percent", |x| {
            x.crank(0.03 * 0.01 * x.d.torque[x.i].max(0.0) * x.reference_torque_nm)
        }),
        ("a torque at the crank", "engine_speed_rpm", |x| x.crank(50.0)),
        ("a force that fades after a cold start", "time_s", |x| {
            if x.d.warm { 0.0 } else { x.fading() }
        }),
        ("a force that fades after the start", "time_s", |x| x.fading()),
        ("a factor on the brakes", "brake_pressure_kpa", |x| {
            40.0 * x.d.pressure[x.i] / x.d.mass_kg
        }),
        ("a force while the engine brakes", "engine_brake_frac", |x| {
            4.0 * x.force() * x.d.engine_brake[x.i]
        }),
    ];

/// A form that named causes leave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Left {
    pub(crate) words: &'static str,
    pub(crate) signal: &'static str,
    /// Evidence that it adds, the causes refitted, nats.
    pub(crate) evidence: f64,
}

impl Problem<'_> {
    /// The form that adds most to the fit; one prior deviation counts like that of a cause.
    pub(crate) fn catch_all(&self, fit: &Fit) -> Option<Left> {
        let m = Module::Force;
        let reference_torque_nm = self.plant.truck.engine.reference_torque_nm;
        let step = m.row_step();
        let columns = |i: usize| -> Vec<Vec<f64>> {
            let d = &self.drives[i];
            let row = |k: usize, form: &Form| {
                let at = |i| (form.2)(&At { d, i, reference_torque_nm });
                (k * step..(k + 1) * step).map(at).sum::<f64>() * Drive::STEP_S
            };
            let rows = &d.valid[m as usize];
            let column = |form: &Form| {
                let rows = rows.iter().enumerate();
                rows.map(|(k, ok)| if *ok { row(k, form) } else { 0.0 }).collect()
            };
            FORMS.iter().map(column).collect()
        };
        let mut along = directions(&fit.free, &fit.theta);
        let course = Course::of(&fit.sizes(), &mut along);
        let hats = fit.free.len() + 1..along.len() + 1;
        let gram = self.gram_beside(&fit.theta, &along, m, &columns);
        let keep: Vec<usize> =
            (0..=along.len() + FORMS.len()).filter(|j| !hats.contains(j)).collect();
        let gram = course.taken_out(&gram, &keep, &fit.theta, &self.reference.theta)?;
        let (a, b, _) = gram.total();
        // The residual at no effect in the linear model, as in the screen.
        let (k, zero) = (fit.free.len(), &self.reference.theta);
        let shift = DVector::from_fn(b.len(), |i, _| {
            fit.free.get(i).map_or(0.0, |p| fit.theta[*p as usize] - zero[*p as usize])
        });
        let b = &b + &a * &shift;
        let mut sigma = prior(&fit.free);
        sigma.push(1.0);
        let evidence_of = |keep: &[usize]| {
            let (a, b) = (evidence::sub(&a, keep), evidence::pick(&b, keep));
            evidence::linear(&a, &b, sigma.get(..keep.len())?).map(|x| x.0)
        };
        let mut keep: Vec<usize> = (0..k).collect();
        let own = evidence_of(&keep)?;
        let mut best: Option<Left> = None;
        for (j, (words, signal, _)) in FORMS.iter().enumerate() {
            keep.truncate(k);
            keep.push(k + j);
            let evidence = evidence_of(&keep)? - own;
            if best.is_none_or(|b| evidence > b.evidence) {
                best = Some(Left { words, signal, evidence });
            }
        }
        best
    }
}
