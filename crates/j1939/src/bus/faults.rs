//! Faults around any bus, from a seed: what a node sends and receives is lost, late, doubled or
//! changed, or its controller is off the bus.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tractrix_core::{Stamped, Time};

use super::{Bus, BusError};
use crate::Frame;

/// Frames that are late at the same time, each way; more are lost.
const HELD: usize = 4096;

/// What goes wrong, from when to when. The default is nothing, always.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultPlan {
    /// First instant of the faults.
    pub from: Time,
    /// First instant without them again.
    pub until: Time,
    /// Probability that a frame is lost, 0 to 1.
    pub loss: f64,
    /// Probability that a frame comes twice, 0 to 1.
    pub duplicate: f64,
    /// Probability that one bit of the data is wrong, 0 to 1: what the check sequence of CAN does
    /// not see because it happens in a control unit or gateway.
    pub corrupt: f64,
    /// How late every frame is, ns.
    pub delay_nanos: i64,
    /// Whether the controller is off the bus.
    pub bus_off: bool,
}

impl Default for FaultPlan {
    fn default() -> Self {
        Self {
            from: Time(i64::MIN),
            until: Time(i64::MAX),
            loss: 0.0,
            duplicate: 0.0,
            corrupt: 0.0,
            delay_nanos: 0,
            bus_off: false,
        }
    }
}

/// A bus with faults, the same ones for the same seed and calls. They act on the frames of this
/// node, each way with its own random numbers.
#[derive(Debug, Clone)]
pub struct Faults<B> {
    bus: B,
    plan: FaultPlan,
    sending: Line,
    receiving: Line,
}

impl<B: Bus> Faults<B> {
    /// Faults around `bus`.
    pub fn new(bus: B, plan: FaultPlan, seed: u64) -> Self {
        Self { bus, plan, sending: Line::new(seed, 0), receiving: Line::new(seed, 1) }
    }

    /// The plan at `now`; none while nothing goes wrong.
    fn active(&self, now: Time) -> Result<Option<FaultPlan>, BusError> {
        let active = (self.plan.from <= now && now < self.plan.until).then_some(self.plan);
        if active.is_some_and(|plan| plan.bus_off) { Err(BusError::Off) } else { Ok(active) }
    }

    /// Sends what is late and due by `now`.
    fn flush(&mut self, now: Time) -> Result<(), BusError> {
        while let Some(due) = self.sending.due(now) {
            self.bus.send(now, &due.value)?;
            self.sending.held.pop_front();
        }
        Ok(())
    }
}

impl<B: Bus> Bus for Faults<B> {
    fn send(&mut self, now: Time, frame: &Frame) -> Result<(), BusError> {
        let plan = self.active(now)?;
        self.flush(now)?;
        self.sending.take(plan, Stamped { time: now, value: *frame });
        match self.flush(now) {
            // the frame is held and goes as soon as there is room
            Err(BusError::Full(_)) => Ok(()),
            result => result,
        }
    }

    fn receive(&mut self, now: Time) -> Result<Option<Stamped<Frame>>, BusError> {
        let plan = self.active(now)?;
        self.flush(now)?;
        while let Some(heard) = self.bus.receive(now)? {
            self.receiving.take(plan, heard);
        }
        let due = self.receiving.due(now);
        if due.is_some() {
            self.receiving.held.pop_front();
        }
        Ok(due)
    }
}

/// One direction.
#[derive(Debug, Clone)]
struct Line {
    random: ChaCha8Rng,
    held: VecDeque<Stamped<Frame>>,
}

impl Line {
    fn new(seed: u64, stream: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        Self { random, held: VecDeque::new() }
    }

    /// The first frame if it is due; frames stay in their order.
    fn due(&self, now: Time) -> Option<Stamped<Frame>> {
        self.held.front().filter(|held| held.time <= now).copied()
    }

    fn take(&mut self, plan: Option<FaultPlan>, mut heard: Stamped<Frame>) {
        let Some(plan) = plan else { return self.hold(heard) };
        if self.happens(plan.loss) {
            return;
        }
        if self.happens(plan.corrupt) {
            heard.value = self.with_a_wrong_bit(heard.value);
        }
        heard.time = heard.time.plus_nanos(plan.delay_nanos.max(0));
        if self.happens(plan.duplicate) {
            self.hold(heard);
        }
        self.hold(heard);
    }

    fn hold(&mut self, heard: Stamped<Frame>) {
        if self.held.len() < HELD {
            self.held.push_back(heard);
        }
    }

    fn happens(&mut self, probability: f64) -> bool {
        f64::from(self.random.next_u32()) < probability * 2_f64.powi(32)
    }

    fn with_a_wrong_bit(&mut self, frame: Frame) -> Frame {
        let bits = frame.bytes().len() * 8;
        let mut data = [0; 8];
        for (to, from) in data.iter_mut().zip(frame.bytes()) {
            *to = *from;
        }
        let bit = self.random.next_u32() as usize % bits.max(1);
        if let Some(byte) = data.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
        let bytes = data.get(..frame.bytes().len()).unwrap_or(&[]);
        Frame::new(frame.id(), bytes).unwrap_or(frame)
    }
}

