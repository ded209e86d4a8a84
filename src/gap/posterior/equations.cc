#include "gap/posterior/equations.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/posterior/constants.h"
#include "gap/traits.h"

namespace joulecast::gap::posterior {
namespace {

using dynamics::Dual;
using DualModel = dynamics::BasicDriveModel<Dual>;

// Both sides of a pair are rows of one channel.
struct Group {
  Channel first;
  std::size_t sides;
};
constexpr std::array groups{Group{Channel::voltage_right, 2},   Group{Channel::torque_right, 2},
                            Group{Channel::drive_right, 2},     Group{Channel::bus, 1},
                            Group{Channel::battery_voltage, 1}, Group{Channel::gyro, 1},
                            Group{Channel::travel, 1},          Group{Channel::turn, 1}};

enum class Nuisance : std::size_t {
  resistance_sides,
  viscous_sides,
  current_right,
  current_left,
  voltage_right,
  voltage_left,
  sampling,
  battery_level,
  battery_fall,
  battery_resistance,
  gyro,
  payload_yaw,
  count
};
constexpr auto nuisance_count = static_cast<std::size_t>(Nuisance::count);

// The model differentiated with respect to each effect column's strength.
std::vector<DualModel> derivatives(const Data& d, const Catalogue& c, const Eigen::VectorXd& point) {
  std::vector<dynamics::ActiveEffect> effects = in_force(d, c, point);
  std::vector<DualModel> models;
  std::size_t place = d.in_file.size();
  for (std::size_t k = 0; k < c.columns.size(); ++k) {
    const EffectColumn& column = c.columns[k];
    if (point[ix(k)] != 0 && !column.by) {
      models.emplace_back(d.robot, effects, place++, column.parameter);
      continue;
    }
    effects.push_back(column.effect);
    models.emplace_back(d.robot, effects, effects.size() - 1, column.parameter);
    effects.pop_back();
  }
  return models;
}

class Builder {
 public:
  Builder(const Data& data, const Catalogue& catalogue, const std::vector<Function>& functions,
          const Eigen::VectorXd& point)
      : d_(data),
        c_(catalogue),
        f_(functions),
        models_(derivatives(data, catalogue, point)),
        model_(data.robot, in_force(data, catalogue, point)) {
    e_.point = point;
    e_.factor_prior = d_.factor_prior;
    e_.effects = c_.columns.size();
    for (const Function& function : f_) {
      e_.function_columns.emplace_back();
      for (std::size_t k = 0; k < function.size(); ++k)
        e_.function_columns.back().push_back(e_.effects + e_.functions + k);
      e_.functions += function.size();
    }
    e_.nuisances = nuisance_count + d_.shifts.size();
    e_.columns.resize(e_.effects + e_.functions + e_.nuisances);
  }

  Equations build() {
    measure_power();
    add_windows();
    if (d_.sides.size() > 0) add_sides();
    if (d_.at_readings()) add_power();
    e_.moves = e_.moves.cwiseMax(e_.share);
    for (std::size_t f = 0; f < f_.size(); ++f) weigh_function(f);
    expect_effects();
    expect_nuisances();
    return std::move(e_);
  }

 private:
  Eigen::Index nuisance(Nuisance n) const {
    return ix(e_.effects + e_.functions + static_cast<std::size_t>(n));
  }

  void measure_power() {
    const PowerRows& rows = d_.rows;
    e_.moved.resize(ix(rows.size()), ix(e_.effects));
    e_.moves = Eigen::VectorXd::Zero(ix(e_.effects));
    motor_share_ = Eigen::VectorXd::Zero(ix(e_.effects));
    e_.modelled_w = rows.mean([&](const Window& w, Meter meter) { return metered_by(meter, model_, w); });
    double motors_w = 0;
    if (d_.motors)
      motors_w = std::max(
          rows.mean([&](const Window& w) { return metered_powers(model_, w).motors_w; }).cwiseAbs().mean(),
          0.05 * d_.mean_power_w);
    for (std::size_t k = 0; k < e_.effects; ++k) {
      const auto& by = c_.columns[k].by;
      double size = 0;
      e_.moved.col(ix(k)) = rows.mean([&](const Window& w, Meter meter) {
        const MeteredPower<Dual> p = metered_powers(models_[k], w);
        const double times = by ? by->of(w) : 1.0;
        size += std::fabs(times * slope(p.motors_w));
        return times * slope(read_by(meter, p));
      });
      if (d_.motors)
        motor_share_[ix(k)] = size / (static_cast<double>(std::max<std::size_t>(rows.size(), 1)) * motors_w);
    }
    for (std::size_t k = 0; k < e_.effects; ++k)
      if (point_by(k)) e_.modelled_w += e_.point[ix(k)] * e_.moved.col(ix(k));
    e_.share = d_.power ? Eigen::VectorXd(e_.moved.cwiseAbs().colwise().mean().transpose() / d_.mean_power_w)
                        : share_without_power();
  }

