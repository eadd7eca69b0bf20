//! The paper's rule-based baseline (Section VI-C): a vehicle within `d` ahead makes it look for a
//! neighbour lane without traffic `d` ahead and `d` behind, left first.

use super::{LaneChoice, View};

/// The wish of the rule with distance `d`, m, bumper to bumper.
#[must_use]
pub(crate) fn rules(view: &View<'_>, distance_m: f64) -> LaneChoice {
    let blocked = view.ahead(view.lane).is_some_and(|(_, gap_m)| gap_m < distance_m);
    if !blocked {
        return LaneChoice::Keep;
    }
    let free = |choice: LaneChoice| {
        view.lasting_beside(choice).is_some_and(|lane| {
            view.ahead(lane).is_none_or(|(_, gap_m)| gap_m >= distance_m)
                && view.behind(lane).is_none_or(|(_, gap_m)| gap_m >= distance_m)
        })
    };
    [LaneChoice::Left, LaneChoice::Right]
        .into_iter()
        .find(|&choice| free(choice))
        .unwrap_or(LaneChoice::Keep)
}
