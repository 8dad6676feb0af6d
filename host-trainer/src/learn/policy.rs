//! The policy of a trained network, without exploration.

use crate::env::flight::Flight;
use crate::judge::evaluation::{Decider, DeciderError};
use crate::learn::algorithm::{Algorithm, Inference};
use crate::observe::Encoding;
use gleaner_policy::Attention;
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

    /// The outputs, `[flights, outputs]`, for at least one flight.
    fn outputs(&mut self, flights: &[&Flight]) -> &[f32] {
        let first = flights[0];
        assert!(
            flights.iter().all(|flight| flight.shares_map(first)),
            "all flights of a batch must have the same map"
        );
        let known = self.encoding.take().filter(|(known, _)| known.shares_map(first));
        let (_, encoding) =
            self.encoding.insert(known.unwrap_or_else(|| (first.clone(), A::Encoding::of(first.map()))));
        let observed: Vec<_> = flights.iter().map(|flight| encoding.observe(flight)).collect();
        let states = observed.iter().zip(flights).map(|(state, flight)| (state, flight.preference()));
        self.inference.outputs(encoding, self.parameters, states)
    }
}

impl<A: Algorithm> Decider for NetworkPolicy<'_, A> {
    /// # Panics
    /// When the flights have different maps.
    fn decide(&mut self, flights: &[&Flight]) -> Result<Vec<Action>, DeciderError> {
        if flights.is_empty() {
            return Ok(Vec::new());
        }
        let outputs = self.outputs(flights);
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

    fn attention(&mut self, flight: &Flight) -> Result<Option<Attention>, DeciderError> {
        self.outputs(&[flight]);
        Ok(self.inference.attention())
    }
}
