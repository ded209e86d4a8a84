#include "energy/power_calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "base/try.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::energy {
namespace {

using Use = std::function<bool(std::size_t block)>;

const Use every_block = [](std::size_t) { return true; };

using PowerFree = Eigen::Array<bool, PowerParameter::count, 1>;
const PowerFree all_free = PowerFree::Constant(true);

// The parameters with the least residual of the battery's power, in units of PowerParameters.
struct PowerFit {
  PowerVector x;
  PowerVector deviation;        // standard, of every parameter that the file does not hold, fitted or not
  Eigen::MatrixXd information;  // of the data alone, correlated windows counted for less
  double inflation = 1;         // of the variance, since errors of neighbouring windows are correlated
  double spread_w = 0;          // robust, of the residuals of moving windows
};

constexpr int most_rounds = 60;
constexpr double settled = 1e-3;  // of a parameter's expected deviation
constexpr double first_damping = 1e-3, most_damping = 1e4;
constexpr double least_spread = 2e-3;        // of the mean power: keeps the weights of exact data finite
constexpr std::size_t fewest_to_class = 20;  // windows that have a spread of their own

// Measured less modelled power of the windows in use.
class Misfit {
 public:
  Misfit(const PowerParameters& parameters, const PowerWindows& data, const Use& use)
      : parameters_(parameters) {
    for (std::size_t k = 0; k < data.windows.size(); ++k) {
      if (!data.whole[k] || !use(data.windows[k].block)) continue;
      windows_.push_back(&data.windows[k]);
      blocks_.push_back(data.windows[k].block);
    }
  }

  Eigen::Index rows() const { return static_cast<Eigen::Index>(windows_.size()); }
  const windows::Window& window(Eigen::Index k) const { return *windows_[static_cast<std::size_t>(k)]; }
  const std::vector<std::size_t>& blocks() const { return blocks_; }  // of the rows

  Eigen::VectorXd left(const PowerVector& x) const {
    const dynamics::DriveModel model = parameters_.model(x);
    Eigen::VectorXd e(rows());
    for (Eigen::Index k = 0; k < e.size(); ++k)
      e[k] = window(k).battery_power_w - metered_power_w(model, window(k));
    return e;
  }

  // Derivatives of the model by each parameter [W], by finite differences from the residuals at x.
  Eigen::MatrixXd slopes(const PowerVector& x, const Eigen::VectorXd& here) const {
    constexpr double step = 1e-4;
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(rows(), PowerParameter::count);
    for (Eigen::Index p = 0; p < PowerParameter::count; ++p) {
      if (!(parameters_.expected(p) > 0)) continue;
      PowerVector up = x;
      up[p] += step;
      j.col(p) = (here - left(up)) / step;
    }
    return j;
  }

