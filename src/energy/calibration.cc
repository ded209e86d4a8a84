#include "energy/calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include "base/median.h"
#include "dynamics/drive_model.h"
#include "energy/acceleration_filter.h"
#include "energy/drive_equations.h"
#include "energy/wheel_inertia.h"
#include "telemetry/payload.h"

namespace joulecast::energy {
namespace {

// Segments of constant speed last at least three quarters of segment_s (longer ones are cut into pieces of
// segment_s) and go straight: wheel speeds differ by less than straight_share of their mean. Thesis (3-1)
// applies only to such segments, which the smooth windows of windows/windows.h, made for any motion, do not
// select.
constexpr double segment_s = 0.5;
constexpr double straight_share = 0.2;
constexpr double block_s = 1.0;
constexpr double least_significance = 2;  // standard errors from zero; other estimates are insignificant
constexpr std::size_t least_blocks = 4;

// Columns of the torque equation.
enum Column : Eigen::Index { friction_right, friction_left, viscous, straight, turning, column_count };
using Row = Eigen::Matrix<double, column_count, 1>;
using Square = Eigen::Matrix<double, column_count, column_count>;
using Fitted = std::array<bool, column_count>;

// One side at one moment, or the mean over a steady segment.
struct Observation {
  Row row = Row::Zero();
  double current_a = 0;
  double voltage_v = 0;  // NaN: not measured
  double known_nm = 0;
};

// Sums of the least-squares problems over one interval.
struct Block {
  Square normal = Square::Zero();
  Row by_current = Row::Zero(), by_voltage = Row::Zero(), by_known = Row::Zero();
  // V against (i, w): sums of i^2, i w, w^2, V i, V w
  double ii = 0, iw = 0, ww = 0, vi = 0, vw = 0;

  void add(const Observation& o, double weight) {
    normal += weight * o.row * o.row.transpose();
    by_current += weight * o.current_a * o.row;
    by_known += weight * o.known_nm * o.row;
    if (!std::isfinite(o.voltage_v)) return;
    const double w = o.row[viscous];
    by_voltage += weight * o.voltage_v * o.row;
    ii += weight * o.current_a * o.current_a;
    iw += weight * o.current_a * w;
    ww += weight * w * w;
    vi += weight * o.voltage_v * o.current_a;
    vw += weight * o.voltage_v * w;
  }

  Block& operator+=(const Block& b) { return combine(b, 1); }
  Block& operator-=(const Block& b) { return combine(b, -1); }

 private:
  Block& combine(const Block& b, double s) {
    normal += s * b.normal;
    by_current += s * b.by_current;
    by_voltage += s * b.by_voltage;
    by_known += s * b.by_known;
    ii += s * b.ii;
    iw += s * b.iw;
    ww += s * b.ww;
    vi += s * b.vi;
    vw += s * b.vw;
    return *this;
  }
};

struct Data {
  std::vector<Block> blocks;
  std::vector<Observation> observations;
  bool has_voltage = true;
  double slowest_rad_s = std::numeric_limits<double>::infinity(), fastest_rad_s = 0;
};

// Fitted: R, K_w n, and the torque equation's coefficients [N m, N m s/rad, kg m^2].
struct Solution {
  double resistance_ohm = 0;
  double constant_v_s_rad = 0;
  Row torque = Row::Zero();
};
using Flat = Eigen::Matrix<double, column_count + 2, 1>;
Flat flatten(const Solution& s) {
  Flat flat;
  flat << s.resistance_ohm, s.constant_v_s_rad, s.torque;
  return flat;
}

class Calibrator {
 public:
  Calibrator(const robot::RobotModel& robot, const CalibrationOptions& options, dynamics::DriveModel known)
      : robot_(robot), options_(options), known_(std::move(known)) {
    const WheelInertia inertia = wheel_inertia(robot);
    file_.resistance_ohm = robot.motor.resistance_ohm;
    file_.constant_v_s_rad = robot.motor.voltage_constant_v_s_rad * robot.motor.gear_ratio;
    file_.torque << robot.motor.friction_torque_nm[0], robot.motor.friction_torque_nm[1],
        robot.motor.viscous_friction_nm_s_rad, inertia.straight, inertia.turning;
    ratio_ = robot.motor.torque_constant_nm_a / robot.motor.voltage_constant_v_s_rad;
    const bool whole = options.method == CalibrationMethod::whole;
    fitted_ = {true, true, true, whole, whole};
    notes_.fill("");
    if (!whole) notes_[straight] = notes_[turning] = "constant speed does not show inertia";
  }

