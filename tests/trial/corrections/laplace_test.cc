#include "tests/study/corrections/laplace.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace joulecast::gap::corrections {
namespace {

// Readings y = slope x + noise, with noise of two signs that no slope follows.
struct Line {
  std::vector<double> x, y;
  explicit Line(double slope) {
    for (int k = 0; k < 400; ++k) {
      x.push_back(1 + 0.01 * k);
      y.push_back(slope * x.back() + (k % 2 == 0 ? 0.3 : -0.3));
    }
  }
  Problem problem(double sd, double factor = 1) const {
    Problem p;
    p.unknowns = {{sd, 1e9, false, false}};
    p.independent = {60};
    p.fewest = {20};
    p.compare = [this, factor](const Eigen::VectorXd& at, Comparison& c) {
      c.residual.resize(400, 1);
      c.reading.resize(400, 1);
      for (Eigen::Index k = 0; k < 400; ++k) {
        const auto i = static_cast<std::size_t>(k);
        c.reading(k, 0) = y[i] / factor;
        c.residual(k, 0) = y[i] / factor - (1 + at[0]) * x[i];
      }
    };
    return p;
  }
};

double loss(const Line& line, double at, double factor, double sd) {
  double sum = 0, square = 0;
  for (std::size_t k = 0; k < line.x.size(); ++k) {
    sum += std::fabs(line.y[k] / factor - (1 + at) * line.x[k]);
    square += line.y[k] * line.y[k] / (factor * factor);
  }
  const double relative = std::sqrt(std::acos(-1.0) / 2) * sum / 400 / std::sqrt(square / 400);
  return 30 * std::log(relative * relative + 0.01) + at * at / (2 * sd * sd);
}

// Log of the integral over the parameter, relative to the width of its prior.
double by_quadrature(const Line& line, double factor, double sd) {
  double sum = 0;
  const double step = sd / 2000;
  for (double at = -12 * sd; at <= 12 * sd; at += step) sum += std::exp(-loss(line, at, factor, sd)) * step;
  return std::log(sum / (sd * std::sqrt(2 * std::acos(-1.0))));
}

TEST(LaplaceEvidence, FindsMaximumOfPosterior) {
  const Line line(1.4);
  const Maximum m = maximise(line.problem(0.3), Eigen::VectorXd::Zero(1), 20);
  double best = -1, least = 1e9;
  for (double at = -1; at < 1; at += 1e-4) {
    if (const double l = loss(line, at, 1, 0.3); l < least) {
      least = l;
      best = at;
    }
  }
  EXPECT_NEAR(m.at[0], best, 0.05);
  EXPECT_NEAR(m.log_evidence + m.half_log_determinant, -least, 0.2);  // steps end where one gains 0.05
}

TEST(LaplaceEvidence, AgreesWithQuadrature) {
  // Readings three times too large, against a parameter that is.
  const Line line(3);
  const double sd = 0.3;
  const double scaled = maximise(line.problem(sd, 3), Eigen::VectorXd::Zero(1), 20).log_evidence;
  const double plain = maximise(line.problem(sd, 1), Eigen::VectorXd::Zero(1), 20).log_evidence;
  const double exact = by_quadrature(line, 3, sd) - by_quadrature(line, 1, sd);
  EXPECT_GT(exact, 5);
  EXPECT_NEAR(scaled - plain, exact, 3);  // differences below 3 nats have no meaning
}

TEST(LaplaceEvidence, IgnoresScaleOfReadings) {
  const Line line(1);
  Problem milli = line.problem(0.3);
  const auto compare = milli.compare;
  milli.compare = [&](const Eigen::VectorXd& at, Comparison& c) {
    compare(at, c);
    c.residual *= 1000;
    c.reading *= 1000;
  };
  EXPECT_NEAR(maximise(milli, Eigen::VectorXd::Zero(1), 20).log_evidence,
              maximise(line.problem(0.3), Eigen::VectorXd::Zero(1), 20).log_evidence, 1e-3);
}

TEST(LaplaceEvidence, LostWitnessIsUnexplained) {
  EXPECT_EQ(relative_residual(0, 100, 10, 20), 1);
  EXPECT_NEAR(relative_residual(10, 100, 100, 20), 0.12533, 1e-5);
  EXPECT_NEAR(surprise(60, 0), 60 * std::log(0.1), 1e-9);
}

}  // namespace
}  // namespace joulecast::gap::corrections
