#pragma once

#include <functional>
#include <limits>
#include <memory>

#include "gap/posterior/evidence.h"

namespace joulecast::gap::posterior {

// The equations at the point that the walk reached, and the posterior of all the data there. Members refer to
// each other: it is neither copied nor moved.
struct Fit {
  Fit() = default;
  explicit Fit(Data recordings);
  Fit(const Fit&) = delete;
  Fit& operator=(const Fit&) = delete;

  Data data;
  Catalogue catalogue;
  std::vector<Function> functions;
  double gap = 0;               // mean |measured - file's model| of power, over mean power
  bool linear = false;          // exact at all strengths, relative to a model given with the file
  Eigen::VectorXd unchanged_w;  // power by row without any effect
  Equations equations;
  std::vector<Noise> noise;  // of each channel
  Grams grams;
  std::unique_ptr<Prior> prior;
  std::vector<Model> models;
  ReducedByFactor reduced;
  Probabilities plain;                 // by all blocks once
  std::size_t factor = 0;              // of the likeliest model
  std::vector<SetEvidence> strengths;  // of each model, at that factor
  int steps = 0;

  std::vector<double> once() const { return std::vector<double>(data.blocks, 1.0); }  // weights of blocks
};

// Computes everything that follows from the equations.
void infer(Fit& fit);

// Power by row at these strengths of the effects.
Eigen::VectorXd power_of(const Fit& fit, const Eigen::VectorXd& strengths);

// Posterior mean of the calibration of all columns given these coefficients [E F]; `blocks`: their sum.
Eigen::VectorXd calibration(const Equations& equations, const Information& blocks, double factor,
                            const Eigen::VectorXd& coefficients);

// The likeliest model; its strengths [E F] without its function, and the calibration of all columns with
// them.
std::size_t likeliest(const Fit& fit);
struct Parts {
  Eigen::VectorXd strengths, calibration;
};
Parts parts_of(const Fit& fit);

// Mean |measured - modelled| of power by row, over mean power.
double missed(const Data& data, const Eigen::VectorXd& power_w);

// Strengths on the way from the point of the equations to others, the power there by row, and its error.
struct Step {
  Eigen::VectorXd strengths, power_w;
  double missed = std::numeric_limits<double>::infinity();
};

// The best of the lengths of a step by blocks with these weights.
Step damped_step(const Fit& fit, const Eigen::VectorXd& target, std::span<const double> weights);

// Damped Gauss-Newton. Null where `goes_on`, called before each step, returned false.
std::unique_ptr<Fit> walk(Data recordings, const std::function<bool()>& goes_on = {});

// The fit of these missions, with a delay of sensors removed. Null as walk(); errors of make_data().
Result<std::unique_ptr<Fit>> fit_missions(std::span<const telemetry::Recording> missions,
                                          const robot::RobotModel& robot,
                                          const std::function<bool()>& goes_on = {});

}  // namespace joulecast::gap::posterior
