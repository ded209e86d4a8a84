#include "gap/posterior/functions.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "gap/posterior/constants.h"
#include "statistics/robust.h"

namespace joulecast::gap::posterior {
namespace {

// Numbers of knots, and percentiles between which those of places lie.
constexpr std::size_t speed_knots = 6, yaw_knots = 5, place_knots = 4;
constexpr double place_from = 0.02, place_to = 0.98;
constexpr std::array decays_s{20.0, 80.0};
constexpr double interval_s = 10;  // of functions of the time since the first mission began
constexpr std::size_t fewest_intervals = 5, most_intervals = 60;
constexpr std::size_t recent = 1;  // of windows::motion_time_constants_s

std::vector<double> knots_at_quantiles(const Eigen::VectorXd& values, std::size_t count) {
  std::vector<double> sorted(values.begin(), values.end()), knots;
  for (std::size_t k = 0; k < count; ++k) {
    const double knot = statistics::quantile(sorted, static_cast<double>(k) / static_cast<double>(count - 1));
    if (knots.empty() || knot > knots.back()) knots.push_back(knot);
  }
  return knots;
}

std::vector<double> knots_between(double low, double high, std::size_t count) {
  std::vector<double> knots;
  for (std::size_t k = 0; k < count; ++k)
    knots.push_back(std::lerp(low, high, static_cast<double>(k) / static_cast<double>(count - 1)));
  return knots;
}

// Values of the variables at every instant.
class Variables {
 public:
  Variables(const Data& data, std::span<const Window> instants) : data_(data), at_(instants) {}

  std::map<std::string, Eigen::MatrixXd> bases() const {
    std::map<std::string, Eigen::MatrixXd> out;
    const double r = data_.robot.kinematics.wheel_radius_m, l = data_.robot.kinematics.half_track_m;
    add(out, "speed",
        column([&](const Window& w) { return std::fabs(r * (w.speed_rad_s[0] + w.speed_rad_s[1]) / 2); }),
        speed_knots);
    add(out, "acceleration", column([&](const Window& w) {
          return r * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]) / 2;
        }),
        speed_knots);
    add(out, "yaw_rate", column([&](const Window& w) {
          return std::fabs(r * (w.speed_rad_s[0] - w.speed_rad_s[1]) / (2 * l));
        }),
        yaw_knots);
    if (data_.missions >= time_missions) {
      const Eigen::VectorXd rest = column([](const Window& w) { return w.recent_rad_s[recent]; });
      out["recent_motion"] = rest / std::max(rest.maxCoeff(), 1e-9);
      out["time"] = times();
    }
    if (known([](const Window& w) { return w.heading_rad; })) {
      Eigen::MatrixXd z(rows(), 4);
      const Eigen::VectorXd h = column([](const Window& w) { return w.heading_rad; });
      z << h.array().cos(), h.array().sin(), (2 * h.array()).cos(), (2 * h.array()).sin();
      out["heading"] = z;
    }
    add_position(out);
    const Eigen::VectorXd load = column([](const Window& w) { return w.payload_kg; });
    if (load.maxCoeff() > load.minCoeff()) {
      Eigen::MatrixXd z(rows(), 2);
      z << load / load.maxCoeff(), (load / load.maxCoeff()).cwiseAbs2();
      out["payload"] = z;
    }
    return out;
  }

  // Decays after a mission's beginning, and a drift.
  Eigen::MatrixXd times() const {
    const Eigen::VectorXd t = column([](const Window& w) { return w.t_s; });
    Eigen::MatrixXd z(rows(), 3);
    z << (-t / decays_s[0]).array().exp(), (-t / decays_s[1]).array().exp(), t.array() / t.maxCoeff() - 0.5;
    return z;
  }

  // Hats over the time of all missions after each other.
  Eigen::MatrixXd intervals() const {
    std::map<std::size_t, double> last;
    for (const Window& w : at_) last[w.mission] = std::max(last[w.mission], w.t_s);
    std::map<std::size_t, double> begin;
    double total = 0;
    for (const auto& [mission, length] : last) begin[mission] = total, total += length;
    const Eigen::VectorXd t = column([&](const Window& w) { return begin[w.mission] + w.t_s; });
    const auto count =
        std::clamp(static_cast<std::size_t>(total / interval_s), fewest_intervals, most_intervals);
    return hats(t, knots_between(0, total, count));
  }

