//! One TraCI conversation without any I/O: it writes a request, and reads the answer to it.
//!
//! A request is a batch of commands; each gets its own status, and an error does not stop the
//! later ones. `step` must be the last command of a batch and occur once (two of them in one
//! message crash SUMO; a `get` after it is answered before it).
//!
//! Vehicles of a context subscription land in [`Session::seen`], whose memory is reused.

use std::collections::HashMap;

use super::codec::{ProtocolError, Reader, Value, Writer, tag};
use super::error::SumoError;

/// Command and domain numbers.
pub mod id {
    /// Get version.
    pub const VERSION: u8 = 0x00;
    /// Load a new simulation.
    pub const LOAD: u8 = 0x01;
    /// Simulation step.
    pub const STEP: u8 = 0x02;
    /// Close.
    pub const CLOSE: u8 = 0x7f;
    /// Subscribe to the surroundings of an object: add the domain.
    pub const CONTEXT: u8 = 0x80;
    /// Get: add the domain.
    pub const GET: u8 = 0xa0;
    /// Set: add the domain.
    pub const SET: u8 = 0xc0;
    /// Domain: traffic lights.
    pub const TRAFFIC_LIGHT: u8 = 0x02;
    /// Domain: vehicles.
    pub const VEHICLE: u8 = 0x04;
    /// Domain: vehicle types.
    pub const VEHICLE_TYPE: u8 = 0x05;
    /// Domain: routes.
    pub const ROUTE: u8 = 0x06;
    /// Domain: points of interest.
    pub const POI: u8 = 0x07;
    /// Domain: lanes.
    pub const LANE: u8 = 0x03;
    /// Domain: simulation.
    pub const SIMULATION: u8 = 0x0b;
}

/// Variable numbers.
pub mod var {
    /// List of ids.
    pub const ID_LIST: u8 = 0x00;
    /// Number of objects.
    pub const COUNT: u8 = 0x01;
    /// Speed, m/s.
    pub const SPEED: u8 = 0x40;
    /// Maximum speed of a type, m/s.
    pub const MAX_SPEED: u8 = 0x41;
    /// Position (x, y), m, of the front bumper's centre.
    pub const POSITION: u8 = 0x42;
    /// Angle, degrees clockwise from north.
    pub const ANGLE: u8 = 0x43;
    /// Length, m.
    pub const LENGTH: u8 = 0x44;
    /// Width, m.
    pub const WIDTH: u8 = 0x4d;
    /// Shape of a lane.
    pub const SHAPE: u8 = 0x4e;
    /// Type of a vehicle.
    pub const TYPE: u8 = 0x4f;
    /// Vehicle class of a type.
    pub const VEHICLE_CLASS: u8 = 0x49;
    /// Lane id.
    pub const LANE_ID: u8 = 0x51;
    /// Edges of a route.
    pub const EDGES: u8 = 0x54;
    /// Lateral speed, m/s, positive left.
    pub const LATERAL_SPEED: u8 = 0x32;
    /// Acceleration, m/s².
    pub const ACCELERATION: u8 = 0x72;
    /// Simulation time, s.
    pub const TIME: u8 = 0x66;
    /// State of a traffic light (get: 0x20, set: 0x20).
    pub const LIGHT_STATE: u8 = 0x20;
    /// Program of a traffic light.
    pub const LIGHT_PROGRAM: u8 = 0x29;
    /// Vehicle classes that a lane is closed to.
    pub const DISALLOWED: u8 = 0x35;
    /// Add a vehicle.
    pub const ADD: u8 = 0x85;
    /// Remove a vehicle.
    pub const REMOVE: u8 = 0x81;
    /// Move a vehicle to x, y.
    pub const MOVE_TO_XY: u8 = 0xb4;
    /// Speed mode.
    pub const SPEED_MODE: u8 = 0xb3;
    /// Lane-change mode.
    pub const LANE_CHANGE_MODE: u8 = 0xb6;
}

/// What is asked about the vehicles around the ego.
pub const CONTEXT_VARIABLES: [u8; 5] =
    [var::POSITION, var::SPEED, var::ANGLE, var::ACCELERATION, var::LATERAL_SPEED];

/// SUMO's "no value".
pub const INVALID_DOUBLE: f64 = -1_073_741_824.0;

/// A vehicle of the context subscription, in SUMO's terms.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seen {
    /// Number of the vehicle's name, see [`Session::name`].
    pub handle: u32,
    /// Front bumper's centre, map x, m.
    pub x_m: f64,
    /// Front bumper's centre, map y, m.
    pub y_m: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Angle, degrees clockwise from north.
    pub angle_deg: f64,
    /// Acceleration, m/s².
    pub accel_m_s2: f64,
    /// Lateral speed, m/s, positive left.
    pub lateral_speed_m_s: f64,
}

/// Answer to one command of a batch.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// Done.
    Done,
    /// SUMO refused; its words.
    Refused(String),
    /// The value asked for.
    Value(Value),
    /// API version and name.
    Version(i32, String),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Expect {
    Status,
    Version,
    Value,
    Context,
    Step,
}

