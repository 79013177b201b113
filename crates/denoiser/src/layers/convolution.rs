//! The convolutions of a temporal network, as products on padded time-major rows.
//!
//! With the rows of consecutive frames one after the other, a window of frames is one long row: a convolution of k
//! taps is a product with k·C inputs whose rows overlap. The gradient of each kind with respect to its input is again
//! one of the kinds, with the weights transposed.

use crate::gemm::paged::Paged;
use crate::gemm::{Batch, Packed, Precision, Store, Strides};
use crate::layers::factors::Factors;
use crate::weights::error::WeightsError;
use crate::weights::file::WeightsFile;

/// Values of candidates, time-major, with a row of zeros before and after each: candidates × (height + 2) × channels.
#[derive(Default)]
pub(crate) struct Rows {
    candidates: usize,
    height: usize,
    channels: usize,
    /// Candidates whose rows of zeros are written.
    padded: usize,
    memory: Paged<f32>,
}

impl Rows {
    /// Takes a shape and writes its rows of zeros; the values between them are undefined until they are overwritten.
    pub(crate) fn shape(&mut self, candidates: usize, height: usize, channels: usize) {
        if (self.height, self.channels) != (height, channels) {
            self.padded = 0;
        }
        (self.candidates, self.height, self.channels) = (candidates, height, channels);
        let needed = candidates * self.pitch();
        if self.memory.len() < needed {
            self.memory = Paged::filled(0.0, needed);
            self.padded = 0;
        }
        let (pitch, padded) = (self.pitch(), self.padded);
        let all = self.values_mut().chunks_exact_mut(pitch.max(1));
        for candidate in all.skip(padded) {
            candidate[..channels].fill(0.0);
            candidate[(height + 1) * channels..].fill(0.0);
        }
        self.padded = padded.max(candidates);
    }

    fn values(&self) -> &[f32] {
        &self.memory[..self.candidates * self.pitch()]
    }

    fn values_mut(&mut self) -> &mut [f32] {
        let length = self.candidates * self.pitch();
        &mut self.memory[..length]
    }

    pub(crate) fn candidates(&self) -> usize {
        self.candidates
    }

    pub(crate) fn height(&self) -> usize {
        self.height
    }

    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    /// The rows of each candidate without the zeros: height × channels.
    pub(crate) fn each(&self) -> impl Iterator<Item = &[f32]> {
        let (pitch, margin) = (self.pitch(), self.channels);
        let all = self.values().chunks_exact(pitch.max(1));
        all.map(move |candidate| &candidate[margin..pitch - margin])
    }

    pub(crate) fn each_mut(&mut self) -> impl Iterator<Item = &mut [f32]> {
        let (pitch, margin) = (self.pitch(), self.channels);
        let all = self.values_mut().chunks_exact_mut(pitch.max(1));
        all.map(move |candidate| &mut candidate[margin..pitch - margin])
    }

    /// Becomes a copy of `source`, shape and values.
    pub(crate) fn copy(&mut self, source: &Self) {
        self.shape(source.candidates, source.height, source.channels);
        for (target, source) in self.each_mut().zip(source.each()) {
            target.copy_from_slice(source);
        }
    }

    /// Copies `count` channels of `source`, from channel `from` on, to the channels from `to` on.
    pub(crate) fn copy_channels(&mut self, to: usize, source: &Self, from: usize, count: usize) {
        let (wide, narrow) = (self.channels, source.channels);
        for (target, source) in self.each_mut().zip(source.each()) {
            let rows = target
                .chunks_exact_mut(wide)
                .zip(source.chunks_exact(narrow));
            for (target, source) in rows {
                target[to..][..count].copy_from_slice(&source[from..][..count]);
            }
        }
    }

    /// Values from a candidate to the next.
    pub(crate) fn pitch(&self) -> usize {
        (self.height + 2) * self.channels
    }

    /// Every `step`-th row.
    fn strides(&self, step: usize) -> Strides {
        Strides {
            row: step * self.channels,
            candidate: self.pitch(),
        }
    }
}

/// What a convolution does to the time axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// One frame at a time.
    Point,
    /// Three taps around each frame (padding 1): keeps the height.
    Same,
    /// Four taps (stride 2, padding 1): halves the height.
    Shrink,
    /// The transpose of `Shrink`: doubles the height.
    Grow,
}

impl Kind {
    fn taps(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Same => 3,
            Self::Shrink | Self::Grow => 4,
        }
    }

    fn transposed(self) -> Self {
        match self {
            Self::Point | Self::Same => self,
            Self::Shrink => Self::Grow,
            Self::Grow => Self::Shrink,
        }
    }

    fn height(self, height: usize) -> usize {
        match self {
            Self::Point | Self::Same => height,
            Self::Shrink => height / 2,
            Self::Grow => height * 2,
        }
    }

    /// Taps of each product, in the order of the frames.
    fn products(self) -> &'static [&'static [usize]] {
        match self {
            Self::Point => &[&[0]],
            Self::Same => &[&[0, 1, 2]],
            Self::Shrink => &[&[0, 1, 2, 3]],
            Self::Grow => &[&[3, 1], &[2, 0]],
        }
    }
}

