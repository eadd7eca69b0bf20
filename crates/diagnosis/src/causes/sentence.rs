//! Words for a truck engineer.

use crate::outside::unknown::{Acts, Shape};
use crate::problem::Problem;
use crate::replay::{Module, Prepared};
use crate::studies::identify::SIGMAS_90;

/// The sentence of a cause of size `x`.
pub(crate) fn cause(id: &str, x: f64) -> String {
    let percent = (100.0 * x.abs()).round();
    let more = if x >= 0.0 { "higher" } else { "lower" };
    let scaled = |what: &str| format!("{what} is {percent} % {more} than modelled.");
    let side = if x >= 0.0 { "left" } else { "right" };
    match id {
        "rolling_resistance" => scaled("Rolling resistance"),
        "air_drag" => scaled("The drag area"),
        "headwind" => format!(
            "A steady {} of {:.1} m/s acts in all drives.",
            if x >= 0.0 { "headwind" } else { "tailwind" },
            x.abs()
        ),
        "wind" => format!("An earth-fixed wind of {x:.1} m/s blows in all drives."),
        "mass" => scaled("The true mass"),
        "grade_bias" => format!(
            "The map's grade is {:.2} % too {}.",
            100.0 * x.abs(),
            if x >= 0.0 { "low" } else { "high" }
        ),
        "map_shift" => format!(
            "The map is {:.0} m {} the road.",
            x.abs(),
            if x >= 0.0 { "ahead of" } else { "behind" }
        ),
        "tyre_warmup" => format!("Cold tyres roll {percent} % harder at the start and warm up."),
        "driveline_loss" => format!(
            "The driveline loses {:.1} % {} than modelled.",
            100.0 * x.abs(),
            if x >= 0.0 { "more" } else { "less" }
        ),
        "fan_load" => format!("An engine fan takes {x:.0} kW when the coolant is hot."),
        "dragging_brake" => {
            format!("A constant force of {x:.0} N holds the truck back: a dragging brake.")
        }
        "engine_friction" => scaled("Engine friction"),
        "altitude_derate" => {
            format!("Full-load torque falls by {:.1} % per 1000 m at altitude.", 100.0 * x)
        }
        "heat_derate" => {
            format!("Full-load torque falls by {:.1} % per 10 K in the heat.", 100.0 * x)
        }
        "turbo_lag" => format!(
            "Torque builds up {:.2} s {} than modelled.",
            x.abs(),
            if x >= 0.0 { "slower" } else { "faster" }
        ),
        "pedal_delay" => format!("The pedal acts {x:.2} s later than modelled."),
        "shift_duration" => {
            format!("Shifts last {:.2} s {}.", x.abs(), if x >= 0.0 { "longer" } else { "shorter" })
        }
        "fuel_map_low_load" => format!(
            "At low load the engine burns {percent} % {} fuel than modelled.",
            if x >= 0.0 { "more" } else { "less" }
        ),
        "brake_gain" => scaled("Brake force per pressure"),
        "engine_brake_torque" => scaled("The engine brake's torque"),
        "brake_fade" => format!(
            "Hot brakes lose {percent} % of their cold force per 100 K above where they fade."
        ),
        "brake_delay" => format!("The brakes answer {x:.2} s later than modelled."),
        "hidden_retarder" => "A retarder acts that the model does not have.".to_owned(),
        "fuel_flow_scale" => meter("fuel", x),
        "co2_scale" => meter("CO2", x),
        "speed_scale" => format!(
            "The wheel speed reads {:.1} % too {}.",
            100.0 * x.abs(),
            if x >= 0.0 { "high" } else { "low" }
        ),
        "yaw_rate_bias" => format!("The yaw-rate sensor has an offset of {x:.4} rad/s."),
        "steering_ratio" => scaled("The steering ratio"),
        "steering_offset" => format!(
            "The steering wheel stands {:.3} rad to the {side} on a straight road.",
            x.abs()
        ),
        "steering_free_play" => {
            format!("The steering has {x:.3} rad of free play at the hand wheel.")
        }
        "steering_lag" => format!("Steering acts {x:.2} s later than modelled."),
        "cornering_stiffness_front" => scaled("Cornering stiffness of the steer axle"),
        "cornering_stiffness_drive" => scaled("Cornering stiffness of the drive axles"),
        "cornering_stiffness_trailer" => scaled("Cornering stiffness of the trailer axles"),
        "payload_position" => format!(
            "The payload lies {:.2} m further {}.",
            x.abs(),
            if x >= 0.0 { "back" } else { "forward" }
        ),
        "road_bank" => format!("The road is banked by {:.4} rad, {} side up.", x.abs(), side),
        "crosswind" => format!("A crosswind of {:.1} m/s blows to the {side}.", x.abs()),
        other => format!("{other}: {x:.3}."),
    }
}

/// A meter of a rate that is off, at the engine's highest rate.
fn meter(what: &str, x: f64) -> String {
    let side = if x >= 0.0 { "high" } else { "low" };
    format!("At full load the {what} meter reads {:.1} % too {side}.", 100.0 * x.abs())
}