 private:
  const PowerParameters& parameters_;
  std::vector<const windows::Window*> windows_;
  std::vector<std::size_t> blocks_;
};

struct Weights {
  Eigen::VectorXd of_row;  // 1/W
  double spread_w = 0;     // of moving windows
};

// Huber's weights over each window's spread.
Weights weigh(const Misfit& misfit, const Eigen::VectorXd& left, double power_w) {
  Weights w{Eigen::VectorXd::Zero(left.size()), 0};
  for (const bool resting : {true, false}) {
    std::vector<Eigen::Index> rows;
    std::vector<double> errors;
    for (Eigen::Index k = 0; k < left.size(); ++k) {
      if ((misfit.window(k).resting[0] && misfit.window(k).resting[1]) != resting) continue;
      rows.push_back(k);
      errors.push_back(left[k]);
    }
    if (errors.size() < fewest_to_class) errors.assign(left.begin(), left.end());
    const double spread = std::max(statistics::spread_about_zero(errors), least_spread * power_w);
    const Eigen::VectorXd own = left(rows);
    w.of_row(rows) = statistics::huber_weights(own, spread).cwiseSqrt() / spread;
    w.spread_w = spread;
  }
  return w;
}

// Minimum of a quadratic, x' A x / 2 - g' x, between bounds. A parameter that reaches a bound stays there and
// is not released again (the number of parameters bounds the rounds).
Eigen::VectorXd bounded_step(const Eigen::MatrixXd& a, const Eigen::VectorXd& g, const Eigen::VectorXd& least,
                             const Eigen::VectorXd& most) {
  Eigen::VectorXd step = Eigen::VectorXd::Zero(g.size());
  std::vector<Eigen::Index> moving;
  for (Eigen::Index k = 0; k < g.size(); ++k)
    if (!(g[k] < 0 && least[k] >= 0) && !(g[k] > 0 && most[k] <= 0)) moving.push_back(k);
  while (!moving.empty()) {
    const Eigen::VectorXd rest = g - a * step;
    const Eigen::VectorXd own =
        a(moving, moving).ldlt().solve(rest(moving) + a(moving, moving) * step(moving));
    std::vector<Eigen::Index> inside;
    for (std::size_t k = 0; k < moving.size(); ++k) {
      const Eigen::Index at = moving[k];
      const double wanted = own[static_cast<Eigen::Index>(k)];
      step[at] = std::clamp(wanted, least[at], most[at]);
      if (step[at] == wanted) inside.push_back(at);
    }
    if (inside.size() == moving.size()) break;
    moving = std::move(inside);
  }
  return step;
}

struct Linear {
  Eigen::MatrixXd weighted;  // slopes by the spread of each row
  Eigen::VectorXd left;      // residuals, weighted likewise
  Eigen::MatrixXd information, scatter;
  double inflation = 1;
};

Linear linearise(const Misfit& misfit, const Weights& weights, const PowerVector& x,
                 const Eigen::VectorXd& left) {
  Linear l;
  l.weighted = weights.of_row.asDiagonal() * misfit.slopes(x, left);
  l.left = weights.of_row.cwiseProduct(left);
  l.information = l.weighted.transpose() * l.weighted;
  // Sums of scores over blocks, about their mean.
  Eigen::MatrixXd score = statistics::block_sums(l.left.asDiagonal() * l.weighted, misfit.blocks());
  score.rowwise() -= score.colwise().mean().eval();
  const auto blocks = static_cast<double>(score.rows());
  l.scatter = (blocks > 1 ? blocks / (blocks - 1) : 1) * score.transpose() * score;
  std::vector<double> ratios;
  for (Eigen::Index p = 0; p < PowerParameter::count; ++p)
    if (l.information(p, p) > 0) ratios.push_back(l.scatter(p, p) / l.information(p, p));
  // The median: idle power that drifts from mission to mission does not show how well friction is identified.
  if (!ratios.empty()) l.inflation = std::max(1.0, statistics::median(std::move(ratios)));
  return l;
}

// Computes the information of the data and the standard deviations.
void judge(const PowerParameters& parameters, const Linear& l, PowerFit& fit) {
  fit.inflation = l.inflation;
  fit.information = l.information / l.inflation;
  std::vector<Eigen::Index> known;
  for (Eigen::Index p = 0; p < PowerParameter::count; ++p)
    if (parameters.expected(p) > 0) known.push_back(p);
  const auto n = static_cast<Eigen::Index>(known.size());
  const Eigen::MatrixXd prior = Eigen::MatrixXd::Identity(n, n);
  const Eigen::MatrixXd covariance = (fit.information(known, known) + prior).inverse();
  const Eigen::MatrixXd middle = l.scatter(known, known) / (l.inflation * l.inflation) + prior;
  const Eigen::MatrixXd own = covariance * middle * covariance;
  fit.deviation.setZero();
  for (Eigen::Index k = 0; k < n; ++k)
    fit.deviation[known[static_cast<std::size_t>(k)]] = std::sqrt(std::max(covariance(k, k), own(k, k)));
}

// Damped Gauss-Newton steps between bounds, with weights and inflation of the point where each begins.
class Descent {
 public:
  Descent(const PowerParameters& parameters, const Misfit& misfit, const PowerFree& free, double power_w)
      : misfit_(misfit), power_w_(power_w) {
    for (Eigen::Index p = 0; p < PowerParameter::count; ++p)
      if (free[p] && parameters.expected(p) > 0) moved_.push_back(p);
    const auto n = static_cast<Eigen::Index>(moved_.size());
    least_.resize(n), most_.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::Index p = moved_[static_cast<std::size_t>(k)];
      least_[k] = parameters.least(p), most_[k] = parameters.most(p);
    }
  }

