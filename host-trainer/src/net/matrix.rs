//! Matrix products: the three that a linear layer needs.
//!
//! All matrices are stored row by row. The products run on one thread and are deterministic.

use gemm::Parallelism;

use super::rowwise::add_rows;
use super::shape::Linear;

/// A matrix by its numbers and the distance between rows and between columns.
#[derive(Clone, Copy)]
struct View<'a> {
    numbers: &'a [f32],
    row_stride: usize,
    column_stride: usize,
}

impl<'a> View<'a> {
    fn rows(numbers: &'a [f32], columns: usize) -> Self {
        Self { numbers, row_stride: columns, column_stride: 1 }
    }

    fn transposed(numbers: &'a [f32], columns: usize) -> Self {
        Self { numbers, row_stride: 1, column_stride: columns }
    }

    fn covers(&self, rows: usize, columns: usize) -> bool {
        rows == 0
            || columns == 0
            || (rows - 1) * self.row_stride + (columns - 1) * self.column_stride < self.numbers.len()
    }
}

/// `c += a b` with `a` of `[rows, inner]`, `b` of `[inner, columns]`, `c` of `[rows, columns]`.
fn add_product(rows: usize, inner: usize, columns: usize, a: View<'_>, b: View<'_>, c: &mut [f32]) {
    assert!(a.covers(rows, inner) && b.covers(inner, columns) && c.len() == rows * columns);
    if c.is_empty() {
        return;
    }
    // SAFETY: the three matrices lie within their slices (checked above), and `c` is borrowed
    // mutably, so it overlaps neither `a` nor `b`.
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            c.as_mut_ptr(),
            1,
            columns as isize,
            true,
            a.numbers.as_ptr(),
            a.column_stride as isize,
            a.row_stride as isize,
            b.numbers.as_ptr(),
            b.column_stride as isize,
            b.row_stride as isize,
            1.0,
            1.0,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

impl Linear {
    /// `y = x W^T + b` for `rows` rows.
    pub fn forward(&self, parameters: &[f32], rows: usize, x: &[f32], y: &mut [f32]) {
        let bias = self.bias(parameters);
        for row in y.chunks_exact_mut(self.outputs) {
            row.copy_from_slice(bias);
        }
        let w = View::transposed(self.weight(parameters), self.inputs);
        add_product(rows, self.inputs, self.outputs, View::rows(x, self.inputs), w, y);
    }

    /// `dx += dy W`.
    pub fn backward_input(&self, parameters: &[f32], rows: usize, dy: &[f32], dx: &mut [f32]) {
        let w = View::rows(self.weight(parameters), self.inputs);
        add_product(rows, self.outputs, self.inputs, View::rows(dy, self.outputs), w, dx);
    }

    /// `dW += dy^T x` and `db += ` the sum of the rows of `dy`.
    pub fn backward_parameters(&self, rows: usize, x: &[f32], dy: &[f32], gradients: &mut [f32]) {
        let (weight, bias) = self.split_mut(gradients);
        let dy_t = View::transposed(dy, self.outputs);
        add_product(self.outputs, rows, self.inputs, dy_t, View::rows(x, self.inputs), weight);
        add_rows(dy, bias);
    }
}