  Result<DriveCalibration> run(std::span<const DriveRun> runs) {
    if (Result<void> gathered = gather(runs); !gathered) return tl::unexpected(gathered.error());
    if (data_.blocks.size() < least_blocks)
      return invalid("runs", "hold only " + std::to_string(data_.blocks.size()) + " segments of " +
                                 (options_.method == CalibrationMethod::steady ? "steady straight" : "") +
                                 " motion with measured currents; " + std::to_string(least_blocks) +
                                 " are needed");
    for (const Block& b : data_.blocks) total_ += b;
    fit_electrical_ = data_.has_voltage;
    drop_unmoved_columns();
    // Insignificant estimates are held one at a time, since each changes the others.
    Solution solution;
    Flat error;
    for (;;) {
      solution = solve(total_);
      error = jackknife();
      if (!drop_weakest(solution, error)) break;
    }
    return conclude(solution, error);
  }

 private:
  Result<void> gather(std::span<const DriveRun> runs) {
    double top = 0;
    bool any_current = false;
    for (const DriveRun& run : runs) {
      for (const signals::Sample& s : run.samples) {
        for (std::size_t side : {0u, 1u}) {
          top = std::max(top, std::fabs(s.wheel_velocity_rad_s[side]));
          any_current |= std::isfinite(s.motor_current_a[side]);
        }
      }
    }
    if (!any_current) return invalid("motor_current", "is not measured in any of the runs");
    moving_rad_s_ = moving_share * top;
    steady_rad_s2_ = options_.steady_fraction_1_s * top;
    half_window_s_ = half_window_for(runs);
    for (const DriveRun& run : runs) gather(run);
    return {};
  }

  struct Moment {
    double t_s = 0;
    std::array<Observation, 2> sides;
  };

  void gather(const DriveRun& run) {
    const auto seconds = [&](std::size_t k) {
      return 1e-6 * static_cast<double>(run.samples[k].utime_us - run.samples[0].utime_us);
    };
    std::vector<SpeedSample> window;
    std::vector<Moment> stretch;
    std::size_t first = 0;
    telemetry::MissionPayload payload(run.payload_kg);
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
      const double payload_kg = payload.take(run.samples[k].payload_kg);
      const double reach = half_window_s_ * (1 + 1e-9);
      while (seconds(k) - seconds(first) > reach) ++first;
      window.clear();
      for (std::size_t j = first; j < run.samples.size() && seconds(j) - seconds(k) <= reach; ++j)
        window.push_back({seconds(j), run.samples[j].wheel_velocity_rad_s});
      const std::array<double, 2> acceleration = fitted_acceleration(window, k - first);
      const double length = options_.method == CalibrationMethod::steady ? segment_s : block_s;
      const bool gap = !stretch.empty() && seconds(k) - stretch.back().t_s > 2 * half_window_s_;
      // At the ends of a record the filter fits only a line.
      const bool inside = k > first && k + 1 < first + window.size();
      const bool fit = inside && usable(run.samples[k], acceleration);
      if (gap || !fit || (!stretch.empty() && seconds(k) - stretch.front().t_s >= length))
        close(stretch, seconds(k) - (stretch.empty() ? 0 : stretch.front().t_s));
      if (fit)
        stretch.push_back(observe(run.samples[k], run.climb_at(k), acceleration, seconds(k), payload_kg));
    }
    if (!stretch.empty()) close(stretch, stretch.back().t_s - stretch.front().t_s);
  }

