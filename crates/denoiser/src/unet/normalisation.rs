//! The map between physical quantities and the network's.

use super::dimensions::FRAME;
use super::graph::Node;
use crate::weights::error::{ContentError, WeightsError};
use crate::weights::file::WeightsFile;

/// The map between physical quantities and the network's: configurations to −1..=1, positions to centre and scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalisation {
    /// Configuration that becomes −1.
    pub configuration_low: [f32; FRAME],
    /// Configuration that becomes 1.
    pub configuration_high: [f32; FRAME],
    /// Position that becomes 0, in units of the weights' data.
    pub position_centre: [f32; 3],
    /// Length that becomes 1.
    pub position_scale: f32,
}

impl Normalisation {
    pub(super) fn load(file: &WeightsFile) -> Result<Self, WeightsError> {
        let mut values = [[0.0; FRAME]; 4];
        let names = [
            ("configuration_low", FRAME),
            ("configuration_high", FRAME),
            ("position_centre", 3),
            ("position_scale", 1),
        ];
        for (values, (name, count)) in values.iter_mut().zip(names) {
            let tensor = file.tensor(&format!("normalisation.{name}"), &[count])?;
            values[..count].copy_from_slice(tensor);
        }
        let [low, high, [x, y, z, ..], [scale, ..]] = values;
        let found = Self {
            configuration_low: low,
            configuration_high: high,
            position_centre: [x, y, z],
            position_scale: scale,
        };
        found.check().map_err(|reason| file.refused(reason))?;
        Ok(found)
    }

    fn check(&self) -> Result<(), ContentError> {
        let mut ranges = self.configuration_low.iter().zip(&self.configuration_high);
        if let Some((low, high)) = ranges.find(|(low, high)| low >= high) {
            return Err(ContentError::Value {
                tensor: "normalisation.configuration_high",
                found: format!("{high} where the low end is {low}"),
                expected: "more than the low end",
            });
        }
        if self.position_scale <= 0.0 {
            return Err(ContentError::Value {
                tensor: "normalisation.position_scale",
                found: self.position_scale.to_string(),
                expected: "more than 0",
            });
        }
        Ok(())
    }

    /// A configuration in the network's numbers, between −1 and 1, given one in its physical unit.
    #[must_use]
    pub fn configuration(&self, physical: &[f32; FRAME]) -> [f32; FRAME] {
        std::array::from_fn(|i| {
            let (low, high) = (self.configuration_low[i], self.configuration_high[i]);
            2.0 * (physical[i] - low) / (high - low) - 1.0
        })
    }

    /// A configuration in its physical unit, given one between −1 and 1.
    #[must_use]
    pub fn physical_configuration(&self, normalised: &[f32; FRAME]) -> [f32; FRAME] {
        std::array::from_fn(|i| {
            let (low, high) = (self.configuration_low[i], self.configuration_high[i]);
            low + (normalised[i] + 1.0) / 2.0 * (high - low)
        })
    }

    pub(super) fn position(&self, physical: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|i| (physical[i] - self.position_centre[i]) / self.position_scale)
    }

    pub(super) fn ball(&self, &[x, y, z, radius]: &[f32; 4]) -> Node {
        let [x, y, z] = self.position([x, y, z]);
        [x, y, z, radius / self.position_scale]
    }
}