/// A conversation.
#[derive(Debug, Default)]
pub struct Session {
    writer: Writer,
    expects: Vec<(u8, u8, Expect)>,
    names: Vec<String>,
    handles: HashMap<String, u32>,
    /// Vehicles of the latest step's context subscription, the ego included.
    pub seen: Vec<Seen>,
    /// Answers to the latest request, in order.
    pub answers: Vec<Answer>,
}

impl Session {
    /// Starts a new request.
    pub fn request(&mut self) -> &mut Self {
        self.writer.clear();
        self.expects.clear();
        self
    }

    /// The request as bytes.
    pub fn message(&mut self) -> &[u8] {
        self.writer.message()
    }

    /// Forgets names (after a reload).
    pub fn forget(&mut self) {
        self.names.clear();
        self.handles.clear();
        self.seen.clear();
    }

    /// Name behind a handle.
    #[must_use]
    pub fn name(&self, handle: u32) -> &str {
        self.names.get(handle as usize).map_or("", String::as_str)
    }

    /// Asks for the version.
    pub fn version(&mut self) -> &mut Self {
        self.writer.begin(id::VERSION).end();
        self.expect(id::VERSION, 0, Expect::Version)
    }

    /// Loads a simulation with these options (without the program's name).
    pub fn load(&mut self, options: &[String]) -> &mut Self {
        self.writer.begin(id::LOAD).value(&Value::Texts(options.to_vec())).end();
        self.expect(id::LOAD, 0, Expect::Status)
    }

    /// Closes the simulation.
    pub fn close(&mut self) -> &mut Self {
        self.writer.begin(id::CLOSE).end();
        self.expect(id::CLOSE, 0, Expect::Status)
    }

    /// Sets a variable.
    pub fn set(&mut self, domain: u8, variable: u8, object: &str, value: &Value) -> &mut Self {
        self.writer.begin(id::SET | domain).u8(variable).str(object).value(value).end();
        self.expect(id::SET | domain, variable, Expect::Status)
    }

    /// Asks for a variable.
    pub fn get(&mut self, domain: u8, variable: u8, object: &str) -> &mut Self {
        self.writer.begin(id::GET | domain).u8(variable).str(object).end();
        self.expect(id::GET | domain, variable, Expect::Value)
    }

    /// Moves a vehicle: front bumper's centre (m) and angle (degrees clockwise from north). Hot:
    /// written without an allocation.
    pub fn move_to_xy(&mut self, object: &str, x_m: f64, y_m: f64, angle_deg: f64) -> &mut Self {
        let w = self.writer.begin(id::SET | id::VEHICLE).u8(var::MOVE_TO_XY).str(object);
        w.u8(tag::COMPOUND).i32(7);
        w.u8(tag::STRING).str("").u8(tag::INT).i32(-1);
        w.u8(tag::DOUBLE).f64(x_m).u8(tag::DOUBLE).f64(y_m).u8(tag::DOUBLE).f64(angle_deg);
        // keepRoute 2: anywhere near its route, off the road too; threshold 100 m.
        w.u8(tag::BYTE).u8(2).u8(tag::DOUBLE).f64(100.0).end();
        self.expect(id::SET | id::VEHICLE, var::MOVE_TO_XY, Expect::Status)
    }

    /// Moves a point of interest, m. Hot: written without an allocation.
    pub fn move_poi(&mut self, object: &str, x_m: f64, y_m: f64) -> &mut Self {
        let w = self.writer.begin(id::SET | id::POI).u8(var::POSITION).str(object);
        w.u8(tag::POS_2D).f64(x_m).f64(y_m).end();
        self.expect(id::SET | id::POI, var::POSITION, Expect::Status)
    }

    /// Subscribes to the vehicles around an object of a domain.
    pub fn subscribe_context(&mut self, domain: u8, object: &str, radius_m: f64) -> &mut Self {
        let command = id::CONTEXT | domain;
        let w = self.writer.begin(command);
        w.f64(INVALID_DOUBLE).f64(INVALID_DOUBLE).str(object);
        w.u8(id::GET | id::VEHICLE).f64(radius_m).u8(CONTEXT_VARIABLES.len() as u8);
        for variable in CONTEXT_VARIABLES {
            w.u8(variable);
        }
        w.end();
        self.expect(command, 0, Expect::Context)
    }

    /// One simulation step; the last command of a request.
    pub fn step(&mut self) -> &mut Self {
        self.step_to(0.0)
    }

    /// Steps up to a time, s (0: one step); the last command of a request.
    pub fn step_to(&mut self, time_s: f64) -> &mut Self {
        self.writer.begin(id::STEP).f64(time_s).end();
        self.expect(id::STEP, 0, Expect::Step)
    }

    fn expect(&mut self, command: u8, variable: u8, expect: Expect) -> &mut Self {
        self.expects.push((command, variable, expect));
        self
    }

