//! Real roots of polynomials, slowly: between the roots of the derivative they are bracketed.

/// The value of a polynomial given by its coefficients, constant first.
pub(crate) fn value(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

/// All places in an interval where the polynomial changes its sign, in increasing order.
pub(crate) fn roots(coefficients: &[f64], from: f64, to: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let derivative: Vec<f64> =
        coefficients.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect();
    let mut places = vec![from];
    places.extend(roots(&derivative, from, to));
    places.push(to);
    let mut found = Vec::new();
    for pair in places.windows(2) {
        let (mut a, mut b) = (pair[0], pair[1]);
        let below = value(coefficients, a) < 0.0;
        if below == (value(coefficients, b) < 0.0) {
            continue;
        }
        for _ in 0..100 {
            let middle = 0.5 * (a + b);
            if (value(coefficients, middle) < 0.0) == below {
                a = middle;
            } else {
                b = middle;
            }
        }
        found.push(0.5 * (a + b));
    }
    found
}

/// The coefficients of a product.
pub(crate) fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            sums[i + j] += x * y;
        }
    }
    sums
}
