//! What the network is conditioned on besides the balls: diffusion step, start and goal.

use crate::layers::activation::silu;
use crate::layers::linear::Linear;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// Two layers with SiLU between them.
pub(super) struct Perceptron {
    inner: Linear,
    outer: Linear,
    hidden: usize,
    outputs: usize,
}

impl Perceptron {
    /// Loads `name`.0 and `name`.2.
    pub(super) fn load(
        file: &WeightsFile,
        name: &str,
        [inputs, hidden, outputs]: [usize; 3],
    ) -> Result<Self, WeightsError> {
        Ok(Self {
            inner: Linear::load(file, &format!("{name}.0"), inputs, hidden)?,
            outer: Linear::load(file, &format!("{name}.2"), hidden, outputs)?,
            hidden,
            outputs,
        })
    }

    /// Writes the outputs for each row of `x`.
    pub(super) fn apply(&self, x: &[f32], rows: usize, hidden: &mut Vec<f32>, out: &mut Vec<f32>) {
        hidden.resize(rows * self.hidden, 0.0);
        out.resize(rows * self.outputs, 0.0);
        self.inner.apply(x, hidden);
        silu(hidden);
        self.outer.apply(hidden, out);
    }
}

/// The layers that make the context.
pub(super) struct Embedding {
    features: usize,
    time: Perceptron,
    start: Perceptron,
    goal: Perceptron,
    context: Linear,
}

/// Buffers of [`Embedding::context`].
#[derive(Default)]
pub(super) struct EmbeddingWork {
    features: Vec<f32>,
    hidden: Vec<f32>,
    pub(super) sum: Vec<f32>,
}

impl Embedding {
    pub(super) fn load(
        file: &WeightsFile,
        width: usize,
        context: usize,
    ) -> Result<Self, WeightsError> {
        let perceptron = |name, inputs| Perceptron::load(file, name, [inputs, context, context]);
        Ok(Self {
            features: width,
            time: perceptron("time", width)?,
            start: perceptron("start", 6)?,
            goal: perceptron("goal", 3)?,
            context: Linear::load(file, "context.1", context, context)?,
        })
    }

    /// The sum of the embeddings of start and goal, both normalised.
    pub(super) fn ends(&self, start: &[f32; 6], goal: &[f32; 3]) -> Vec<f32> {
        let (mut hidden, mut sum, mut other) = (Vec::new(), Vec::new(), Vec::new());
        self.start.apply(start, 1, &mut hidden, &mut sum);
        self.goal.apply(goal, 1, &mut hidden, &mut other);
        sum.iter_mut().zip(other).for_each(|(s, o)| *s += o);
        sum
    }

    /// Writes the embedding of each diffusion step into `work.sum`.
    pub(super) fn times(&self, steps: &[f32], work: &mut EmbeddingWork) {
        work.features.clear();
        for step in steps {
            push_time_features(*step, self.features, &mut work.features);
        }
        let EmbeddingWork {
            features,
            hidden,
            sum,
        } = work;
        self.time.apply(features, steps.len(), hidden, sum);
    }

    /// Writes the context of each diffusion step, given the embedded request.
    pub(super) fn contexts(
        &self,
        request: &[f32],
        steps: &[f32],
        work: &mut EmbeddingWork,
        contexts: &mut Vec<f32>,
    ) {
        self.times(steps, work);
        let sum = &mut work.sum;
        for sum in sum.chunks_exact_mut(request.len()) {
            sum.iter_mut().zip(request).for_each(|(s, r)| *s += r);
        }
        silu(sum);
        contexts.resize(sum.len(), 0.0);
        self.context.apply(sum, contexts);
        silu(contexts);
    }
}

/// Appends sin and cos of the step at frequencies that fall geometrically from 1 to 10⁻⁴.
fn push_time_features(step: f32, count: usize, features: &mut Vec<f32>) {
    let half = count / 2;
    let fall = -(1e4_f32.ln()) / (half - 1) as f32;
    let angle = |i: usize| step * (fall * i as f32).exp();
    features.extend((0..half).map(|i| angle(i).sin()));
    features.extend((0..half).map(|i| angle(i).cos()));
}
