// A flight through the core's headers alone, as a vehicle's firmware compiles them: no exceptions,
// no RTTI. Reads a filter's memory and samples, writes estimates.
#include <cstdio>
#include <vector>

#include "../../core/batch.hpp"
#include "../../core/imu.hpp"

using namespace windwrench;

// rotor speeds, position, quaternion, gyro, accelerometer; NaN: not measured
struct Row {
  double z[11], imu[6];
};

template <class S>
void fly(const Filter<double> &start, const std::vector<Row> &rows, bool with_imu) {
  static Filter<S> f;
  convert(start, f);
  if (with_imu) {
    for (int i = 0; i < BIASES; i++) {
      f.imu.prior[i] = S(start.imu.prior[i]), f.imu.walk[i] = S(start.imu.walk[i]);
      f.imu.bound[i] = S(start.imu.bound[i]);
    }
    for (int i = 0; i < 3; i++) f.imu.gate[i] = S(start.imu.gate[i]);
    forget_biases(f.imu);
    begin_imu(f);
  }
  for (const Row &row : rows) {
    Innovation<S> n;
    for (int i = 0; i < 11; i++) f.z[i] = S(row.z[i]);
    if (with_imu) step_with_biases(f, 3, f.settings.period, S(0), n);
    else step(f, 3, f.settings.period, S(0), n);
    if (with_imu) {
      S imu[6];
      for (int i = 0; i < 6; i++) imu[i] = S(row.imu[i]);
      take_in_imu(f, imu, true, true);
    }
    double out[N + 2];
    for (int i = 0; i < N + 1; i++) out[i] = double(f.belief.x[i]);
    out[N + 1] = double(f.belief.status);
    fwrite(out, sizeof(out), 1, stdout);
  }
}

template <class T> void fly_lanes(const Filter<double> &start, const std::vector<Row> &rows) {
  using S = Single<T>;
  static Filter<S> like;
  static Belief<T> block;
  convert(start, like);
  put(block, like.belief, 0);
  for (const Row &row : rows) {
    double samples[lanes_of<T>][11], numbers[lanes_of<T>][30], variances[lanes_of<T>][N];
    for (auto &sample : samples)
      for (int i = 0; i < 11; i++) sample[i] = row.z[i];
    samples[1][4] += 5.0;  // one lane's position always jumps: the others do not mind
    step_blocks(like, &block, long(lanes_of<T>), samples[0], numbers[0], variances[0]);
    double out[N + 2];
    for (int i = 0; i < N + 1; i++) out[i] = numbers[lanes_of<T> - 1][i];
    out[N + 1] = numbers[lanes_of<T> - 1][STATE];
    fwrite(out, sizeof(out), 1, stdout);
  }
}

int main() {
  static Filter<double> start;
  std::vector<Row> rows;
  Row row;
  if (fread(static_cast<void *>(&start), sizeof(start), 1, stdin) != 1) return 1;
  while (fread(&row, sizeof(row), 1, stdin) == 1) rows.push_back(row);
  fly<double>(start, rows, false);
  fly_lanes<Lanes<double, 4>>(start, rows);
  fly<float>(start, rows, false);
  fly_lanes<Lanes<float, 8>>(start, rows);
  fly<double>(start, rows, true);
  fly<float>(start, rows, true);
}
