// How likely a flight's poses are to a filter: estimator/innovations.py says by what. Layouts are
// those of its records.
#pragma once
#include "ukf.hpp"

namespace windwrench {

struct FlightRow {
  double t, dt;       // s, and since the row before
  double sample[11];  // mean rotor speeds of the way there, position, quaternion
  double voltage;     // V
  bool measured;      // a pose is there
  bool counted;
};

struct PoseLikelihood {
  double t, nis;
  double log_likelihood;  // of the pose, given all before it
  bool outlier;           // likelier an outlier than a pose of this filter
  double innovation[6];   // of (rho, x)
  double white[6];        // the same, whitened
  double root[6][6];      // of its covariance, lower triangular
};

// Carry a filter to a row; log_inlier, log_outlier: of a pose that is one, and the density of one
// that is not. The filter's own gate and restarts stay out: outliers are stated here
inline void judge_row(Filter<double> &f, const FlightRow &row, double log_inlier,
                      double log_outlier, PoseLikelihood &found) {
  for (int i = 0; i < 11; i++) f.z[i] = row.sample[i];
  const double *z = true_sample(f, row.measured ? 3 : 0, row.dt), slack = 0.1;  // of a period
  int steps = int(larger(1.0, std::ceil(row.dt / f.settings.period - slack)));
  for (int k = 0; k < steps; k++) {
    Prediction<double> w;
    predict(f, z, row.dt / steps, row.voltage, w);
  }
  if (!row.measured) return;
  Innovation<double> n;
  innovate(f.settings, f.belief, z + 4, true, true, n);
  found.t = row.t;
  found.nis = n.nis;
  double log_normal = log_inlier - 3.0 * std::log(2.0 * PI) - 0.5 * n.nis;
  for (int i = 0; i < 6; i++) {
    found.white[i] = n.y[i];
    log_normal -= std::log(n.L[i][i]);
    for (int j = 0; j <= i; j++) {
      found.root[i][j] = n.L[i][j];
      found.innovation[i] += n.L[i][j] * n.y[j];
    }
  }
  found.outlier = !(log_normal > log_outlier);  // an outlier, or numbers that are none
  double likelier = found.outlier ? log_outlier : log_normal;
  double other = found.outlier ? log_normal : log_outlier;
  found.log_likelihood = likelier;
  if (other > likelier - 40.0) found.log_likelihood += std::log1p(std::exp(other - likelier));
  if (found.outlier) return;
  double mean[N];
  take_in(f.settings, n, f.belief, mean);
  remember(f.settings, z + 4, true, true, f.belief);
}

}  // namespace windwrench