  // Without recorded power: relative to the power that the windows' motion needs.
  Eigen::VectorXd share_without_power() const {
    Eigen::VectorXd share(ix(e_.effects));
    for (std::size_t k = 0; k < e_.effects; ++k) {
      double size = 0;
      for (const Window& w : d_.windows) size += std::fabs(slope(metered_powers(models_[k], w).battery_w));
      share[ix(k)] = size / (static_cast<double>(d_.windows.size()) * d_.mean_power_w);
    }
    return share;
  }

  bool point_by(std::size_t k) const { return c_.columns[k].by && e_.point[ix(k)] != 0; }
  static double slope(const Dual& v) { return std::isfinite(v.slope) ? v.slope : 0.0; }

  // A constant voltage was not measured: it would follow any current.
  bool voltage_moves() const {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double v : d_.battery_voltage_v) {
      if (!std::isfinite(v)) continue;
      low = std::min(low, v);
      high = std::max(high, v);
    }
    return high - low > 1e-6 * std::fabs(high);
  }

  // Whether a channel is one of this witness.
  bool belongs(Channel c) const {
    const bool turning = c == Channel::gyro || c == Channel::turn;
    if (d_.witness == Witness::terminals) return c == Channel::battery_voltage;
    if (d_.witness == Witness::kinematics) return turning || c == Channel::travel;
    return d_.motors || !turning;
  }

  double reading(Channel channel, std::size_t s, std::size_t k) const {
    const Window& w = d_.windows[k];
    switch (channel) {
      case Channel::torque_right:
        return w.current_a[s];
      case Channel::bus:
        return w.battery_power_w;
      case Channel::battery_voltage:
        return d_.battery_voltage_v[k];
      case Channel::gyro:
        return w.yaw_rate_rad_s;
      case Channel::travel:
        return w.forward_m;
      case Channel::turn:
        return w.turn_rad;
      default:
        return w.voltage_v[s];
    }
  }

  void compare_sizes(const Eigen::MatrixXd& x, double spread) {
    const Eigen::VectorXd size = x.leftCols(ix(e_.effects)).cwiseAbs().colwise().mean().transpose();
    e_.moves = e_.moves.cwiseMax(size / spread);
  }

  static double mean_deviation(const std::vector<double>& values) {
    if (values.empty()) return 0;
    const Eigen::Map<const Eigen::ArrayXd> v(values.data(), ix(values.size()));
    return (v - v.mean()).abs().mean();
  }

