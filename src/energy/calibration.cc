#include "energy/calibration.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <utility>

#include "base/median.h"
#include "base/try.h"
#include "dynamics/drive_model.h"
#include "energy/drive_equations.h"
#include "energy/power_windows.h"
#include "statistics/distributions.h"
#include "windows/windows.h"

namespace joulecast::energy {
namespace {

// Straight: wheel speeds differ by less than this share of their mean.
constexpr double straight_share = 0.2;
constexpr double rounding = 1e-9;         // of sums over exact data, relative
constexpr double least_significance = 2;  // standard errors from zero; other estimates are insignificant
// With fewer blocks than these Student's t is wide and itself uncertain.
constexpr std::size_t enough_missions = 5, wanted_blocks = 8, least_blocks = 4;

// What the equations are made of: the torque equation's columns, the torque that the file explains, and the
// current that drives; current, speed and voltage of the electrical equation. All contain the file's effects,
// so that the coefficients are the file's parameters.
enum Column : Eigen::Index {
  friction_right,
  friction_left,
  viscous,
  straight,
  turning,
  known_nm,
  driving_a,
  current_a,
  speed_rad_s,
  voltage_v,
  column_count
};
constexpr Eigen::Index torque_count = known_nm;
using Values = Eigen::Matrix<double, column_count, 1>;              // of one side in one window
using Moments = Eigen::Matrix<double, column_count, column_count>;  // sums of their products, without noise
using Row = Eigen::Matrix<double, torque_count, 1>;
using Fitted = std::array<bool, torque_count>;

// The readings' noise: covariance of current, voltage and speed of each side.
class ReadingNoise {
 public:
  explicit ReadingNoise(const telemetry::Recording& mission) {
    const std::vector<signals::Sample>& samples = mission.samples;
    for (const signals::Sample& s : samples)
      time_s_.push_back(1e-6 * static_cast<double>(s.utime_us - samples.front().utime_us));
    for (auto& side : differences_) side.assign(samples.size(), Eigen::Vector3d::Zero());
    for (std::size_t k = 0; k + 3 < samples.size(); ++k) {
      // The combination of four neighbours that is zero for every quadratic, for noise as large as a
      // reading's.
      Eigen::Vector4d weight;
      for (Eigen::Index j = 0; j < 4; ++j) {
        weight[j] = 1;
        for (Eigen::Index m = 0; m < 4; ++m)
          if (m != j)
            weight[j] /= time_s_[k + static_cast<std::size_t>(j)] - time_s_[k + static_cast<std::size_t>(m)];
      }
      weight.normalize();
      for (const std::size_t side : {0u, 1u}) {
        for (std::size_t j = 0; j < 4; ++j) {
          const signals::Sample& s = samples[k + j];
          differences_[side][k + 1] +=
              weight[static_cast<Eigen::Index>(j)] *
              Eigen::Vector3d(s.motor_current_a[side], s.motor_voltage_v[side], s.wheel_velocity_rad_s[side]);
        }
      }
    }
  }

  // Of a window's means (`of_means`) and of the slope of the speed, for each side.
  struct OfWindow {
    std::array<Eigen::Matrix3d, 2> of_means;
    std::array<double, 2> of_slope{};
  };
  // The windows weigh with 1 + cos(2 pi t/L) (windows/track.h): the squares of n weights add up to 3/(2n)
  // for a mean and 2 pi^2/(n L^2) for a slope.
  OfWindow in(const windows::Window& w) const {
    const auto at = [&](double t) { return std::ranges::lower_bound(time_s_, t) - time_s_.begin(); };
    const auto first = at(w.t_s - w.length_s / 2), last = at(w.t_s + w.length_s / 2);
    const auto n = static_cast<double>(last - first);
    OfWindow noise;
    for (const std::size_t side : {0u, 1u}) {
      noise.of_means[side].setZero();
      for (auto k = first; k < last; ++k) {
        const Eigen::Vector3d& d = differences_[side][static_cast<std::size_t>(k)];
        noise.of_means[side] += d * d.transpose() / n;
      }
      noise.of_slope[side] = 2 * std::numbers::pi * std::numbers::pi / (n * w.length_s * w.length_s) *
                             noise.of_means[side](2, 2);
      noise.of_means[side] *= 1.5 / n;
    }
    return noise;
  }