  PowerVector within(PowerVector x) const {
    x(moved_) = x(moved_).cwiseMax(least_).cwiseMin(most_).eval();
    return x;
  }

  // Moves x; false on convergence.
  bool step(PowerVector& x) {
    const Eigen::VectorXd left = misfit_.left(x);
    const Weights weights = weigh(misfit_, left, power_w_);
    const Linear l = linearise(misfit_, weights, x, left);
    const Eigen::VectorXd start = x(moved_);
    const auto worth = [&](const PowerVector& at) {
      return weights.of_row.cwiseProduct(misfit_.left(at)).squaredNorm() / l.inflation +
             at(moved_).squaredNorm();
    };
    const Eigen::MatrixXd a = l.information(moved_, moved_) / l.inflation;
    const Eigen::VectorXd g = (l.weighted.transpose() * l.left)(moved_) / l.inflation - start;
    const double before = l.left.squaredNorm() / l.inflation + start.squaredNorm();
    for (; damping_ < most_damping; damping_ *= 10) {
      Eigen::MatrixXd damped = a;
      damped.diagonal() *= 1 + damping_;
      damped.diagonal().array() += 1;
      const Eigen::VectorXd moved = bounded_step(damped, g, least_ - start, most_ - start);
      PowerVector next = x;
      next(moved_) = start + moved;
      if (!(worth(next) < before)) continue;
      x = next;
      damping_ = std::max(damping_ / 100, 1e-9);
      return moved.cwiseAbs().maxCoeff() > settled;
    }
    return false;
  }

 private:
  const Misfit& misfit_;
  double power_w_;
  std::vector<Eigen::Index> moved_;
  Eigen::VectorXd least_, most_;
  double damping_ = first_damping;
};

// Huber's estimator (statistics/regression.h) with the file as prior, bounded, by damped Gauss-Newton steps
// on numerical differences (Ceres rests too early where bounds bind, as they do here more often than not).
// Resting and moving windows each have their own spread. `use`: blocks that are used; `free`: parameters that
// are fitted, the rest stays at `start`.
//
// Windows overlap, and the model's errors last longer than one window: scores are summed over blocks (Liang
// and Zeger, Biometrika 73, 1986). Data weigh against the prior by the inflation that the scores show, its
// median over parameters; a parameter's deviation is the larger of the one by this inflation and the one by
// its own scores. Parameters that are not fitted widen the others' deviations by their own uncertainty.
// Fault::invalid without windows.
Result<PowerFit> fit_power(const PowerParameters& parameters, const PowerWindows& data, const Use& use,
                           const PowerFree& free, const PowerVector& start) {
  const Misfit misfit(parameters, data, use);
  if (misfit.rows() == 0)
    return invalid("log", "contains no window with battery power in which wheels keep moving or still");
  const double power_w = scale_of(data.windows).power_w;
  Descent descent(parameters, misfit, free, power_w);
  PowerFit fit{descent.within(start), {}, {}, 1, 0};
  for (int round = 0; round < most_rounds && descent.step(fit.x); ++round) continue;
  const Eigen::VectorXd left = misfit.left(fit.x);
  const Weights weights = weigh(misfit, left, power_w);
  fit.spread_w = weights.spread_w;
  judge(parameters, linearise(misfit, weights, fit.x, left), fit);
  return fit;
}

constexpr double told_deviation = 0.5;  // of the expected deviation
// Information of a parameter alone, with all others fixed: below this the motion is insufficient, above
// it another parameter interferes.
constexpr double own_information = 3;