  void add_windows() {
    const std::size_t n = d_.windows.size();
    std::vector<ChannelValues<double>> values(n);
    for (std::size_t k = 0; k < n; ++k) {
      values[k] = residuals(model_, d_.halves[0][k], d_.voltages);
      // The expected reading contains the mean voltage; the response contains the measured one.
      values[k][index_of(Channel::battery_voltage)] +=
          d_.battery_voltage_v[k] - d_.windows[k].battery_voltage_v;
    }
    struct Made {
      ChannelRows rows;
      Eigen::MatrixXd x;
      double spread = 0;
      std::vector<std::vector<Eigen::Index>> row;  // by side and window; -1: none
    };
    std::vector<Made> all;
    for (const Group& g : groups) {
      Made& made = all.emplace_back();
      made.rows.channel = g.first;
      made.row.assign(g.sides, std::vector<Eigen::Index>(n, -1));
      const bool used = belongs(g.first) && (g.first != Channel::battery_voltage || voltage_moves());
      std::vector<double> y, readings;
      for (std::size_t s = 0; used && s < g.sides; ++s) {
        for (std::size_t k = 0; k < n; ++k) {
          const double value = values[k][index_of(g.first) + s];
          if (!std::isfinite(value)) continue;
          made.row[s][k] = ix(y.size());
          y.push_back(value);
          readings.push_back(reading(g.first, s, k));
          made.rows.add(d_.windows[k]);
        }
      }
      made.rows.y = Eigen::Map<const Eigen::VectorXd>(y.data(), ix(y.size()));
      made.spread = mean_deviation(readings);
      made.x = Eigen::MatrixXd::Zero(ix(y.size()), ix(e_.size()));
    }
    for (std::size_t j = 0; j < e_.effects; ++j) {
      for (std::size_t k = 0; k < n; ++k) {
        const ChannelValues<Dual> r = residuals(models_[j], d_.halves[1][k], d_.voltages);
        const double times = c_.columns[j].by ? c_.columns[j].by->of(d_.windows[k]) : 1.0;
        for (Made& made : all) {
          for (std::size_t s = 0; s < made.row.size(); ++s) {
            if (const Eigen::Index at = made.row[s][k]; at >= 0)
              made.x(at, ix(j)) = -times * slope(r[index_of(made.rows.channel) + s]);
          }
        }
      }
    }
    for (Made& made : all) {
      if (made.spread > 0) compare_sizes(made.x, made.spread);
      for (std::size_t s = 0; s < made.row.size(); ++s) {
        for (std::size_t k = 0; k < n; ++k) {
          const Eigen::Index at = made.row[s][k];
          if (at < 0) continue;
          for (std::size_t f = 0; f < f_.size(); ++f) {
            if (f_[f].channel == made.rows.channel)
              made.x.row(at).segment(ix(e_.function_columns[f][0]), ix(f_[f].size())) =
                  f_[f].basis[s].row(ix(k));
          }
          add_nuisances(made.rows.channel, s, d_.halves[1][k], made.x, at);
        }
      }
      keep(std::move(made.rows), made.x);
    }
  }

  void add_nuisances(Channel channel, std::size_t s, const Window& w, Eigen::MatrixXd& x,
                     Eigen::Index at) const {
    const robot::Motor& m = d_.robot.motor;
    const double kt = m.torque_constant_nm_a * m.gear_ratio, half = s == 0 ? 0.5 : -0.5;
    const auto own = [&](Nuisance right) -> double& { return x(at, nuisance(right) + ix(s)); };
    // Differences of the wheels' torques, by the reading that a torque moves.
    const auto torques = [&](double per_nm) {
      const double arm = d_.robot.kinematics.wheel_radius_m / d_.robot.kinematics.half_track_m;
      x(at, nuisance(Nuisance::viscous_sides)) =
          half * per_nm * m.viscous_friction_nm_s_rad * w.speed_rad_s[s];
      x(at, nuisance(Nuisance::payload_yaw)) = half * per_nm * 0.5 * arm * arm * w.payload_kg *
                                               (w.acceleration_rad_s2[0] - w.acceleration_rad_s2[1]);
    };
    switch (channel) {
      case Channel::voltage_right:
        x(at, nuisance(Nuisance::resistance_sides)) = half * m.resistance_ohm * w.current_a[s];
        own(Nuisance::voltage_right) = 1;
        own(Nuisance::current_right) = -m.resistance_ohm;
        break;
      case Channel::torque_right:
        torques(1 / kt);
        own(Nuisance::current_right) = 1;
        // A current is read once a row while the controller keeps its voltage constant: the reading differs
        // from the mean accordingly.
        x(at, nuisance(Nuisance::sampling)) =
            m.voltage_constant_v_s_rad * m.gear_ratio / m.resistance_ohm * w.acceleration_rad_s2[s];
        break;
      case Channel::drive_right:
        torques(m.resistance_ohm / kt);
        own(Nuisance::voltage_right) = 1;
        break;
      case Channel::bus:
        x(at, nuisance(Nuisance::current_right)) = std::isfinite(w.voltage_v[0]) ? -w.voltage_v[0] : 0;
        x(at, nuisance(Nuisance::current_left)) = std::isfinite(w.voltage_v[1]) ? -w.voltage_v[1] : 0;
        break;
      case Channel::battery_voltage:
        x(at, nuisance(Nuisance::battery_level)) = 1;
        x(at, nuisance(Nuisance::battery_fall)) = -w.charge_as;
        x(at, nuisance(Nuisance::battery_resistance)) =
            -d_.robot.battery.internal_resistance_ohm * w.battery_current_a;
        break;
      case Channel::gyro:
        x(at, nuisance(Nuisance::gyro)) = 1;
        break;
      default:
        break;
    }
  }