 private:
  std::vector<double> time_s_;
  std::array<std::vector<Eigen::Vector3d>, 2> differences_;
};

// Fitted: R, K_w n, and the torque equation's coefficients [N m, N m s/rad, kg m^2].
struct Solution {
  double resistance_ohm = 0;
  double constant_v_s_rad = 0;
  Row torque = Row::Zero();
};
using Flat = Eigen::Matrix<double, torque_count + 2, 1>;
Flat flatten(const Solution& s) {
  Flat flat;
  flat << s.resistance_ohm, s.constant_v_s_rad, s.torque;
  return flat;
}

// V = R i + K w + delay K dw/dt by least squares; what is not fitted is given.
struct Electrical {
  double resistance_ohm, constant_v_s_rad;
  double delay_s = 0;
};
Electrical fit_electrical(const Moments& m, Electrical given, bool resistance, bool constant, bool delay) {
  Values rest = Values::Unit(voltage_v);
  Eigen::Matrix<double, column_count, Eigen::Dynamic> of(column_count, 0);
  const auto add = [&](bool fitted, const Values& column, double value) {
    if (!fitted) rest -= value * column;
    if (fitted) of.conservativeResize(Eigen::NoChange, of.cols() + 1), of.rightCols<1>() = column;
  };
  add(resistance, Values::Unit(current_a), given.resistance_ohm);
  add(constant, Values::Unit(speed_rad_s), given.constant_v_s_rad);
  if (delay) add(true, Values::Unit(straight) + Values::Unit(turning), 0);
  const Eigen::MatrixXd a = of.transpose() * m * of;
  const Eigen::VectorXd x = a.ldlt().solve(of.transpose() * m * rest);
  Eigen::Index next = 0;
  if (resistance) given.resistance_ohm = x[next++];
  if (constant) given.constant_v_s_rad = x[next++];
  if (delay) given.delay_s = x[next] / given.constant_v_s_rad;
  return given;
}

// The file's model, and with more dry or viscous friction.
constexpr double friction_step_nm = 0.01, viscous_step_nm_s_rad = 1e-3;
struct DriveModels {
  dynamics::DriveModel file, with_friction, with_viscous;
};

class Calibrator {
 public:
  Calibrator(const robot::RobotModel& robot, const CalibrationOptions& options, const DriveModels& models)
      : robot_(robot), options_(options), models_(models) {
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

  Result<DriveCalibration> run(std::span<const telemetry::Recording> missions) {
    TRY(gather(missions));
    for (const Moments& b : blocks_) total_ += b;
    drop_unmoved_columns();
    if (has_voltage_) find_delay();
    // Insignificant estimates are held one at a time, since each changes the others.
    Solution solution;
    Flat error;
    const auto all = [&](const Moments& m) -> Eigen::VectorXd { return flatten(solve(m)); };
    do {
      solution = solve(total_);
      error = jackknife(all);
    } while (drop_weakest(solution, error));
    const double shift =
        ratio_ * std::pow(solution.constant_v_s_rad, 2) / solution.resistance_ohm * std::fabs(delay_s_) / 2;
    for (const Eigen::Index k : {straight, turning}) error[2 + k] = std::hypot(error[2 + k], shift);
    return conclude(solution, error);
  }

 private:
  Result<void> gather(std::span<const telemetry::Recording> missions) {
    double top = 0;
    bool any_current = false;
    std::vector<telemetry::Recording> driven;
    for (const telemetry::Recording& mission : missions) {
      for (const signals::Sample& s : mission.samples) {
        for (std::size_t side : {0u, 1u}) {
          top = std::max(top, std::fabs(s.wheel_velocity_rad_s[side]));
          any_current |= std::isfinite(s.motor_current_a[side]);
        }
      }
      if (mission.samples.size() > 3) driven.push_back(mission);
    }
    if (!any_current) return invalid("motor_current", "is not measured in any of the runs");
    const std::size_t parts = driven.size() >= enough_missions ? 1 : (wanted_blocks - 1) / driven.size() + 1;
    const windows::Readings readings = windows::find_readings(driven);
    std::vector<ReadingNoise> noise;
    for (const telemetry::Recording& mission : driven) noise.emplace_back(mission);
    std::vector<Moments> blocks(driven.size() * parts, Moments::Zero());
    for (const windows::Window& w : windows::make_windows(driven, robot_, readings)) {
      if (w.motors_apart || !usable(w, top)) continue;
      const double place = static_cast<double>(parts) * w.t_s / telemetry::length_s(driven[w.mission]);
      // Held readings repeat, which is no noise.
      observe(w, readings.motors_held ? nullptr : &noise[w.mission],
              blocks[w.mission * parts + std::min(parts - 1, static_cast<std::size_t>(place))]);
    }
    std::ranges::copy_if(blocks, std::back_inserter(blocks_), [](const Moments& m) { return !m.isZero(0); });
    if (blocks_.size() >= least_blocks) return {};
    return invalid("log", "contains only " + std::to_string(observations_.size() / 2) + " windows of" +
                              (options_.method == CalibrationMethod::steady ? " steady straight" : "") +
                              " motion with measured currents, in " + std::to_string(blocks_.size()) +
                              " of " + std::to_string(blocks.size()) + " parts; " +
                              std::to_string(least_blocks) + " are needed");
  }

  bool usable(const windows::Window& w, double top_rad_s) const {
    for (std::size_t side : {0u, 1u})
      if (!std::isfinite(w.current_a[side]) || !w.moving[side] ||
          !(std::fabs(w.speed_rad_s[side]) > moving_share * top_rad_s))
        return false;
    if (options_.method == CalibrationMethod::whole) return true;
    const double right = w.speed_rad_s[0], left = w.speed_rad_s[1],
                 steady_rad_s2 = options_.steady_fraction_1_s * top_rad_s;
    return std::fabs(w.acceleration_rad_s2[0]) < steady_rad_s2 &&
           std::fabs(w.acceleration_rad_s2[1]) < steady_rad_s2 &&
           std::fabs(right - left) < straight_share * std::fabs(right + left) / 2;
  }

  void observe(const windows::Window& w, const ReadingNoise* noise, Moments& block) {
    const dynamics::Instant at = windows::instant_of(w);
    const dynamics::DriveModel& model = models_.file;
    const dynamics::TorqueBalance<double> balance = model.balance(at);
    const auto with_friction = models_.with_friction.balance(at).total_nm,
               with_viscous = models_.with_viscous.balance(at).total_nm;
    const dynamics::Parameters<double>& p = model.parameters();
    const robot::Motor& motor = robot_.motor;
    const auto& acceleration = w.acceleration_rad_s2;
    const auto off = noise ? noise->in(w) : ReadingNoise::OfWindow{};
    for (std::size_t side : {0u, 1u}) {
      const double sign = side == robot::right ? 1 : -1;
      const double total = balance.total_nm[side];
      const double viscous_rad_s = (with_viscous[side] - total) / viscous_step_nm_s_rad;
      // Inertia is transmitted by the gear, as friction on its far side.
      const double through = balance.transmitted_nm[side] + p.gear_friction_share * balance.friction_nm[side];
      const double of_inertia = 1 + (through == 0 ? 0 : balance.gear_nm[side] / through);
      // Readings to columns: current, voltage and speed.
      Eigen::Matrix<double, column_count, 3> of_reading = Eigen::Matrix<double, column_count, 3>::Zero();
      of_reading(driving_a, 0) = p.torque_constant_nm_a / (motor.torque_constant_nm_a * motor.gear_ratio);
      of_reading(current_a, 0) = model.resistance(side, at) / motor.resistance_ohm;
      of_reading(voltage_v, 1) = 1;
      of_reading(viscous, 2) = viscous_rad_s / w.speed_rad_s[side];
      of_reading(speed_rad_s, 2) =
          p.voltage_constant_v_s_rad / (motor.voltage_constant_v_s_rad * motor.gear_ratio);
      const double current = (w.current_a[side] - p.motor_current.bias) / (1 + p.motor_current.gain);
      const bool measured = std::isfinite(w.voltage_v[side]);
      has_voltage_ &= measured;
      Values v = of_reading * Eigen::Vector3d(current, 0, w.speed_rad_s[side]);
      v[side == robot::right ? friction_right : friction_left] =
          (with_friction[side] - total) / friction_step_nm;
      v[straight] = of_inertia * (acceleration[0] + acceleration[1]) / 2;
      v[turning] = of_inertia * sign * (acceleration[0] - acceleration[1]) / 2;
      v[known_nm] = total - file_.torque.dot(v.head<torque_count>());
      v[voltage_v] = measured ? (w.voltage_v[side] - p.motor_voltage.bias) / (1 + p.motor_voltage.gain) -
                                    p.brush_drop_v * dynamics::smooth_sign(current, dynamics::brush_width_a)
                              : 0;
      block += v * v.transpose();
      observations_.push_back(v);
      slowest_rad_s_ = std::min(slowest_rad_s_, std::fabs(w.speed_rad_s[side]));
      fastest_rad_s_ = std::max(fastest_rad_s_, std::fabs(w.speed_rad_s[side]));
      if (!noise) continue;
      block -= of_reading * off.of_means[side].unaryExpr([](double c) { return std::isfinite(c) ? c : 0; }) *
               of_reading.transpose();
      const double equal = of_inertia * of_inertia * (off.of_slope[0] + off.of_slope[1]) / 4,
                   apart = of_inertia * of_inertia * sign * (off.of_slope[0] - off.of_slope[1]) / 4;
      block(straight, straight) -= equal;
      block(turning, turning) -= equal;
      block(straight, turning) -= apart;
      block(turning, straight) -= apart;
    }
  }

  // A column that the others explain to rounding, or that is zero, cannot be fitted at all; dry friction is
  // dropped last.
  void drop_unmoved_columns() {
    for (Eigen::Index k = torque_count; k-- > 0;) {
      if (!fitted_[static_cast<std::size_t>(k)]) continue;
      std::vector<Eigen::Index> others = free_columns();
      std::erase(others, k);
      const Eigen::VectorXd b = total_.col(k)(others);
      const Eigen::MatrixXd a = total_(others, others);
      const double left = total_(k, k) - b.dot(a.ldlt().solve(b));
      if (!(left > rounding * total_(k, k)))
        hold(k, file_.torque[k], "these runs do not distinguish it from the others");
    }
  }

  std::vector<Eigen::Index> free_columns() const {
    std::vector<Eigen::Index> free;
    for (Eigen::Index k = 0; k < torque_count; ++k)
      if (fitted_[static_cast<std::size_t>(k)]) free.push_back(k);
    return free;
  }

  void hold(Eigen::Index k, double value, std::string_view why) {
    fitted_[static_cast<std::size_t>(k)] = false;
    notes_[static_cast<std::size_t>(k)] = why;
    file_.torque[k] = value;
  }

  bool fits_resistance() const { return has_voltage_ && !options_.resistance_known && !resistance_held_; }
  bool fits_constant() const { return has_voltage_ && !options_.constants_known && !constant_held_; }

  Solution solve(const Moments& m) const {
    Solution s = file_;
    const Electrical e = fit_electrical(m, {s.resistance_ohm, s.constant_v_s_rad}, fits_resistance(),
                                        fits_constant(), delay_s_ != 0);
    s.resistance_ohm = e.resistance_ohm;
    s.constant_v_s_rad = e.constant_v_s_rad;
    const std::vector<Eigen::Index> free = free_columns();
    s.torque(free).setZero();
    const Row target = ratio_ * s.constant_v_s_rad * m.col(driving_a).head<torque_count>() -
                       m.col(known_nm).head<torque_count>() -
                       m.topLeftCorner<torque_count, torque_count>() * s.torque;
    const Eigen::MatrixXd a = m(free, free);
    const Eigen::VectorXd x = a.ldlt().solve(Eigen::VectorXd(target(free)));
    s.torque(free) = x;
    return s;
  }

  // Half the length of 95 % intervals over the normal distribution's.
  Eigen::VectorXd jackknife(const std::function<Eigen::VectorXd(const Moments&)>& statistic) const {
    const double n = static_cast<double>(blocks_.size());
    std::vector<Eigen::VectorXd> all;
    for (const Moments& left_out : blocks_) all.push_back(statistic(total_ - left_out));
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(all.front().size()), square = mean;
    for (const Eigen::VectorXd& one : all) mean += one / n;
    for (const Eigen::VectorXd& one : all) square += (one - mean).cwiseAbs2();
    const double wider = statistics::student_t_quantile(0.975, n - 1) / statistics::normal_quantile(0.975);
    return wider * (square * (n - 1) / n).cwiseSqrt();
  }

  bool drop_weakest(const Solution& s, const Flat& error) {
    // Where the voltages do not distinguish R from K_w, the file's K_w is the surer of the two: it follows
    // from geometry and the motor's speed constant.
    if (fits_resistance() && !(s.resistance_ohm > least_significance * error[0])) {
      (options_.constants_known || constant_held_ ? resistance_held_ : constant_held_) = true;
      return true;
    }
    // Friction cannot drive: a negative estimate is set to zero. An inertia that the motion shows poorly is
    // better taken from the robot file.
    Eigen::Index weakest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 0; k < torque_count; ++k) {
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
    result.blocks = blocks_.size();
    result.windows = observations_.size() / 2;
    result.slowest_rad_s = slowest_rad_s_;
    result.fastest_rad_s = fastest_rad_s_;
    result.electrical_delay_s = delay_s_;
    const double gear = robot_.motor.gear_ratio;
    const auto electrical = [&](bool known, bool held) -> std::string_view {
      if (!has_voltage_) return "voltage is not measured; the file's";
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
    constexpr std::array<std::pair<std::string_view, std::string_view>, torque_count> names{
        {{"friction_torque_nm right", "N m"},
         {"friction_torque_nm left", "N m"},
         {"viscous_friction_nm_s_rad", "N m s/rad"},
         {"straight inertia", "kg m2"},
         {"turning inertia", "kg m2"}}};
    constexpr std::array<std::string_view, torque_count> meanings{"", "", "", straight_inertia_sum,
                                                                  turning_inertia_sum};
    for (std::size_t k = 0; k < torque_count; ++k) {
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
    for (const Values& o : observations_) {
      const double nm =
          ratio_ * s.constant_v_s_rad * o[driving_a] - o[known_nm] - s.torque.dot(o.head<torque_count>());
      const double v = o[voltage_v] - s.resistance_ohm * o[current_a] - s.constant_v_s_rad * o[speed_rad_s];
      torque_square += nm * nm;
      voltage_square += v * v;
    }
    const double n = static_cast<double>(observations_.size());
    result.torque_rms_nm = std::sqrt(torque_square / n);
    result.voltage_rms_v =
        has_voltage_ ? std::sqrt(voltage_square / n) : std::numeric_limits<double>::quiet_NaN();
    return result;
  }

  // Between two steps of a controller a motor that accelerates loses current, K^2/R of torque for each second
  // and unit of acceleration: readings at one phase are off by half a step's loss at most, which the inertias
  // contain. A delay counts where it is certain and the resistance changes by more than its error with it.
  void find_delay() {
    const auto both = [](const Moments& m) -> Eigen::VectorXd {
      const Electrical without = fit_electrical(m, {}, true, true, false),
                       with = fit_electrical(m, {}, true, true, true);
      return Eigen::Vector3d(with.delay_s, without.resistance_ohm, with.resistance_ohm);
    };
    const Eigen::VectorXd found = both(total_), error = jackknife(both);
    if (std::fabs(found[0]) > least_significance * error[0] &&
        std::fabs(found[2] - found[1]) > least_significance * error[1] + rounding * found[1])
      delay_s_ = found[0];
  }

  const robot::RobotModel& robot_;
  CalibrationOptions options_;
  const DriveModels& models_;
  Solution file_;  // the file's values; parameters that are not fitted stay there
  double ratio_ = 1;
  Fitted fitted_{};
  std::array<std::string_view, torque_count> notes_{};
  bool has_voltage_ = true, resistance_held_ = false, constant_held_ = false;
  double delay_s_ = 0;  // 0: none is seen
  std::vector<Moments> blocks_;
  std::vector<Values> observations_;
  Moments total_ = Moments::Zero();
  double slowest_rad_s_ = std::numeric_limits<double>::infinity(), fastest_rad_s_ = 0;
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

Result<DriveCalibration> calibrate_drive(const robot::RobotModel& robot,
                                         std::span<const telemetry::Recording> missions,
                                         const CalibrationOptions& options) {
  TRY_ASSIGN(const auto effects, dynamics::active_effects(robot));
  robot::RobotModel rubbing = robot, viscous = robot;
  for (double& torque_nm : rubbing.motor.friction_torque_nm) torque_nm += friction_step_nm;
  viscous.motor.viscous_friction_nm_s_rad += viscous_step_nm_s_rad;
  const DriveModels models{{robot, effects}, {rubbing, effects}, {viscous, effects}};
  return Calibrator(robot, options, models).run(missions);
}

Result<void> meter_run(Meter& meter, const DriveRun& run, double gap_bridge_s) {
  const std::vector<signals::Step> steps = signals::steps_of(run.samples, gap_bridge_s);
  telemetry::MissionPayload payload(run.payload_kg);
  for (std::size_t k = 0; k < run.samples.size(); ++k) {
    signals::Sample sample = run.samples[k];
    sample.payload_kg = payload.take(sample.payload_kg);
    TRY(meter.add(sample, run.climb_at(k), steps[k] == signals::Step::bridged));
  }
  return meter.flush();
}

Result<signals::Accounts> metered(const robot::RobotModel& robot, const DriveRun& run,
                                  const MeterSettings& settings) {
  TRY_ASSIGN(auto drive, dynamics::drive_model(robot));
  Meter meter(std::move(drive), settings, [](const MeterPoint&) {});
  TRY(meter_run(meter, run, settings.gap_bridge_s));
  return meter.accounts();
}

}  // namespace joulecast::energy