// The parameter that most reduces the variance of `p` when it is fixed; `p` itself where none does.
Eigen::Index in_the_way(const PowerParameters& parameters, const PowerFit& fit, Eigen::Index p) {
  Eigen::MatrixXd precision = fit.information;
  precision.diagonal().array() += 1;
  const auto variance = [&](Eigen::Index known) {
    Eigen::MatrixXd with = precision;
    if (known != p) with(known, known) += 1e9;
    return with.inverse()(p, p);
  };
  Eigen::Index most = p;
  double least = variance(p);
  for (Eigen::Index other = 0; other < PowerParameter::count; ++other) {
    if (other == p || !(parameters.expected(other) > 0) || !(variance(other) < 0.9 * least)) continue;
    least = variance(other);
    most = other;
  }
  return most;
}

std::string why(const PowerParameters& parameters, const PowerFit& fit, Eigen::Index p) {
  if (!(fit.information(p, p) > own_information)) return std::string(parameter_at(p).not_in_the_motion);
  const Eigen::Index other = in_the_way(parameters, fit, p);
  if (other == p) return "several others together change power in the same way in this motion";
  return std::string(parameter_at(other).name) + " changes power in nearly the same way in this motion";
}

// True if the data identify a parameter: they at least halve its expected deviation.
bool is_identified(const PowerParameters& parameters, const PowerFit& fit, Eigen::Index p) {
  return parameters.expected(p) > 0 && fit.deviation[p] < told_deviation;
}

// Every parameter with its value, standard error and meaning. An effect that was dropped is listed where the
// data show that it is absent.
std::vector<ParameterEstimate> power_estimates(const PowerParameters& parameters, const PowerFit& fit,
                                               const PowerFree& free) {
  std::vector<ParameterEstimate> estimates;
  for (Eigen::Index p = 0; p < PowerParameter::count; ++p) {
    const PowerParameter& own = parameter_at(p);
    const bool known = !(parameters.expected(p) > 0), seen = is_identified(parameters, fit, p);
    const bool dropped = p >= PowerParameter::turning_scrub && !free[p];
    if (dropped && !seen) continue;
    ParameterEstimate e{own.name,
                        own.unit,
                        parameters.resulting(p, fit.x),
                        parameters.expected(p) * fit.deviation[p],
                        seen,
                        std::string(own.meaning)};
    if (known) e.note = "given as known";
    if (!known && !seen) e.note = "not identified: " + why(parameters, fit, p);
    if (dropped) e.note = e.value > 0 ? "no change of the file's detected" : "not detected";
    estimates.push_back(std::move(e));
  }
  return estimates;
}

// Parameters that these data do not identify, with the missing data, and those that no battery power
// identifies.
std::vector<Untold> untold_parameters(const PowerParameters& parameters, const PowerFit& fit) {
  std::vector<Untold> untold;
  for (Eigen::Index p = 0; p < PowerParameter::count; ++p) {
    if (!(parameters.expected(p) > 0) || is_identified(parameters, fit, p)) continue;
    untold.push_back({std::string(parameter_at(p).name), why(parameters, fit, p)});
  }
  untold.push_back({"torque_constant_nm_a, voltage_constant_v_s_rad",
                    "torque times speed is the same power for any constants; only the copper loss depends on "
                    "them, together with the resistance. The file's are kept"});
  untold.push_back({"gear efficiency",
                    "a loss in proportion to the torque appears as friction, inertia and resistance, "
                    "which include it"});
  untold.push_back(
      {"mass, yaw inertia and rotor inertia separately",
       "changes of speed determine only their sums, the straight and the turning inertia; a slope "
       "would determine the mass"});
  untold.push_back(
      {"wheel_radius_m, half_track_m",
       "friction and inertia are estimated for the file's; a map or a gyroscope determines these"});
  untold.push_back({"battery internal_resistance_ohm",
                    "its loss is not in the power at the terminals; see joulecast calibrate battery"});
  return untold;
}