  bool usable(const signals::Sample& s, const std::array<double, 2>& acceleration) const {
    for (std::size_t side : {0u, 1u}) {
      if (!std::isfinite(s.motor_current_a[side])) return false;
      if (!(std::fabs(s.wheel_velocity_rad_s[side]) > moving_rad_s_)) return false;
    }
    if (options_.method == CalibrationMethod::whole) return true;
    const double right = s.wheel_velocity_rad_s[0], left = s.wheel_velocity_rad_s[1];
    return std::fabs(acceleration[0]) < steady_rad_s2_ && std::fabs(acceleration[1]) < steady_rad_s2_ &&
           std::fabs(right - left) < straight_share * std::fabs(right + left) / 2;
  }

  Moment observe(const signals::Sample& s, double climb_rad, const std::array<double, 2>& acceleration,
                 double t_s, double payload_kg) {
    dynamics::Instant at;
    at.wheel_speed_rad_s = s.wheel_velocity_rad_s;
    at.wheel_acceleration_rad_s2 = acceleration;
    at.payload_kg = payload_kg;
    at.x_m = s.pose[0];
    at.y_m = s.pose[1];
    at.heading_rad = s.pose[2];
    at.climb_rad = climb_rad;
    const auto total = known_.balance(at).total_nm;
    const double mean = (acceleration[0] + acceleration[1]) / 2,
                 difference = (acceleration[0] - acceleration[1]) / 2;
    Moment moment{t_s, {}};
    for (std::size_t side : {0u, 1u}) {
      const double w = s.wheel_velocity_rad_s[side], sign = side == robot::right ? 1 : -1;
      Observation& o = moment.sides[side];
      o.row[side == robot::right ? friction_right : friction_left] =
          dynamics::smooth_sign(w, dynamics::friction_width_rad_s);
      o.row[viscous] = w;
      o.row[straight] = mean;
      o.row[turning] = sign * difference;
      o.current_a = s.motor_current_a[side];
      o.voltage_v = s.motor_voltage_v[side];
      // `known_` has no friction but the file's inertia; the inertia without payload is fitted instead.
      o.known_nm = total[side] - file_.torque[straight] * mean - file_.torque[turning] * sign * difference;
      data_.slowest_rad_s = std::min(data_.slowest_rad_s, std::fabs(w));
      data_.fastest_rad_s = std::max(data_.fastest_rad_s, std::fabs(w));
    }
    return moment;
  }

  // Ends a segment that lasted `length_s` and adds it to the data.
  void close(std::vector<Moment>& stretch, double length_s) {
    const bool steady = options_.method == CalibrationMethod::steady;
    if (stretch.empty() || (steady && length_s < segment_s * 0.75)) return stretch.clear();
    Block block;
    for (std::size_t side : {0u, 1u}) {
      if (!steady) {
        for (const Moment& m : stretch) count(block, m.sides[side], 1);
        continue;
      }
      Observation mean;
      const double n = static_cast<double>(stretch.size());
      for (const Moment& m : stretch) {
        mean.row += m.sides[side].row / n;
        mean.current_a += m.sides[side].current_a / n;
        mean.voltage_v += m.sides[side].voltage_v / n;
        mean.known_nm += m.sides[side].known_nm / n;
      }
      count(block, mean, n);
    }
    samples_ += stretch.size();
    data_.blocks.push_back(block);
    stretch.clear();
  }

  void count(Block& block, const Observation& o, double weight) {
    block.add(o, weight);
    data_.observations.push_back(o);
    data_.has_voltage &= std::isfinite(o.voltage_v);
  }