/// The sentence of a cause with the 90 % interval of its size `x`, which has the unit of its
/// parameter: of what has no unit, or is counted per something, in per cent.
pub(crate) fn with_interval(sentence: String, x: f64, sigma: f64, unit: &str) -> String {
    let (size, half) = (x.abs(), SIGMAS_90 * sigma);
    let (ends, unit) = if unit.starts_with('1') {
        ([100.0 * (size - half), 100.0 * (size + half)], "%")
    } else {
        ([size - half, size + half], unit)
    };
    let decimals = (1.0 - (ends[1] - ends[0]).max(1e-9).log10()).ceil().clamp(0.0, 6.0) as usize;
    let [from, to] = ends.map(|e| format!("{e:.decimals$}"));
    let interval = format!("{from} to {to} {unit}");
    format!("{} (90 %: {}).", sentence.trim_end_matches('.'), interval.trim_end())
}

/// Where a driveline loses more, as far as its gears say: a gearbox loses where its teeth carry the
/// power, an axle in all gears. `all` is the loss of the direct gear, `teeth` what the others lose on top,
/// with its standard deviation.
pub(crate) fn where_lost(all: f64, (teeth, sigma): (f64, f64)) -> String {
    let half = SIGMAS_90 * sigma;
    if teeth.abs() > half {
        let how = if teeth >= 0.0 { "on top: look at the gearbox" } else { "less" };
        let size = format!("{:.1} ± {:.1} %", 100.0 * teeth.abs(), 100.0 * half);
        return format!(" All gears but the direct one lose {size} {how}.");
    }
    // What the teeth may lose is less than what all gears do.
    let alike = teeth.abs() + half < all.abs();
    if alike { " All gears lose alike: look at the axle.".to_owned() } else { String::new() }
}

/// Said of causes that leave much.
pub(crate) const NOT_SURE: &str = " Not sure: it leaves what another cause would explain, or the \
    drives do not agree about its size.";

/// Where the baseline has side winds act.
pub(crate) fn side_force(tractor_frac: f64, trailer_behind_cg_m: f64, nats: f64) -> String {
    format!(
        "In the baseline side winds act with {:.0} % on the tractor and {trailer_behind_cg_m:+.1} m \
         behind the trailer's CG ({nats:.0} nats), not where the truck file says.",
        100.0 * tractor_frac
    )
}

/// Why two causes look alike, and what would tell them apart.
pub(crate) fn confusion(a: &str, b: &str, lost_nats: f64) -> String {
    let has = |x: &[&str]| x.contains(&a) && x.contains(&b);
    let road_load = ["rolling_resistance", "air_drag", "headwind", "dragging_brake", "wind"];
    let reason = if has(&road_load) {
        "the drives vary speed, load or heading too little; coast down from 85 to 30 km/h, loaded and empty, in both directions"
    } else if has(&["mass", "grade_bias", "driveline_loss", "rolling_resistance"]) {
        "accelerations and grades of both signs are needed; accelerate hard on the flat and coast on a known grade"
    } else if has(&["steering_ratio", "cornering_stiffness_front", "cornering_stiffness_drive"]) {
        "curves at one speed only; drive the same curve at 40 and 80 km/h"
    } else if has(&["steering_offset", "yaw_rate_bias", "road_bank", "crosswind"]) {
        "straight road at one speed; stand still for the gyro, drive straight slowly and fast in both directions"
    } else if has(&["engine_brake_torque", "hidden_retarder", "engine_friction", "driveline_loss"])
    {
        "hold speed down one grade by the engine brake alone, in two gears and on two stages, and coast"
    } else if has(&["brake_gain", "brake_fade", "hidden_retarder"]) {
        "stops with cold and with hot brakes are needed"
    } else if has(&["altitude_derate", "heat_derate"]) {
        "full load high and cold, and low and hot, is needed"
    } else if has(&["fuel_flow_scale", "co2_scale", "fuel_map_low_load"]) {
        "two meters alone do not say which of them is wrong; log the engine's torque beside them, or weigh the fuel of a drive"
    } else if has(&["cornering_stiffness_trailer", "payload_position"]) {
        "drive the same curves empty and loaded"
    } else {
        "both act on the same signals in these drives; repeat with other loads, speeds and grades"
    };
    let how = if lost_nats > 0.0 { "worse" } else { "better, but not beside what else was found" };
    format!("{reason} (it explains the drives {:.1} nats {how})", lost_nats.abs())
}

/// Why a cause cannot be seen although its channels are there.
pub(crate) fn not_excited(id: &str) -> &'static str {
    match id {
        "brake_fade" => "no braking above 150 degC",
        "altitude_derate" => "no full load at altitude",
        "heat_derate" => "no full load in the heat",
        "fan_load" => "the coolant stays cool",
        "tyre_warmup" => "no drive starts with cold tyres",
        "payload_position" => "no drive with payload in curves",
        "brake_gain" | "brake_delay" => "too little braking",
        "engine_brake_torque" => "the engine brake hardly acts",
        "fuel_flow_scale" | "co2_scale" => "too little fuel is burnt",
        _ => "the drives excite it too little",
    }
}

