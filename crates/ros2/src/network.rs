//! Where the node is seen: the ROS domain and the networks, from the variables that other nodes
//! read too (REP 2002, `ROS_DOMAIN_ID`, `ROS_AUTOMATIC_DISCOVERY_RANGE`).

use std::net::Ipv4Addr;

use ros2_client::dds::rustdds::{DomainParticipant, DomainParticipantBuilder};

use crate::error::Ros2Error;

/// The highest domain whose ports are all below 65536 (DDSI-RTPS 2.3, 9.6.1.1).
const MAX_DOMAIN_ID: u16 = 232;

/// Who can find the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Programs on this machine.
    Machine,
    /// Every host of the subnets of this machine.
    Subnet,
}

/// Domain and reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Network {
    /// ROS domain, 0 to 232.
    pub domain_id: u16,
    /// Who can find the node.
    pub reach: Reach,
}

impl Network {
    /// Reads `ROS_DOMAIN_ID` (0 if it is not set) and `ROS_AUTOMATIC_DISCOVERY_RANGE`. Where that
    /// is not set the node stays on this machine, unlike other nodes: DDS authenticates nobody.
    ///
    /// # Errors
    /// [`Ros2Error::Environment`] names the variable.
    pub fn from_environment(
        variable: impl Fn(&'static str) -> Option<String>,
    ) -> Result<Self, Ros2Error> {
        let id = ("ROS_DOMAIN_ID", "a number from 0 to 232");
        let range = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST or SUBNET");
        let wrong =
            |(variable, expected), value| Ros2Error::Environment { variable, value, expected };
        let set = |name| variable(name).filter(|value| !value.is_empty());
        let domain_id = match set(id.0) {
            None => 0,
            Some(text) => match text.parse() {
                Ok(number @ 0..=MAX_DOMAIN_ID) => number,
                _ => return Err(wrong(id, text)),
            },
        };
        let reach = match set(range.0) {
            None => Reach::Machine,
            Some(text) => match text.as_str() {
                "LOCALHOST" => Reach::Machine,
                "SUBNET" => Reach::Subnet,
                _ => return Err(wrong(range, text)),
            },
        };
        Ok(Self { domain_id, reach })
    }

    /// Joins the domain.
    ///
    /// # Errors
    /// [`Ros2Error::Middleware`].
    pub(crate) fn join(self) -> Result<DomainParticipant, Ros2Error> {
        let builder = DomainParticipantBuilder::new(self.domain_id);
        let builder = match self.reach {
            Reach::Machine => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            Reach::Subnet => builder,
        };
        builder.build().map_err(|e| self.failure("participant", e))
    }

    /// What the middleware says about something on this domain.
    pub(crate) fn failure(self, what: &str, why: impl std::fmt::Display) -> Ros2Error {
        let (domain_id, what) = (self.domain_id, what.to_owned());
        Ros2Error::Middleware { domain_id, what, why: why.to_string() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(id: Option<&str>, range: Option<&str>) -> Result<Network, String> {
        let value = |name| match name {
            "ROS_DOMAIN_ID" => id.map(str::to_owned),
            _ => range.map(str::to_owned),
        };
        Network::from_environment(value).map_err(|e| e.to_string())
    }

    #[test]
    fn the_node_stays_on_this_machine_unless_asked() {
        assert_eq!(read(None, None), Ok(Network { domain_id: 0, reach: Reach::Machine }));
        let far = Network { domain_id: 232, reach: Reach::Subnet };
        assert_eq!(read(Some("232"), Some("SUBNET")), Ok(far));
    }

    #[test]
    fn what_is_no_domain_is_named_with_its_value() {
        for id in ["233", "300", "-1", "x", "1.5"] {
            let why = read(Some(id), None).unwrap_err();
            assert!(why.starts_with(&format!("ROS_DOMAIN_ID={id}: ")), "{why}");
        }
        assert!(read(None, Some("OFF")).unwrap_err().contains("OFF"));
    }
}