  // A column that the others explain to rounding, or that is zero, cannot be fitted at all; dry friction is
  // dropped last.
  void drop_unmoved_columns() {
    for (Eigen::Index k = column_count; k-- > 0;) {
      if (!fitted_[static_cast<std::size_t>(k)]) continue;
      Row others = Row::Zero();
      const double own = total_.normal(k, k);
      double left = own;
      Square a = Square::Identity();
      Row b = Row::Zero();
      for (Eigen::Index i = 0; i < column_count; ++i) {
        if (i == k || !fitted_[static_cast<std::size_t>(i)]) continue;
        b[i] = total_.normal(i, k);
        for (Eigen::Index j = 0; j < column_count; ++j)
          if (j != k && fitted_[static_cast<std::size_t>(j)]) a(i, j) = total_.normal(i, j);
      }
      others = a.ldlt().solve(b);
      left -= b.dot(others);
      if (!(left > 1e-9 * own)) hold(k, file_.torque[k], "these runs do not distinguish it from the others");
    }
  }

  void hold(Eigen::Index k, double value, std::string_view why) {
    fitted_[static_cast<std::size_t>(k)] = false;
    notes_[static_cast<std::size_t>(k)] = why;
    file_.torque[k] = value;
  }

  // Least squares for the fitted columns, the others held: target = K i - known_nm - held.
  static Row fit(const Block& sums, const Row& target, const Row& held, const Fitted& fitted) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < column_count; ++k)
      if (fitted[static_cast<std::size_t>(k)]) free.push_back(k);
    const auto n = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd a(n, n);
    Eigen::VectorXd b(n);
    const Row rest = target - sums.normal * held;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Index from = free[static_cast<std::size_t>(i)];
      b[i] = rest[from];
      for (Eigen::Index j = 0; j < n; ++j) a(i, j) = sums.normal(from, free[static_cast<std::size_t>(j)]);
    }
    const Eigen::VectorXd x = a.ldlt().solve(b);
    Row result = held;
    for (Eigen::Index i = 0; i < n; ++i) result[free[static_cast<std::size_t>(i)]] = x[i];
    return result;
  }

  Solution solve(const Block& sums) const {
    Solution s = file_;
    const bool resistance = fit_electrical_ && !options_.resistance_known && !resistance_held_;
    const bool constant = fit_electrical_ && !options_.constants_known && !constant_held_;
    if (resistance && constant && options_.method == CalibrationMethod::steady) {
      constexpr Fitted line{true, true, true, false, false};
      const Row b = fit(sums, sums.by_current, Row::Zero(), line);
      const Row c = fit(sums, sums.by_voltage, Row::Zero(), line);
      s.resistance_ohm = (c[0] * b[0] + c[1] * b[1]) / (b[0] * b[0] + b[1] * b[1]);
      s.constant_v_s_rad = c[viscous] - s.resistance_ohm * b[viscous];
    } else if (resistance && constant) {
      const double determinant = sums.ii * sums.ww - sums.iw * sums.iw;
      s.resistance_ohm = (sums.vi * sums.ww - sums.vw * sums.iw) / determinant;
      s.constant_v_s_rad = (sums.vw * sums.ii - sums.vi * sums.iw) / determinant;
    } else if (resistance) {
      s.resistance_ohm = (sums.vi - s.constant_v_s_rad * sums.iw) / sums.ii;
    } else if (constant) {
      s.constant_v_s_rad = (sums.vw - s.resistance_ohm * sums.iw) / sums.ww;
    }
    Row held = file_.torque;
    for (Eigen::Index k = 0; k < column_count; ++k)
      if (fitted_[static_cast<std::size_t>(k)]) held[k] = 0;
    s.torque = fit(sums, ratio_ * s.constant_v_s_rad * sums.by_current - sums.by_known, held, fitted_);
    return s;
  }

  Flat jackknife() const {
    const double n = static_cast<double>(data_.blocks.size());
    Flat mean = Flat::Zero(), square = Flat::Zero();
    std::vector<Flat> all;
    all.reserve(data_.blocks.size());
    for (const Block& left_out : data_.blocks) {
      Block rest = total_;
      rest -= left_out;
      all.push_back(flatten(solve(rest)));
      mean += all.back() / n;
    }
    for (const Flat& one : all) square += (one - mean).cwiseAbs2();
    return (square * (n - 1) / n).cwiseSqrt();
  }

  bool drop_weakest(const Solution& s, const Flat& error) {
    // Where the voltages do not distinguish R from K_w, the file's K_w is the surer of the two: it follows
    // from geometry and the motor's speed constant.
    if (fit_electrical_ && !options_.resistance_known && !resistance_held_ &&
        !(s.resistance_ohm > least_significance * error[0])) {
      (options_.constants_known || constant_held_ ? resistance_held_ : constant_held_) = true;
      return true;
    }
    // Friction cannot drive: a negative estimate is set to zero. An inertia that the motion shows poorly is
    // better taken from the robot file.
    Eigen::Index weakest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < column_count; ++k) {
      if (!fitted_[static_cast<std::size_t>(k)]) continue;
      const double significance = s.torque[k] / error[k + 2];
      const double needed = k <= viscous ? 0 : least_significance;
      if (!(significance >= needed) && !(significance >= least)) {
        weakest = k;
        least = significance;
      }
    }
    if (weakest < 0) return false;
    weakest <= viscous
        ? hold(weakest, 0, "came out negative; held at zero")
        : hold(weakest, file_.torque[weakest], "not distinguishable from zero; held at the file's");
    return true;
  }

  DriveCalibration conclude(const Solution& s, const Flat& error) const {
    DriveCalibration result;
    result.robot = robot_;
    result.blocks = data_.blocks.size();
    result.samples = samples_;
    result.slowest_rad_s = data_.slowest_rad_s;
    result.fastest_rad_s = data_.fastest_rad_s;
    const double gear = robot_.motor.gear_ratio;
    const auto electrical = [&](bool known, bool held) -> std::string_view {
      if (!data_.has_voltage) return "voltage is not measured; the file's";
      if (known) return "given as known";
      return held ? "the voltages do not distinguish R from K_w; held at the file's" : "";
    };
    const auto add = [&](std::string_view name, std::string_view unit, double value, double standard_error,
                         bool fitted, std::string_view note) {
      result.estimates.push_back({name, unit, value, fitted ? standard_error : 0, fitted, std::string(note)});
    };
    const std::string_view r_note = electrical(options_.resistance_known, resistance_held_);
    const std::string_view k_note = electrical(options_.constants_known, constant_held_);
    add("resistance_ohm", "ohm", s.resistance_ohm, error[0], r_note.empty(), r_note);
    add("voltage_constant_v_s_rad", "V s/rad", s.constant_v_s_rad / gear, error[1] / gear, k_note.empty(),
        k_note);
    add("torque_constant_nm_a", "N m/A", ratio_ * s.constant_v_s_rad / gear, ratio_ * error[1] / gear,
        k_note.empty(), k_note.empty() ? "the file's ratio to the voltage constant" : k_note);
    constexpr std::array<std::pair<std::string_view, std::string_view>, column_count> names{
        {{"friction_torque_nm right", "N m"},
         {"friction_torque_nm left", "N m"},
         {"viscous_friction_nm_s_rad", "N m s/rad"},
         {"straight inertia", "kg m2"},
         {"turning inertia", "kg m2"}}};
    constexpr std::array<std::string_view, column_count> meanings{"", "", "", "m r^2/2 + I_w + I_s",
                                                                  "2 I c^2 + I_w + I_s"};
    for (std::size_t k = 0; k < column_count; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      add(names[k].first, names[k].second, s.torque[at], error[at + 2], fitted_[k],
          fitted_[k] ? meanings[k] : notes_[k]);
    }
    robot::Motor& motor = result.robot.motor;
    motor.resistance_ohm = s.resistance_ohm;
    motor.voltage_constant_v_s_rad = s.constant_v_s_rad / gear;
    motor.torque_constant_nm_a = ratio_ * s.constant_v_s_rad / gear;
    motor.friction_torque_nm = {s.torque[friction_right], s.torque[friction_left]};
    motor.viscous_friction_nm_s_rad = s.torque[viscous];
    if (fitted_[straight]) place_straight_inertia(s.torque[straight], result.robot);
    if (fitted_[turning]) place_turning_inertia(s.torque[turning], result.robot);

    double torque_square = 0, voltage_square = 0;
    for (const Observation& o : data_.observations) {
      const double nm = ratio_ * s.constant_v_s_rad * o.current_a - o.known_nm - s.torque.dot(o.row);
      const double v = o.voltage_v - s.resistance_ohm * o.current_a - s.constant_v_s_rad * o.row[viscous];
      torque_square += nm * nm;
      voltage_square += v * v;
    }
    const double n = static_cast<double>(data_.observations.size());
    result.torque_rms_nm = std::sqrt(torque_square / n);
    result.voltage_rms_v = std::sqrt(voltage_square / n);
    return result;
  }

  const robot::RobotModel& robot_;
  CalibrationOptions options_;
  dynamics::DriveModel known_;
  Solution file_;  // the file's values; parameters that are not fitted stay there
  double ratio_ = 1;
  Fitted fitted_{};
  std::array<std::string_view, column_count> notes_{};
  bool fit_electrical_ = true;
  bool resistance_held_ = false, constant_held_ = false;
  Data data_;
  Block total_;
  std::size_t samples_ = 0;
  double moving_rad_s_ = 0, steady_rad_s2_ = 0, half_window_s_ = 0;
};

}  // namespace