    /// Reads the answer to the request.
    ///
    /// # Errors
    /// When the bytes do not answer this request. A refused command is an [`Answer`], not an error.
    pub fn read(&mut self, body: &[u8]) -> Result<(), ProtocolError> {
        let mut reader = Reader::new(body);
        self.answers.clear();
        for k in 0..self.expects.len() {
            let Some(&(command, variable, expect)) = self.expects.get(k) else { break };
            let answer = self.read_one(&mut reader, command, variable, expect)?;
            self.answers.push(answer);
        }
        if reader.is_empty() { Ok(()) } else { Err(reader.error("more answers than questions")) }
    }

    fn read_one(
        &mut self,
        reader: &mut Reader<'_>,
        command: u8,
        variable: u8,
        expect: Expect,
    ) -> Result<Answer, ProtocolError> {
        let (found, mut status) = reader.command()?;
        if found != command {
            return Err(reader.error(format!("status of 0x{found:02x} instead of 0x{command:02x}")));
        }
        let (result, text) = (status.u8()?, status.str()?);
        if result != 0 {
            return Ok(Answer::Refused(text.to_owned()));
        }
        match expect {
            Expect::Status => Ok(Answer::Done),
            Expect::Version => {
                let (_, mut r) = reader.command()?;
                Ok(Answer::Version(r.i32()?, r.str()?.to_owned()))
            }
            Expect::Value => {
                let (found, mut r) = reader.command()?;
                let (about, _) = (r.u8()?, r.str()?);
                if found != command + 0x10 || about != variable {
                    return Err(reader.error(format!(
                        "answer 0x{found:02x}/0x{about:02x} to 0x{command:02x}/0x{variable:02x}"
                    )));
                }
                if variable == var::SHAPE { shape(&mut r) } else { r.value() }.map(Answer::Value)
            }
            Expect::Context => {
                let (_, mut r) = reader.command()?;
                self.seen.clear();
                self.read_context(&mut r)?;
                Ok(Answer::Done)
            }
            Expect::Step => {
                let n = reader.i32()?;
                self.seen.clear();
                for _ in 0..n.max(0) {
                    let (found, mut r) = reader.command()?;
                    if found & 0xf0 != (id::CONTEXT + 0x10) {
                        return Err(reader.error(format!("unexpected subscription 0x{found:02x}")));
                    }
                    self.read_context(&mut r)?;
                }
                Ok(Answer::Done)
            }
        }
    }

    fn read_context(&mut self, r: &mut Reader<'_>) -> Result<(), ProtocolError> {
        let (_, _, variables) = (r.str()?, r.u8()?, r.u8()?);
        let n = r.count(4 + 3 * variables as usize)?;
        for _ in 0..n {
            let handle = self.intern(r.str()?);
            let mut seen = Seen { handle, ..Seen::default() };
            for _ in 0..variables {
                let (variable, failed) = (r.u8()?, r.u8()?);
                if failed != 0 {
                    return Err(
                        r.error(format!("variable 0x{variable:02x}: {:?}", r.clone().value()))
                    );
                }
                let tag = r.u8()?;
                let position = variable == var::POSITION;
                if tag != if position { tag::POS_2D } else { tag::DOUBLE } {
                    return Err(r.error(format!("variable 0x{variable:02x} of type 0x{tag:02x}")));
                }
                let x = r.f64()?;
                match variable {
                    var::POSITION => (seen.x_m, seen.y_m) = (x, r.f64()?),
                    var::SPEED => seen.speed_m_s = x,
                    var::ANGLE => seen.angle_deg = x,
                    var::ACCELERATION => seen.accel_m_s2 = x,
                    var::LATERAL_SPEED => seen.lateral_speed_m_s = x,
                    other => return Err(r.error(format!("variable 0x{other:02x} not asked for"))),
                }
            }
            self.seen.push(seen);
        }
        Ok(())
    }

    fn intern(&mut self, name: &str) -> u32 {
        if let Some(&handle) = self.handles.get(name) {
            return handle;
        }
        let handle = self.names.len() as u32;
        self.names.push(name.to_owned());
        self.handles.insert(name.to_owned(), handle);
        handle
    }

    /// The error behind the first refused command of the latest request, if any.
    #[must_use]
    pub fn refusal(&self, object: &str) -> Option<SumoError> {
        self.answers.iter().zip(&self.expects).find_map(|(answer, &(command, variable, _))| {
            let Answer::Refused(text) = answer else { return None };
            let (object, text) = (object.to_owned(), text.clone());
            Some(SumoError::Refused { command, variable, object, text })
        })
    }
}

/// A polygon: one byte, or zero and an integer, and that many 2-D points; flattened.
fn shape(r: &mut Reader<'_>) -> Result<Value, ProtocolError> {
    let _tag = r.u8()?;
    let short = r.u8()? as usize;
    let n = if short == 0 { r.count(16)? } else { short };
    let points = (0..n).map(|_| Ok(Value::Position([r.f64()?, r.f64()?, 0.0])));
    points.collect::<Result<_, _>>().map(Value::Compound)
}