  void add_sides() {
    const PowerRows& p = d_.sides;
    ChannelRows rows = channel_rows(p);
    rows.y =
        p.measured_w() - p.mean([&](const Window& w, Meter meter) { return metered_by(meter, model_, w); });
    Eigen::MatrixXd x = Eigen::MatrixXd::Zero(ix(p.size()), ix(e_.size()));
    for (std::size_t k = 0; k < e_.effects; ++k) {
      const auto& by = c_.columns[k].by;
      x.col(ix(k)) = p.mean([&](const Window& w, Meter meter) {
        return (by ? by->of(w) : 1.0) * slope(metered_by(meter, models_[k], w));
      });
    }
    compare_sizes(x, d_.mean_power_w);
    keep(std::move(rows), x);
  }

  void add_power() {
    const PowerRows& p = d_.rows;
    ChannelRows rows = channel_rows(p);
    rows.y = p.measured_w() - e_.modelled_w;
    for (std::size_t k = 0; k < e_.effects; ++k) {
      if (point_by(k))
        rows.y += e_.point[ix(k)] * e_.moved.col(ix(k));  // keep() adds the part that the point explains
    }
    Eigen::MatrixXd x = Eigen::MatrixXd::Zero(ix(p.size()), ix(e_.size()));
    x.leftCols(ix(e_.effects)) = e_.moved;
    for (std::size_t f = 0; f < f_.size(); ++f) {
      if (f_[f].channel == Channel::power)
        x.middleCols(ix(e_.function_columns[f][0]), ix(f_[f].size())) = f_[f].basis[0];
    }
    for (std::size_t k = 0; k < d_.shifts.size(); ++k) x.col(x.cols() - 1 - ix(k)) = d_.shifts[k];
    keep(std::move(rows), x);
  }

  // Keeps a channel with enough rows, and its columns that are not zero.
  void keep(ChannelRows rows, const Eigen::MatrixXd& x) {
    if (ux(rows.y.size()) < d_.fewest || (rows.y.array() - rows.y.mean()).matrix().norm() == 0) return;
    for (std::size_t k = 0; k < e_.effects; ++k)
      if (!c_.columns[k].by) rows.y += e_.point[ix(k)] * x.col(ix(k));
    for (Eigen::Index k = 0; k < x.cols(); ++k)
      if (x.col(k).cwiseAbs().maxCoeff() > 0) rows.columns.push_back(k);
    rows.x = x(Eigen::all, rows.columns);
    e_.channels.push_back(std::move(rows));
  }

  void weigh_function(std::size_t f) {
    const Function& function = f_[f];
    Eigen::MatrixXd zz = Eigen::MatrixXd::Zero(ix(function.size()), ix(function.size()));
    double sides = 0;
    for (const Eigen::MatrixXd& z : function.basis) {
      if (z.size() == 0) continue;
      zz += z.transpose() * z / static_cast<double>(z.rows());
      sides += 1;
    }
    e_.function_power.push_back(zz / sides / (function.unit * function.unit));
    for (const std::size_t k : e_.function_columns[f]) {
      e_.columns[k].tolerance = function_tolerance * function.unit;
      e_.columns[k].unit = function.unit;
    }
  }

