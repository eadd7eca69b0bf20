//! How long an answer of a service may be.
//!
//! What does not fit into one datagram goes in fragments, and RustDDS 0.15.1 writes a byte too many
//! before the inline QoS of a fragment, which names the request: no client understands it. How long
//! a datagram is depends on the networks that those who hear a service's answers say they are
//! reached over; all of them get each answer.

use ros2_client::dds::rustdds::DomainParticipant;

/// Where everybody is reached over the loopback interface alone, whose datagrams have 64 kB.
const LOOPBACK_BYTES: usize = 60_000;
/// Over an Ethernet, bytes.
const ETHERNET_BYTES: usize = 1_300;
/// Headers of IP, UDP and RTPS, a heartbeat, the head of a sample and its encapsulation, bytes.
const OVERHEAD_BYTES: usize = 48 + 32 + 48 + 4;

/// Who hears the answers of a service, and over what.
#[derive(Clone)]
pub(crate) struct Room {
    participant: DomainParticipant,
    topic: String,
    network_bytes: usize,
}

impl Room {
    /// For the answers of a service (without a slash).
    pub(crate) fn new(participant: &DomainParticipant, service: &str) -> Self {
        let interfaces = netdev::get_interfaces();
        let used = interfaces.iter().filter(|i| !i.is_loopback() && !i.ipv4.is_empty());
        let smallest_mtu = used.filter_map(|i| i.mtu).min();
        Self {
            participant: participant.clone(),
            topic: format!("rr/{service}Reply"),
            network_bytes: network_bytes(smallest_mtu),
        }
    }

    /// Bytes of an answer now, at most.
    pub(crate) fn bytes(&self) -> usize {
        let readers = self.participant.discovered_readers();
        let hears =
            readers.iter().filter(|r| r.subscription_topic_data.topic_name() == &self.topic);
        let is_here = |r: &ros2_client::dds::rustdds::discovery::DiscoveredReaderData| {
            let mut over =
                r.reader_proxy.unicast_locator_list.iter().filter(|l| l.is_udp()).peekable();
            // One that names no address is reached over those of its program, which are not known
            over.peek().is_some() && over.all(|l| l.is_loopback())
        };
        let mut hears = hears.peekable();
        let all_here = hears.peek().is_some() && hears.all(is_here);
        if all_here { LOOPBACK_BYTES } else { self.network_bytes }
    }
}

/// What a datagram of the network with the shortest ones holds.
fn network_bytes(smallest_mtu: Option<u32>) -> usize {
    let mtu = smallest_mtu.and_then(|mtu| usize::try_from(mtu).ok());
    mtu.map_or(ETHERNET_BYTES, |mtu| ETHERNET_BYTES.min(mtu.saturating_sub(OVERHEAD_BYTES)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer of 1,290 bytes was lost in silence over a network of 1,400 (a container's).
    #[test]
    fn the_network_with_the_shortest_datagrams_counts() {
        assert_eq!(network_bytes(None), 1_300);
        assert_eq!(network_bytes(Some(9_000)), 1_300);
        assert_eq!(network_bytes(Some(1_400)), 1_268);
        assert_eq!(network_bytes(Some(60)), 0);
    }
}
