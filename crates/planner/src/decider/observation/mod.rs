//! What a learned decider sees. One module for training and for the truck; weights carry the hash
//! of their [`ObservationSpec`], which says how to make what they were trained on.
//!
//! | file | holds |
//! |---|---|
//! | `frame` | the paper's frame of the nearest vehicles, the last three seconds of it |
//! | `spec` | the layouts: the paper's 216 numbers, and ours with what the paper's leave out |
//!
//! A frame has 9 rows of 6 columns. Row 0 is the ego, rows 1-2 the two nearest vehicles behind (to
//! 50 m), rows 3-8 the six nearest ahead (to 100 m), nearest first; absent rows are zero but for the
//! last column. Columns, each clipped to -1..1:
//!
//! | column | ego | neighbour | divided by |
//! |---|---|---|---|
//! | 0 presence | 1 | 1 | 1 |
//! | 1 along the road | 1 | its centre minus the ego's reference point, m | 100 |
//! | 2 to the right | lateral distance from the leftmost through lane's centre, m | lateral distance from the ego, m | 8 |
//! | 3 speed | own, m/s | ego minus neighbour, m/s | 40 |
//! | 4 lateral speed to the right | own, m/s | neighbour minus ego, m/s | 40 |
//! | 5 reference speed | in row `i` the one at `s + v i 3/8 s` for all rows, m/s | | 40 |
//!
//! Four frames of the present and of 1, 2 and 3 s ago, newest first; frames before the start are
//! zero. The released code fills column 5 with one value; here it is the reference ahead of the
//! truck that the paper describes.
//!
//! [`ObservationSpec::Tractrix1`] adds [`OWN`] numbers, each clipped to -1..1:
//!
//! | number | holds | divided by |
//! |---|---|---|
//! | 0, 1, 2 | a change to the left, to the right, the way back is under way | 1 |
//! | 3 | the part of it that is driven | 1 |
//! | 4, 5 | through lanes to the right, to the left | 3 |
//! | 6 | acceleration, m/s² | 3 |
//! | 7, 8 | the safety gate would pass a change to the left, to the right | 1 |
//! | 9, 10 | gap to the vehicle ahead in the own lane, m (1: nobody); its speed less the own, m/s | 200; 40 |
//! | 11, 12 and 13, 14 | the same in the lane on the left and on the right | |
//! | 15 | the speed that the truck would drive without others, m/s | 40 |
//! | 16 | mass, kg | 80,000 |
//! | 17 | largest engine power less what the present speed and grade take, W | 500,000 |
//! | 18, 19, 20 | the reference speed in 1, 2 and 3 s, driving at it, m/s | 40 |

mod frame;
mod spec;

pub(crate) use frame::sees_anyone;
pub use frame::{COLUMNS, FRAME, FRAMES, Frame, Observer, ROWS, SIZE, frame};
pub use spec::{OWN, ObservationSpec, Observed, PROFILE_S, Seen};
