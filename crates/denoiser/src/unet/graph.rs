//! The obstacle graph: balls that exchange messages, pooled to one vector.
//!
//! A message's first layer is linear in receiver, sender and their offset, and the sum over senders follows a linear
//! layer; so both are computed per ball, and only the activation between them per pair.

use super::embedding::Perceptron;
use crate::gemm::Store;
use crate::layers::activation::silu;
use crate::layers::factors::Factors;
use crate::layers::layer_norm::LayerNorm;
use crate::layers::linear::Linear;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// Normalised centre and radius of a ball.
pub(super) type Node = [f32; 4];
/// Features of a pair of balls: offset and distance.
const PAIR_FEATURES: usize = 4;

pub(super) struct ObstacleGraph {
    hidden: usize,
    node: Perceptron,
    pub(super) layers: [Layer; 2],
    pool: Perceptron,
    empty: Vec<f32>,
}

pub(super) struct Layer {
    hidden: usize,
    receiver: Linear,
    sender: Linear,
    pair: Linear,
    outer_weight: Linear,
    outer_bias: Vec<f32>,
    update: Perceptron,
    norm: LayerNorm,
}

impl ObstacleGraph {
    pub(super) fn load(
        file: &WeightsFile,
        hidden: usize,
        context: usize,
    ) -> Result<Self, WeightsError> {
        let layer = |i: usize| Layer::load(file, &format!("graph.layers.{i}"), hidden);
        let pooled = [2 * hidden + 1, context, context];
        Ok(Self {
            hidden,
            node: Perceptron::load(file, "graph.node", [4, hidden, hidden])?,
            layers: [layer(0)?, layer(1)?],
            pool: Perceptron::load(file, "graph.pool", pooled)?,
            empty: file.vector("graph.empty", 2 * hidden)?,
        })
    }

    /// The embedding of any number of balls.
    pub(super) fn apply(&self, balls: &[Node]) -> Vec<f32> {
        let mut pooled = match balls {
            [] => self.empty.clone(),
            _ => self.pooled(&self.nodes(balls)),
        };
        pooled.push((balls.len() as f32).ln_1p());
        let (mut hidden, mut out) = (Vec::new(), Vec::new());
        self.pool.apply(&pooled, 1, &mut hidden, &mut out);
        out
    }

    /// The features of each ball after the last layer.
    fn nodes(&self, balls: &[Node]) -> Vec<f32> {
        let mut nodes = self.first_nodes(balls);
        for layer in &self.layers {
            layer.apply(balls, &mut nodes);
        }
        nodes
    }

    pub(super) fn first_nodes(&self, balls: &[Node]) -> Vec<f32> {
        let (mut hidden, mut nodes) = (Vec::new(), Vec::new());
        self.node
            .apply(balls.as_flattened(), balls.len(), &mut hidden, &mut nodes);
        nodes
    }

    /// Mean and maximum of each feature.
    fn pooled(&self, nodes: &[f32]) -> Vec<f32> {
        let mut mean = vec![0.0; self.hidden];
        let mut largest = vec![f32::NEG_INFINITY; self.hidden];
        let share = self.hidden as f32 / nodes.len() as f32;
        for node in nodes.chunks_exact(self.hidden) {
            for ((mean, largest), v) in mean.iter_mut().zip(&mut largest).zip(node) {
                *mean += v * share;
                *largest = largest.max(*v);
            }
        }
        mean.extend(largest);
        mean
    }
}

impl Layer {
    fn load(file: &WeightsFile, name: &str, hidden: usize) -> Result<Self, WeightsError> {
        let inputs = 2 * hidden + PAIR_FEATURES;
        let inner = file.tensor(&format!("{name}.message.0.weight"), &[hidden, inputs])?;
        let bias = file.tensor(&format!("{name}.message.0.bias"), &[hidden])?;
        let outer = file.tensor(&format!("{name}.message.2.weight"), &[hidden, hidden])?;
        let outer_bias = file.vector(&format!("{name}.message.2.bias"), hidden)?;
        let none = vec![0.0; hidden];
        let columns = |first: usize, count: usize, bias: &[f32]| {
            let rows = inner.chunks_exact(inputs);
            let part: Vec<f32> = rows.flat_map(|r| &r[first..][..count]).copied().collect();
            Linear::pack(&part, bias)
        };
        Ok(Self {
            hidden,
            receiver: columns(0, hidden, bias),
            sender: columns(hidden, hidden, &none),
            pair: columns(2 * hidden, PAIR_FEATURES, &none),
            outer_weight: Linear::pack(outer, &none),
            outer_bias,
            update: Perceptron::load(
                file,
                &format!("{name}.update"),
                [2 * hidden, hidden, hidden],
            )?,
            norm: LayerNorm::load(file, &format!("{name}.norm"), hidden)?,
        })
    }

    /// One round of messages; replaces the nodes.
    pub(super) fn apply(&self, balls: &[Node], nodes: &mut [f32]) {
        let received = self.received(balls, nodes);
        let width = self.hidden;
        let pairs = nodes.chunks_exact(width).zip(received.chunks_exact(width));
        let joined: Vec<f32> = pairs
            .flat_map(|(x, m)| x.iter().chain(m))
            .copied()
            .collect();
        let (mut hidden, mut update) = (Vec::new(), Vec::new());
        self.update
            .apply(&joined, balls.len(), &mut hidden, &mut update);
        update.iter_mut().zip(&*nodes).for_each(|(u, x)| *u += x);
        self.norm.apply(&update, nodes);
    }

    /// The sum of the messages that each ball receives.
    fn received(&self, balls: &[Node], nodes: &[f32]) -> Vec<f32> {
        let width = self.hidden;
        let mut sums = vec![0.0; nodes.len()];
        let (mut to, mut from) = (sums.clone(), sums.clone());
        self.receiver.apply(nodes, &mut to);
        self.sender.apply(nodes, &mut from);
        let mut messages = sums.clone();
        for (receiver, sum) in sums.chunks_exact_mut(width).enumerate() {
            let pairs: Vec<f32> = pair_features(balls, receiver).collect();
            messages.copy_from_slice(&from);
            for message in messages.chunks_exact_mut(width) {
                let own = &to[receiver * width..][..width];
                message.iter_mut().zip(own).for_each(|(m, t)| *m += t);
            }
            self.pair
                .multiply(&pairs, &mut Factors::default(), &mut messages, Store::Add);
            silu(&mut messages);
            for (sender, message) in messages.chunks_exact(width).enumerate() {
                if sender != receiver {
                    sum.iter_mut().zip(message).for_each(|(s, m)| *s += m);
                }
            }
        }
        let mut received = messages;
        self.outer_weight.apply(&sums, &mut received);
        let others = (balls.len() - 1) as f32;
        for row in received.chunks_exact_mut(width) {
            let bias = self.outer_bias.iter();
            row.iter_mut().zip(bias).for_each(|(r, b)| *r += others * b);
        }
        received
    }
}

/// Offset from the receiver to each ball, and their distance.
fn pair_features(balls: &[Node], receiver: usize) -> impl Iterator<Item = f32> {
    /// Added to the squared distance, as in training.
    const TINY: f32 = 1e-12;
    let own = balls[receiver];
    balls.iter().flat_map(move |ball| {
        let [x, y, z] = [0, 1, 2].map(|axis| ball[axis] - own[axis]);
        [x, y, z, (x * x + y * y + z * z + TINY).sqrt()]
    })
}