/// A babbling node: fills its send queue with `frame` and says how many went in.
///
/// # Errors
/// When the bus cannot be used; a full queue is what a babbling node wants.
pub fn babble(bus: &mut impl Bus, now: Time, frame: &Frame) -> Result<usize, BusError> {
    for sent in 0..HELD {
        match bus.send(now, frame) {
            Ok(()) => {}
            Err(BusError::Full(_)) => return Ok(sent),
            Err(error) => return Err(error),
        }
    }
    Ok(HELD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::loopback::{Loopback, LoopbackNode};
    use crate::{BitRate, Id};

    const MS: i64 = 1_000_000;
    const FRAMES: i64 = 4_000;

    /// What arrives of numbered frames, one a millisecond, with the times of arrival.
    fn heard(plan: FaultPlan, seed: u64, faulty_sender: bool) -> Vec<(i64, i64, Vec<u8>)> {
        let bus = Loopback::new(BitRate::Kbit500, 2);
        let wrap = |node, plan| Faults::<LoopbackNode>::new(bus.node(node), plan, seed);
        let (with, without) = (plan, FaultPlan::default());
        let mut sender = wrap(0, if faulty_sender { with } else { without });
        let mut receiver = wrap(1, if faulty_sender { without } else { with });
        let mut all = Vec::new();
        for ms in 0..FRAMES + 1_000 {
            let now = Time(ms * MS);
            if ms < FRAMES {
                let data = ms.to_le_bytes();
                sender.send(now, &Frame::of(Id::from_raw(0x0CF0_0400), data)).unwrap();
            } else {
                sender.receive(now).unwrap();
            }
            while let Some(heard) = receiver.receive(now).unwrap() {
                let bytes = heard.value.bytes();
                let number = i64::from_le_bytes(bytes.try_into().unwrap());
                all.push((ms, number, bytes.to_vec()));
            }
        }
        all
    }

    #[test]
    fn without_a_plan_nothing_happens_and_faults_end_when_they_should() {
        assert_eq!(heard(FaultPlan::default(), 1, true).len() as i64, FRAMES);
        let (from, until) = (Time(100 * MS), Time(200 * MS));
        let plan = FaultPlan { loss: 1.0, from, until, ..FaultPlan::default() };
        let got = heard(plan, 1, true);
        assert_eq!(got.len() as i64, FRAMES - 100);
        assert!(got.iter().all(|(_, number, _)| !(100..200).contains(number)));
    }

    #[test]
    fn loss_and_duplicates_have_their_probability_each_way_and_the_seed_decides() {
        for faulty_sender in [true, false] {
            let lossy = FaultPlan { loss: 0.1, ..FaultPlan::default() };
            let got = heard(lossy, 7, faulty_sender).len() as f64 / FRAMES as f64;
            assert!((got - 0.9).abs() < 0.02, "{got}");
            let twice = FaultPlan { duplicate: 0.1, ..FaultPlan::default() };
            let got = heard(twice, 7, faulty_sender).len() as f64 / FRAMES as f64;
            assert!((got - 1.1).abs() < 0.02, "{got}");
            assert_eq!(heard(lossy, 7, faulty_sender), heard(lossy, 7, faulty_sender));
            assert_ne!(heard(lossy, 7, faulty_sender), heard(lossy, 8, faulty_sender));
        }
    }

    #[test]
    fn a_delay_keeps_the_order() {
        let plan = FaultPlan { delay_nanos: 100 * MS, ..FaultPlan::default() };
        let got = heard(plan, 1, true);
        assert_eq!(got.len() as i64, FRAMES);
        assert!(got.iter().enumerate().all(|(i, (_, number, _))| *number == i as i64));
        assert!(got.iter().all(|(ms, number, _)| (100..=102).contains(&(ms - number))));
    }

    #[test]
    fn corruption_is_one_bit() {
        let plan = FaultPlan { corrupt: 1.0, ..FaultPlan::default() };
        for (i, (_, _, bytes)) in heard(plan, 1, false).iter().enumerate() {
            let sent = (i as i64).to_le_bytes();
            let wrong: u32 = sent.iter().zip(bytes).map(|(a, b)| (a ^ b).count_ones()).sum();
            assert_eq!(wrong, 1);
        }
        // a frame without data has no bit that could be wrong
        let mut line = Line::new(1, 0);
        let empty = Frame::new(Id::from_raw(0), &[]).unwrap();
        assert_eq!(line.with_a_wrong_bit(empty), empty);
    }

    #[test]
    fn off_the_bus_nothing_goes() {
        let bus = Loopback::new(BitRate::Kbit250, 1);
        let plan = FaultPlan { bus_off: true, from: Time(MS), ..FaultPlan::default() };
        let mut node = Faults::new(bus.node(0), plan, 1);
        let frame = Frame::of(Id::from_raw(0), [0; 8]);
        assert_eq!(node.send(Time(0), &frame), Ok(()));
        assert_eq!(node.send(Time(MS), &frame), Err(BusError::Off));
        assert_eq!(node.receive(Time(MS)), Err(BusError::Off));
    }
}