double half_window_for(std::span<const DriveRun> runs) {
  std::vector<double> intervals;
  for (const DriveRun& run : runs)
    for (std::size_t k = 1; k < run.samples.size(); ++k)
      intervals.push_back(1e-6 * static_cast<double>(run.samples[k].utime_us - run.samples[k - 1].utime_us));
  if (intervals.empty()) return default_half_window_s;
  return std::max(default_half_window_s, 2.5 * upper_median(std::move(intervals)));
}

Result<DriveCalibration> calibrate_drive(const robot::RobotModel& robot, std::span<const DriveRun> runs,
                                         const CalibrationOptions& options) {
  robot::RobotModel frictionless = robot;
  frictionless.motor.friction_torque_nm = {0, 0};
  frictionless.motor.viscous_friction_nm_s_rad = 0;
  Result<dynamics::DriveModel> known = dynamics::drive_model(frictionless);
  if (!known) return tl::unexpected(std::move(known.error()));
  return Calibrator(robot, options, std::move(*known)).run(runs);
}

Result<void> meter_run(Meter& meter, const DriveRun& run, double gap_bridge_s) {
  const std::vector<signals::Step> steps = signals::steps_of(run.samples, gap_bridge_s);
  telemetry::MissionPayload payload(run.payload_kg);
  for (std::size_t k = 0; k < run.samples.size(); ++k) {
    signals::Sample sample = run.samples[k];
    sample.payload_kg = payload.take(sample.payload_kg);
    Result<void> added = meter.add(sample, run.climb_at(k), steps[k] == signals::Step::bridged);
    if (!added) return added;
  }
  return meter.flush();
}

Result<signals::Accounts> metered(const robot::RobotModel& robot, const DriveRun& run,
                                  const MeterSettings& settings) {
  Result<dynamics::DriveModel> drive = dynamics::drive_model(robot);
  if (!drive) return tl::unexpected(std::move(drive.error()));
  Meter meter(std::move(*drive), settings, [](const MeterPoint&) {});
  if (Result<void> done = meter_run(meter, run, settings.gap_bridge_s); !done)
    return tl::unexpected(std::move(done.error()));
  return meter.accounts();
}

}  // namespace joulecast::energy
