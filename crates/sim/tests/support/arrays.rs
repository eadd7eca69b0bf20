//! What a batch writes into.

use sim::batch::{Batch, EpisodeStats, Views};

/// Arrays of a batch.
pub(crate) struct Arrays {
    pub(crate) obs: Vec<f32>,
    pub(crate) mask: Vec<u8>,
    pub(crate) reward: Vec<f32>,
    pub(crate) terminated: Vec<u8>,
    pub(crate) truncated: Vec<u8>,
    pub(crate) final_obs: Vec<f32>,
    pub(crate) episodes: Vec<EpisodeStats>,
}

impl Arrays {
    pub(crate) fn of(batch: &Batch) -> Self {
        let (n, size) = (batch.len(), batch.observation_size());
        Self {
            obs: vec![0.0; n * size],
            mask: vec![0; 3 * n],
            reward: vec![0.0; n],
            terminated: vec![0; n],
            truncated: vec![0; n],
            final_obs: vec![0.0; n * size],
            episodes: vec![EpisodeStats::default(); n],
        }
    }

    pub(crate) fn views(&mut self) -> Views<'_> {
        Views {
            obs: &mut self.obs,
            mask: &mut self.mask,
            reward: &mut self.reward,
            terminated: &mut self.terminated,
            truncated: &mut self.truncated,
            final_obs: &mut self.final_obs,
            episodes: &mut self.episodes,
        }
    }
}

/// An action among those that the mask allows, by a number.
pub(crate) fn allowed(mask: &[u8], number: usize) -> u8 {
    let open: Vec<u8> = (0..3).filter(|&a| mask[usize::from(a)] == 1).collect();
    open[number % open.len()]
}
