//! One linear layer in the trainer's kernels and in nalgebra (with matrixmultiply), in turns on one thread.
//!
//! Prints the median of nalgebra / ours over paired repetitions, with its quartiles, for the rows of one observation with
//! six devices (9) and of a training batch (864). Ours includes repacking the weights, which training does once per batch.

mod net;

use nalgebra::DMatrix;
use std::hint::black_box;
use std::time::Instant;

const REPETITIONS: usize = 301;
/// Query, key and value: the largest layer of the encoder.
const INPUTS: usize = 64;
const OUTPUTS: usize = 192;

fn number(index: usize) -> f32 {
    (index * 7919 % 1000) as f32 / 1000.0 - 0.5
}

fn main() {
    let parameters: Vec<f32> = (0..(INPUTS + 1) * OUTPUTS).map(number).collect();
    let weight = DMatrix::from_row_slice(OUTPUTS, INPUTS, &parameters[..INPUTS * OUTPUTS]).transpose();
    for rows in [9, 864] {
        let x: Vec<f32> = (0..rows * INPUTS).map(number).collect();
        let (matrix, mut product) =
            (DMatrix::from_row_slice(rows, INPUTS, &x), DMatrix::zeros(rows, OUTPUTS));
        let (mut layer, mut y) = (net::Layer::new(INPUTS, OUTPUTS), vec![0.0; rows * OUTPUTS]);
        let calls = 8640 / rows;
        let mut ratios = Vec::new();
        let mut least = [f64::INFINITY; 2];
        for _ in 0..REPETITIONS {
            let start = Instant::now();
            for _ in 0..calls {
                layer.forward(&parameters, black_box(&x), &mut y);
                black_box(&y);
            }
            let ours = start.elapsed().as_secs_f64() * 1e6 / calls as f64;
            let start = Instant::now();
            for _ in 0..calls {
                product.gemm(1.0, black_box(&matrix), &weight, 0.0);
                black_box(&product);
            }
            let theirs = start.elapsed().as_secs_f64() * 1e6 / calls as f64;
            least = [least[0].min(ours), least[1].min(theirs)];
            ratios.push(theirs / ours);
        }
        ratios.sort_by(f64::total_cmp);
        let [low, median, high] = [1, 2, 3].map(|quarter| ratios[REPETITIONS * quarter / 4]);
        println!(
            "{rows} rows: nalgebra / ours {median:.2} ({low:.2}..{high:.2}); minima {:.1} us, {:.1} us",
            least[1], least[0]
        );
    }
}
