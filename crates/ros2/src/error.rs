//! What can go wrong before a node runs. A running node has no errors: a command that cannot be
//! carried out is answered, a message that has no room is counted.

/// Why there is no node.
#[derive(Debug, thiserror::Error)]
pub enum Ros2Error {
    /// An environment variable says what cannot be.
    #[error("{variable}={value}: expected {expected}")]
    Environment {
        /// Its name.
        variable: &'static str,
        /// What it says.
        value: String,
        /// What it may say.
        expected: &'static str,
    },
    /// Another program on the domain has a clock already.
    #[error(
        "another program publishes /clock on ROS domain {domain_id}: take another one (ROS_DOMAIN_ID)"
    )]
    ClockTaken {
        /// The domain.
        domain_id: u16,
    },
    /// DDS could not be set up.
    #[error("ROS domain {domain_id}: {what}: {why}")]
    Middleware {
        /// The domain.
        domain_id: u16,
        /// Of which topic, service or participant.
        what: String,
        /// What the middleware says.
        why: String,
    },
}
