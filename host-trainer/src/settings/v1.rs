//! Settings as checkpoints of version 1 store them: in this order, without names.

use super::Settings;
use serde::{Deserialize, Serialize};

/// The order is the file format. New settings do not belong here.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SettingsV1 {
    seed: u64,
    updates: u64,
    steps_per_update: usize,
    warm_up: usize,
    batch: usize,
    preferences: usize,
    replay: usize,
    learning_rate: f32,
    learning_rate_end: f32,
    discount: f32,
    polyak: f32,
    entropy_start: f32,
    entropy_end: f32,
    heat_start: f32,
    heat_end: f32,
    anneal: u64,
    entropy_weight: f32,
    heat_in_policy: bool,
    validate_on_evaluation: bool,
    reward_scale: f32,
    shaping: f32,
    pure_preferences: f64,
    share_greedy: f64,
    share_rd: f64,
    share_rb: f64,
    share_varied: f64,
    share_cities: f64,
}

impl From<SettingsV1> for Settings {
    fn from(old: SettingsV1) -> Settings {
        Settings {
            seed: old.seed,
            updates: old.updates,
            steps_per_update: old.steps_per_update,
            warm_up: old.warm_up,
            batch: old.batch,
            preferences: old.preferences,
            replay: old.replay,
            learning_rate: old.learning_rate,
            learning_rate_end: old.learning_rate_end,
            discount: old.discount,
            polyak: old.polyak,
            entropy_start: old.entropy_start,
            entropy_end: old.entropy_end,
            heat_start: old.heat_start,
            heat_end: old.heat_end,
            anneal: old.anneal,
            entropy_weight: old.entropy_weight,
            heat_in_policy: old.heat_in_policy,
            validate_on_evaluation: old.validate_on_evaluation,
            reward_scale: old.reward_scale,
            shaping: old.shaping,
            pure_preferences: old.pure_preferences,
            share_greedy: old.share_greedy,
            share_rd: old.share_rd,
            share_rb: old.share_rb,
            share_varied: old.share_varied,
            share_cities: old.share_cities,
            ..Settings::default()
        }
    }
}

#[cfg(test)]
impl From<Settings> for SettingsV1 {
    fn from(settings: Settings) -> SettingsV1 {
        SettingsV1 {
            seed: settings.seed,
            updates: settings.updates,
            steps_per_update: settings.steps_per_update,
            warm_up: settings.warm_up,
            batch: settings.batch,
            preferences: settings.preferences,
            replay: settings.replay,
            learning_rate: settings.learning_rate,
            learning_rate_end: settings.learning_rate_end,
            discount: settings.discount,
            polyak: settings.polyak,
            entropy_start: settings.entropy_start,
            entropy_end: settings.entropy_end,
            heat_start: settings.heat_start,
            heat_end: settings.heat_end,
            anneal: settings.anneal,
            entropy_weight: settings.entropy_weight,
            heat_in_policy: settings.heat_in_policy,
            validate_on_evaluation: settings.validate_on_evaluation,
            reward_scale: settings.reward_scale,
            shaping: settings.shaping,
            pure_preferences: settings.pure_preferences,
            share_greedy: settings.share_greedy,
            share_rd: settings.share_rd,
            share_rb: settings.share_rb,
            share_varied: settings.share_varied,
            share_cities: settings.share_cities,
        }
    }
}