constexpr double least_effect_significance = 2;  // standard errors from zero; other effects are not adopted
// Resistance to turning that sets in immediately, as with sliding tyres, or with the rate of turning.
constexpr std::array scrub_rates_rad_s{0.02, 0.1, 0.3};

double mean_left_w(const dynamics::DriveModel& model, const PowerWindows& data, const Use& use) {
  double left = 0, count = 0;
  for (std::size_t k = 0; k < data.windows.size(); ++k) {
    if (!data.whole[k] || !use(data.windows[k].block)) continue;
    left += std::fabs(data.windows[k].battery_power_w - metered_power_w(model, data.windows[k]));
    ++count;
  }
  return left / count;
}

std::vector<windows::Window> windows_of(const PowerWindows& data, const Use& use) {
  std::vector<windows::Window> own;
  std::ranges::copy_if(data.windows, std::back_inserter(own),
                       [&](const windows::Window& w) { return use(w.block); });
  return own;
}

struct Found {
  PowerParameters parameters;
  PowerFit fit;
  PowerFree free;
};

// Fits all free parameters from the robot file and, since the file may be far off, also from the friction of
// a linear regression.
Result<PowerFit> first_fit(const PowerParameters& parameters, const PowerWindows& data, const Use& use,
                           const robot::RobotModel& robot) {
  const PowerVector file = PowerVector::Zero();
  auto from_file = fit_power(parameters, data, use, all_free, file);
  if (!from_file) return from_file;
  PowerVector plain = file;
  constexpr auto friction = PowerParameter::friction;
  plain[friction] = (PlainRegression(windows_of(data, use), robot).copperless_friction_nm() -
                     parameters.value(friction, file)) /
                    parameters.expected(friction);
  plain[PowerParameter::resistance] = parameters.least(PowerParameter::resistance) / 2;
  auto from_plain = fit_power(parameters, data, use, all_free, plain);
  if (!from_plain) return from_file;
  const bool better = mean_left_w(parameters.model(from_plain->x), data, use) <
                      mean_left_w(parameters.model(from_file->x), data, use);
  return better ? from_plain : from_file;
}

// Drops insignificant effects, the least significant first, as each changes the others.
Result<void> drop_effects(const PowerWindows& data, const Use& use, Found& found) {
  for (;;) {
    Eigen::Index weakest = -1;
    double least = least_effect_significance;
    for (Eigen::Index p = PowerParameter::turning_scrub; p < PowerParameter::count; ++p) {
      const double significance = std::fabs(found.fit.x[p]) / found.fit.deviation[p];
      if (!found.free[p] || significance >= least) continue;
      least = significance;
      weakest = p;
    }
    if (weakest < 0) return {};
    found.free[weakest] = false;
    PowerVector start = found.fit.x;
    start[weakest] = 0;
    TRY_ASSIGN(found.fit, fit_power(found.parameters, data, use, found.free, start));
  }
}

Result<Found> find(const PowerParameters& given, const PowerWindows& data, const Use& use,
                   const robot::RobotModel& robot) {
  std::optional<Found> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double rate_rad_s : scrub_rates_rad_s) {
    PowerParameters parameters = given;
    parameters.set_scrub_rate(rate_rad_s);
    TRY_ASSIGN(auto fit, best ? fit_power(parameters, data, use, best->free, best->fit.x)
                              : first_fit(parameters, data, use, robot));
    const double left = mean_left_w(parameters.model(fit.x), data, use);
    if (left < least) {
      least = left;
      best = Found{parameters, std::move(fit), all_free};
    }
    if (!parameters.scrub_rate_is_free()) break;
  }
  TRY(drop_effects(data, use, *best));
  return std::move(*best);
}