  template <class Get>
  Eigen::VectorXd column(const Get& get) const {
    Eigen::VectorXd v(rows());
    for (std::size_t k = 0; k < at_.size(); ++k) {
      const double x = get(at_[k]);
      v[ix(k)] = std::isfinite(x) ? x : 0.0;
    }
    return v;
  }

 private:
  Eigen::Index rows() const { return ix(at_.size()); }

  template <class Get>
  bool known(const Get& get) const {
    const auto n = std::ranges::count_if(at_, [&](const Window& w) { return std::isfinite(get(w)); });
    return 2 * static_cast<std::size_t>(n) > at_.size();
  }

  static void add(std::map<std::string, Eigen::MatrixXd>& out, const std::string& name,
                  const Eigen::VectorXd& values, std::size_t count) {
    const std::vector<double> knots = knots_at_quantiles(values, count);
    if (knots.size() >= 3) out[name] = hats(values, knots);
  }

  // A coordinate, with the percentiles between which most places lie.
  struct Axis {
    Eigen::VectorXd at;
    double low, high;

    explicit Axis(Eigen::VectorXd values) : at(std::move(values)) {
      const std::vector<double> all(at.begin(), at.end());
      low = statistics::quantile(all, place_from), high = statistics::quantile(all, place_to);
    }
    int cell(std::size_t row) const {
      const double place =
          (at[ix(row)] - low) / std::max(high - low, 1e-9) * static_cast<double>(place_knots);
      return std::clamp(static_cast<int>(place), 0, static_cast<int>(place_knots) - 1);
    }
  };

  // A place passed once is equivalent to a time: most rows must be in cells that were entered again.
  bool revisited(const Axis& x, const Axis& y) const {
    struct Visits {
      std::size_t count = 0, mission = 0;
      double last_s = 0;
      bool again = false;
    };
    std::map<std::pair<int, int>, Visits> cells;
    for (std::size_t k = 0; k < at_.size(); ++k) {
      Visits& v = cells[{x.cell(k), y.cell(k)}];
      v.again =
          v.again || (v.count > 0 && (at_[k].mission != v.mission || at_[k].t_s - v.last_s > revisit_s));
      v.mission = at_[k].mission;
      v.last_s = at_[k].t_s;
      ++v.count;
    }
    std::size_t again = 0;
    for (const auto& [place, v] : cells) again += v.again ? v.count : 0;
    return 2 * again > at_.size();
  }

  void add_position(std::map<std::string, Eigen::MatrixXd>& out) const {
    if (!known([](const Window& w) { return w.x_m + w.y_m; })) return;
    const Axis x(column([](const Window& w) { return w.x_m; }));
    const Axis y(column([](const Window& w) { return w.y_m; }));
    if (!revisited(x, y) || !(x.high > x.low) || !(y.high > y.low)) return;
    const Eigen::MatrixXd in_x = hats(x.at, knots_between(x.low, x.high, place_knots)),
                          in_y = hats(y.at, knots_between(y.low, y.high, place_knots));
    Eigen::MatrixXd z(rows(), in_x.cols() * in_y.cols());
    for (Eigen::Index a = 0; a < in_x.cols(); ++a) {
      for (Eigen::Index b = 0; b < in_y.cols(); ++b)
        z.col(a * in_y.cols() + b) = in_x.col(a).cwiseProduct(in_y.col(b));
    }
    out["position"] = z;
  }

  const Data& data_;
  std::span<const Window> at_;
};

Eigen::MatrixXd row_means(const PowerRows& rows, const Eigen::MatrixXd& z) {
  Eigen::MatrixXd out(ix(rows.size()), z.cols());
  for (std::size_t r = 0; r < rows.size(); ++r)
    out.row(ix(r)) = z.middleRows(ix(rows.first[r]), ix(rows.first[r + 1] - rows.first[r])).colwise().mean();
  return out;
}

