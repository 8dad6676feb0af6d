//! The policy of a trained network, without exploration.

use crate::env::flight::Flight;
use crate::judge::evaluation::{Decider, DeciderError};
use crate::learn::algorithm::{Algorithm, Inference};
use crate::observe::Encoding;
use gleaner_units::Action;

/// Takes the allowed action with the highest score.
pub struct NetworkPolicy<'a, A: Algorithm> {
    parameters: &'a [f32],
    inference: Inference<A::Encoding>,
    /// The encoding, and a flight over the map that it belongs to.
    encoding: Option<(Flight, A::Encoding)>,
}

impl<'a, A: Algorithm> NetworkPolicy<'a, A> {
    /// The network of this algorithm with these parameters.
    #[must_use]
    pub fn new(parameters: &'a [f32]) -> NetworkPolicy<'a, A> {
        NetworkPolicy { parameters, inference: Inference::new(A::network()), encoding: None }
    }
}

impl<A: Algorithm> Decider for NetworkPolicy<'_, A> {
    /// # Panics
    /// When the flights have different maps.
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
        let Some(first) = flights.first() else { return Ok(Vec::new()) };
        assert!(
            flights.iter().all(|flight| flight.shares_map(first)),
            "all flights of a batch must have the same map"
        );
        if !self.encoding.as_ref().is_some_and(|(known, _)| known.shares_map(first)) {
            self.encoding = Some(((*first).clone(), A::Encoding::of(first.map())));
        }
        let Some((_, encoding)) = &self.encoding else { return Ok(Vec::new()) };
        let observed: Vec<_> = flights.iter().map(|flight| encoding.observe(flight)).collect();
        let states = observed.iter().zip(flights).map(|(state, flight)| (state, flight.preference()));
        let outputs = self.inference.outputs(encoding, self.parameters, states);
        let outputs = outputs.chunks_exact(outputs.len() / flights.len());
        flights
            .iter()
            .zip(outputs)
            .map(|(flight, outputs)| {
                let scores = A::scores(outputs, flight.preference());
                let action = flight.mask().argmax(&scores);
                action.ok_or_else(|| DeciderError("the network's output is not a number".into()))
            })
            .collect()
    }
}