// Between rows that are far apart the motion is unknown. Errors by it grow with the square of the period, so
// that a third of what the estimates change by with every second row is that of all rows (Richardson); it
// widens the deviations.
void widen_by_unknown_motion(std::span<const telemetry::Recording> missions, const PowerWindows& data,
                             const robot::RobotModel& robot, Found& found) {
  if (!std::isfinite(data.phase)) return;
  const auto thinned = power_windows(every_second_row(missions, data.phase), robot, data.phase);
  if (!thinned) return;
  const auto coarse = fit_power(found.parameters, *thinned, every_block, found.free, found.fit.x);
  if (!coarse) return;
  const PowerVector hidden = (coarse->x - found.fit.x) / 3;
  found.fit.deviation = (found.fit.deviation.cwiseAbs2() + hidden.cwiseAbs2()).cwiseSqrt().eval();
}

// Fits each half of the recordings and predicts the other; of all windows, also where wheels start and stop.
Result<MissedPower> predict_halves(const PowerParameters& parameters, const PowerWindows& data,
                                   const robot::RobotModel& robot) {
  const dynamics::DriveModel by_file = parameters.model(PowerVector::Zero());
  MissedPowerMeter missed;
  for (const bool second : {false, true}) {
    const Use use = [&](std::size_t block) { return (2 * block >= data.blocks) == second; };
    TRY_ASSIGN(const auto found, find(parameters, data, use, robot));
    const dynamics::DriveModel model = found.parameters.model(found.fit.x);
    const PlainRegression plain(windows_of(data, use), robot);
    for (const windows::Window& w : data.windows)
      if (!use(w.block)) missed.add(w, by_file, model, plain);
  }
  return missed.value();
}

void tell_extent(const PowerWindows& data, const Found& found, PowerCalibration& out) {
  double power = 0, slowest = std::numeric_limits<double>::infinity(), fastest = 0;
  for (std::size_t k = 0; k < data.windows.size(); ++k) {
    const windows::Window& w = data.windows[k];
    if (!data.whole[k]) continue;
    ++out.windows;
    power += std::fabs(w.battery_power_w);
    for (const std::size_t side : {0u, 1u}) {
      if (!w.moving[side]) continue;
      slowest = std::min(slowest, std::fabs(w.speed_rad_s[side]));
      fastest = std::max(fastest, std::fabs(w.speed_rad_s[side]));
    }
  }
  out.blocks = data.blocks;
  out.effective_windows = static_cast<double>(out.windows) / found.fit.inflation;
  out.reading_s = data.readings.period_s;
  out.held = data.readings.battery_held;
  out.slowest_rad_s = std::isfinite(slowest) ? slowest : 0;
  out.fastest_rad_s = fastest;
  out.power_w = power / static_cast<double>(out.windows);
}

}  // namespace

Result<PowerCalibration> calibrate_from_power(const robot::RobotModel& robot,
                                              std::span<const telemetry::Recording> missions,
                                              const PowerCalibrationOptions& options) {
  std::optional<PowerWindows> data;
  std::optional<Found> found;
  PowerCalibration out;
  for (const double phase : row_phases) {
    TRY_ASSIGN(auto own_data, power_windows(missions, robot, phase));
    TRY_ASSIGN(const auto parameters,
               PowerParameters::make(robot, scale_of(own_data.windows), options.resistance_known));
    TRY_ASSIGN(auto own, find(parameters, own_data, every_block, robot));
    const double left_w = mean_left_w(own.parameters.model(own.fit.x), own_data, every_block);
    const bool far_apart = std::isfinite(own_data.phase);
    if (!found || left_w < out.left_w) {
      out.left_w = left_w;
      data = std::move(own_data);
      found = std::move(own);
    }
    if (!far_apart) break;
  }
  widen_by_unknown_motion(missions, *data, robot, *found);
  if (options.progress) options.progress(0.4);
  TRY_ASSIGN(const auto halves, predict_halves(found->parameters, *data, robot));
  out.robot = found->parameters.robot(found->fit.x);
  out.halves = halves;
  out.estimates = power_estimates(found->parameters, found->fit, found->free);
  out.untold = untold_parameters(found->parameters, found->fit);
  tell_extent(*data, *found, out);
  return out;
}

}  // namespace joulecast::energy