/// A disturbance that follows no signal, in words.
pub(crate) fn restless(module: crate::replay::Module, excess: f64) -> String {
    format!(
        "a random disturbance of {} that follows no measured signal: {:.1} times the variance of \
         drives in order (gusts, a rough road or a noisy sensor)",
        module.quantity(),
        excess
    )
}

/// A free function in words.
pub(crate) fn shape(s: &Shape) -> String {
    let extreme = s
        .knots
        .iter()
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .copied()
        .unwrap_or((0.0, 0.0));
    let word = if extreme.1 >= 0.0 { "a rise" } else { "a dip" };
    let signal = match s.memory_s {
        0.0 => s.signal.to_owned(),
        memory_s => format!("{} over the last {:.0} min", s.signal, memory_s / 60.0),
    };
    let percent = 100.0 * extreme.1.abs();
    match s.acts {
        Acts::Added => {}
        Acts::Scaled => {
            let what = s.module.quantity();
            return format!(
                "{what} off by a factor: {word} of {percent:.1} % near {signal} = {:.4}",
                extreme.0
            );
        }
        Acts::Part(what) => {
            return format!(
                "{what} off by a factor that follows {signal}: {word} of {percent:.1} % near {:.4}",
                extreme.0
            );
        }
    }
    // the force balance is one of accelerations
    let (size, what) = match s.module {
        Module::Force => (format!("{:.3} m/s²", extreme.1.abs()), "force"),
        m => (format!("{:.3}", extreme.1.abs()), m.quantity()),
    };
    format!("{word} of {size} in the {what} balance near {signal} = {:.4}", extreme.0)
}

/// Where the residuals of a module are largest: the worst bin over speed, grade and time.
pub(crate) fn places(problem: &Problem<'_>, m: Module) -> String {
    type Read = fn(&Prepared, usize) -> f64;
    let axes: [(&str, &str, f64, Read); 3] = [
        ("speed", "km/h", 20.0, |d, i| 3.6 * d.speed[i]),
        ("grade", "%", 1.0, |d, i| 100.0 * d.grade[i]),
        ("gear", "", 1.0, |d, i| d.gear[i] as f64),
    ];
    if m == Module::Shift {
        return "in shifts".to_owned();
    }
    let step = m.row_step();
    let zero = problem.reference.theta;
    let mut parts = Vec::new();
    let whitened: Vec<_> = (0..problem.drives.len()).map(|i| problem.whitened(i, &zero)).collect();
    for (name, unit, width, read) in axes {
        let mut bins = std::collections::BTreeMap::<i64, (f64, f64)>::new();
        let (mut all, mut count) = (0.0, 0.0);
        for (d, w) in problem.drives.iter().zip(&whitened) {
            for (k, x) in w[m as usize].iter().enumerate() {
                if d.valid[m as usize].get(k) == Some(&true) {
                    let bin = (read(d, (k * step).min(d.n - 1)) / width).floor() as i64;
                    let b = bins.entry(bin).or_default();
                    b.0 += x * x;
                    b.1 += 1.0;
                    all += x * x;
                    count += 1.0;
                }
            }
        }
        let mean = all / f64::max(count, 1.0);
        let worst = bins
            .iter()
            .filter(|b| b.1.1 > 0.02 * count)
            .max_by(|a, b| (a.1.0 / a.1.1).total_cmp(&(b.1.0 / b.1.1)));
        if let Some((bin, (s, n))) = worst
            && s / n > 1.3 * mean
        {
            let (lo, hi) = (*bin as f64 * width, (*bin + 1) as f64 * width);
            parts.push(if name == "gear" {
                format!("gear {bin}")
            } else {
                format!("{name} {lo:.0} to {hi:.0} {unit}")
            });
        }
    }
    if parts.is_empty() { "everywhere".to_owned() } else { parts.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_says_how_sure_its_size_is_in_the_words_of_its_size() {
        let rolling = with_interval(cause("rolling_resistance", 0.19), 0.19, 0.026, "1");
        assert_eq!(
            rolling,
            "Rolling resistance is 19 % higher than modelled (90 %: 14.7 to 23.3 %)."
        );
        let gearbox = where_lost(0.03, (0.02, 0.004));
        assert_eq!(
            gearbox,
            " All gears but the direct one lose 2.0 ± 0.7 % on top: look at the gearbox."
        );
        let axle = where_lost(0.05, (0.002, 0.004));
        assert_eq!(axle, " All gears lose alike: look at the axle.");
        assert_eq!(where_lost(0.01, (0.002, 0.006)), "");
        let tail = with_interval(cause("headwind", -2.35), -2.35, 0.4, "m/s");
        assert_eq!(tail, "A steady tailwind of 2.4 m/s acts in all drives (90 %: 1.7 to 3.0 m/s).");
    }
}