// Adds functions of motors and battery, with motor channels.
void add_motor_functions(const Data& d, const Variables& v, std::vector<Function>& out) {
  const robot::Motor& m = d.robot.motor;
  std::array<Eigen::VectorXd, 2> way, amps, turns;
  double per_amp = 0, size = 0;
  for (const std::size_t s : {0u, 1u}) {
    way[s] = v.column([s](const Window& w) {
      return w.resting[s] || w.speed_rad_s[s] == 0 ? 0.0 : std::copysign(1.0, w.speed_rad_s[s]);
    });
    amps[s] = v.column([s](const Window& w) { return w.current_a[s]; });
    turns[s] = v.column([s](const Window& w) { return w.speed_rad_s[s]; });
    per_amp += (m.voltage_constant_v_s_rad * m.gear_ratio * turns[s] + 2 * m.resistance_ohm * amps[s])
                   .cwiseAbs()
                   .mean();
    size += amps[s].cwiseAbs().mean();
  }
  const double torque_unit = d.mean_power_w / std::max(per_amp, 1e-9);
  const double voltage_unit = d.mean_power_w / std::max(size, 1e-9);
  const auto each = [](const Eigen::MatrixXd& z, const std::array<Eigen::VectorXd, 2>& by) {
    return std::array<Eigen::MatrixXd, 2>{by[0].asDiagonal() * z, by[1].asDiagonal() * z};
  };
  const Eigen::MatrixXd intervals = v.intervals();
  out.push_back({Channel::bus, "time", {intervals, {}}, d.mean_power_w, false});
  out.push_back({Channel::torque_right, "time", each(intervals, way), torque_unit, false});
  for (const auto& [name, z] : v.bases()) {
    out.push_back({Channel::bus, name, {z, {}}, d.mean_power_w});
    out.push_back({Channel::torque_right, name, each(z, way), torque_unit});
  }
  const double most_a = std::max({amps[0].cwiseAbs().maxCoeff(), amps[1].cwiseAbs().maxCoeff(), 1e-9});
  const double most_rad_s = std::max({turns[0].cwiseAbs().maxCoeff(), turns[1].cwiseAbs().maxCoeff(), 1e-9});
  const auto bends = [](const std::array<Eigen::VectorXd, 2>& of, double most) {
    std::array<Eigen::MatrixXd, 2> z;
    for (const std::size_t s : {0u, 1u}) {
      const Eigen::ArrayXd u = of[s].array() / most;
      z[s].resize(u.size(), 2);
      z[s] << u * u.abs(), u.cube();
    }
    return z;
  };
  out.push_back({Channel::voltage_right, "speed", bends(turns, most_rad_s), voltage_unit});
  out.push_back({Channel::voltage_right, "current", bends(amps, most_a), voltage_unit});
  out.push_back({Channel::voltage_right, "time", each(v.times() / most_a, amps), voltage_unit});
}

}  // namespace

Eigen::MatrixXd hats(const Eigen::VectorXd& values, const std::vector<double>& knots) {
  Eigen::MatrixXd z = Eigen::MatrixXd::Zero(values.size(), ix(knots.size()));
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    const double x = std::clamp(values[k], knots.front(), knots.back());
    const auto above = std::ranges::upper_bound(knots, x) - knots.begin();
    const Eigen::Index a = std::min<Eigen::Index>(std::max<Eigen::Index>(above, 1), ix(knots.size()) - 1);
    const double part = (x - knots[ux(a - 1)]) / (knots[ux(a)] - knots[ux(a - 1)]);
    z(k, a - 1) = 1 - part;
    z(k, a) = part;
  }
  return z;
}

std::vector<Function> make_functions(const Data& d) {
  std::vector<Function> out;
  for (const Condition& c : d.conditions) {
    const double low = c.value.minCoeff(), high = c.value.maxCoeff();
    const Eigen::ArrayXd u = 2 * (c.value.array() - low) / (high - low) - 1;
    const bool bends = ((u + 1).abs() > 0 && (u - 1).abs() > 0).any();  // more than two levels
    Eigen::MatrixXd z(u.size(), bends ? 2 : 1);
    z.col(0) = u;
    if (bends) z.col(1) = 2 * u.square() - 1;
    out.push_back({Channel::power, c.name, {z, {}}, d.mean_power_w});
  }
  if (!out.empty()) return out;
  if (d.at_readings()) {
    for (const auto& [name, z] : Variables(d, d.rows.instants).bases()) {
      const Eigen::MatrixXd of_rows = row_means(d.rows, z);
      // Without its mean: a constant is an effect.
      out.push_back(
          {Channel::power, name, {of_rows.rowwise() - of_rows.colwise().mean(), {}}, d.mean_power_w});
    }
  } else if (d.motors) {
    add_motor_functions(d, Variables(d, d.halves[1]), out);
  }
  return out;
}

}  // namespace joulecast::gap::posterior