/// A convolution and its gradient with respect to the input.
pub(crate) struct Convolution {
    pub(crate) forward: Products,
    /// From the gradient with respect to the output to that with respect to the input.
    pub(crate) backward: Products,
}

impl Convolution {
    /// Loads `name`.weight (PyTorch's layout) and `name`.bias.
    pub(crate) fn load(
        file: &WeightsFile,
        name: &str,
        kind: Kind,
        inputs: usize,
        outputs: usize,
    ) -> Result<Self, WeightsError> {
        let taps = kind.taps();
        let shape = match kind {
            Kind::Grow => [inputs, outputs, taps],
            _ => [outputs, inputs, taps],
        };
        let weight = file.tensor(&format!("{name}.weight"), &shape)?;
        let bias = file.tensor(&format!("{name}.bias"), &[outputs])?;
        let at = |output: usize, input: usize, tap: usize| match kind {
            Kind::Grow => weight[(input * outputs + output) * taps + tap],
            _ => weight[(output * inputs + input) * taps + tap],
        };
        let mirrored = |output: usize, input: usize, tap: usize| match kind {
            Kind::Same => at(input, output, 2 - tap),
            _ => at(input, output, tap),
        };
        let none = vec![0.0; inputs];
        Ok(Self {
            forward: Products::pack(kind, inputs, bias, at),
            backward: Products::pack(kind.transposed(), outputs, &none, mirrored),
        })
    }

    /// Packs the weights for a precision, which the first product in that precision would do otherwise.
    pub(crate) fn prepare(&self, precision: Precision) {
        for product in self.forward.products.iter().chain(&self.backward.products) {
            product.prepare(precision);
        }
    }
}

/// The products of a convolution, or of its gradient with respect to the input.
pub(crate) struct Products {
    kind: Kind,
    outputs: usize,
    products: Vec<Packed>,
}

impl Products {
    /// Packs weights given as a function of output, input and tap.
    fn pack(
        kind: Kind,
        inputs: usize,
        bias: &[f32],
        at: impl Fn(usize, usize, usize) -> f32,
    ) -> Self {
        let product = |taps: &&[usize]| {
            let row = |output| {
                let window = taps
                    .iter()
                    .flat_map(move |tap| (0..inputs).map(move |i| (i, *tap)));
                window.map(move |(input, tap)| (output, input, tap))
            };
            let entries = (0..bias.len()).flat_map(row);
            let weight: Vec<f32> = entries.map(|(o, i, t)| at(o, i, t)).collect();
            Packed::new(&weight, bias)
        };
        Self {
            kind,
            outputs: bias.len(),
            products: kind.products().iter().map(product).collect(),
        }
    }

    /// Writes the result for `x` into `out`, which takes the result's shape.
    pub(crate) fn apply(&self, x: &Rows, factors: &mut Factors, out: &mut Rows) {
        out.shape(x.candidates, self.kind.height(x.height), self.outputs);
        self.run(x, factors, out, Store::Replace);
    }

    /// Writes the result for `x` into the first channels of `out`, or adds it to them; the height of `out` must be the result's, its
    /// channels may be more.
    pub(crate) fn run(&self, x: &Rows, factors: &mut Factors, out: &mut Rows, store: Store) {
        assert_eq!(out.height, self.kind.height(x.height), "height");
        assert_eq!(out.candidates, x.candidates, "candidates");
        assert!(out.channels >= self.outputs, "channels");
        if x.candidates == 0 {
            return;
        }
        // first padded row and step of the windows, and of what they make
        let ways: &[(usize, usize, usize, usize)] = match self.kind {
            Kind::Point => &[(1, 1, 1, 1)],
            Kind::Same => &[(0, 1, 1, 1)],
            Kind::Shrink => &[(0, 2, 1, 1)],
            Kind::Grow => &[(0, 1, 1, 2), (1, 1, 2, 2)],
        };
        let input = factors.of(x.values());
        for (product, &(first, step, first_out, step_out)) in self.products.iter().zip(ways) {
            let batch = Batch {
                candidates: x.candidates,
                rows: out.height / step_out,
                from: x.strides(step),
                to: out.strides(step_out),
            };
            let first = first * x.channels;
            let first_out = first_out * out.channels;
            let out = &mut out.values_mut()[first_out..];
            product.multiply(input.skip(first), out, batch, store);
        }
    }
}