  void expect_effects() {
    for (std::size_t k = 0; k < e_.effects; ++k) {
      Column& column = e_.columns[k];
      const EffectColumn& of = c_.columns[k];
      const std::string_view id = of.by ? std::string_view{} : of.effect.effect->info().id;
      const Traits& traits = traits_of(id.empty() ? "accessory_load" : id);
      const bool own_unit = of.parameter == 0 && !of.by;
      column.usual = !own_unit ? 0 : id == "inductance" ? usual_inductance_h : traits.usual;
      column.of_file = column.usual > 0;
      const double share = std::max(e_.share[ix(k)], motor_share_[ix(k)]);
      column.unit = share > 1e-9 ? 1 / share : column.usual > 0 ? column.usual : 1;
      column.tolerance = effect_tolerance * column.unit;
      if (column.usual > 0) {
        column.tolerance =
            share > 1e-9 ? std::min(traits.tolerance, most_tolerance * column.unit) : traits.tolerance;
        column.scatter = traits.scatter;
      }
      if (id == "viscous_friction" && own_unit)
        column.tolerance = std::max(column.tolerance, least_viscous * column.unit);
      if (id == "accessory_load") {
        column.tolerance =
            std::hypot(idle_tolerance * d_.robot.idle_power_w, load_tolerance * d_.mean_power_w);
        column.scatter = idle_scatter * d_.robot.idle_power_w;
      }
      if (id == "inductance") column.tolerance = inductance_tolerance_h;
      if (id == "sensor_delay")
        column.tolerance = std::hypot(column.tolerance, d_.sample_s / std::sqrt(12.0));
    }
  }

  void expect_nuisances() {
    const auto column = [&](Nuisance n) -> Column& {
      Column& c = e_.columns[ux(nuisance(n))];
      c.unit = 0;
      return c;
    };
    column(Nuisance::resistance_sides).tolerance = resistance_sides;
    column(Nuisance::viscous_sides).tolerance = viscous_sides;
    for (const Nuisance n : {Nuisance::current_right, Nuisance::current_left})
      column(n).tolerance = current_zero * d_.robot.limits.current_a;
    for (const Nuisance n : {Nuisance::voltage_right, Nuisance::voltage_left})
      column(n).tolerance = voltage_zero * d_.robot.battery.nominal_voltage_v;
    column(Nuisance::sampling).tolerance = d_.sample_s / std::sqrt(12.0);
    column(Nuisance::battery_level).scatter = battery_level * d_.robot.battery.nominal_voltage_v;
    column(Nuisance::battery_fall).scatter =
        battery_fall * d_.robot.battery.nominal_voltage_v / (3600 * d_.robot.battery.capacity_ah);
    // Where it is no effect of the catalogue, the battery has any resistance that a robot's file may miss.
    const bool effect = std::ranges::any_of(
        c_.hypotheses, [](const Hypothesis& h) { return h.id() == "battery_resistance"; });
    if (!effect) {
      column(Nuisance::battery_resistance).tolerance = traits_of("battery_resistance").tolerance;
      column(Nuisance::battery_resistance).of_file = true;
    }
    column(Nuisance::gyro).scatter = gyro_zero_rad_s;
    column(Nuisance::payload_yaw).tolerance = payload_yaw_m2;
    for (std::size_t k = 0; k < d_.shifts.size(); ++k) {
      Column& c = e_.columns[e_.size() - 1 - k];
      c.unit = 0;
      c.tolerance = table_shift;
    }
  }

  const Data& d_;
  const Catalogue& c_;
  const std::vector<Function>& f_;
  std::vector<DualModel> models_;
  dynamics::DriveModel model_;
  Eigen::VectorXd motor_share_;
  Equations e_;
};

}  // namespace

void ChannelRows::add(const Window& w) {
  block.push_back(w.block);
  mission.push_back(w.mission);
  resting.push_back(w.resting[0] && w.resting[1]);
}

ChannelRows channel_rows(const PowerRows& power) {
  ChannelRows rows;
  for (std::size_t r = 0; r < power.size(); ++r) rows.add(power.window(r));
  return rows;
}

Equations linearise(const Data& data, const Catalogue& catalogue, const std::vector<Function>& functions,
                    const Eigen::VectorXd& point) {
  return Builder(data, catalogue, functions, point).build();
}

Eigen::VectorXd power_at(const Data& data, const Catalogue& catalogue, const Equations& equations,
                         const Eigen::VectorXd& strengths) {
  Eigen::VectorXd power = predicted_power(data, in_force(data, catalogue, strengths));
  for (std::size_t k = 0; k < catalogue.columns.size(); ++k) {
    if (catalogue.columns[k].by && strengths[ix(k)] != 0)
      power += strengths[ix(k)] * equations.moved.col(ix(k));
  }
  return power;
}

}  // namespace joulecast::gap::posterior
