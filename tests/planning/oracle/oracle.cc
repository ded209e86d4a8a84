#include "tests/planning/oracle/oracle.h"

#include <IpIpoptApplication.hpp>
#include <IpTNLP.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tests/planning/oracle/jet.h"

namespace joulecast::oracle {
namespace {

constexpr double unlimited = 1e19;  // IPOPT's infinity
constexpr double soft_nm =
    2e-2;  // torque below which a gear's loss is smoothed; with 1e-3 it rarely converges

// Gauss-Legendre's three points of [0, 1] and their weights.
constexpr double gauss_at[] = {0.11270166537925831, 0.5, 0.8872983346207417};
constexpr double gauss_weight[] = {5.0 / 18, 8.0 / 18, 5.0 / 18};

struct Bend {
  double curvature = 0, slope = 0;  // by the way
};

Bend bend_at(const Way& way, double s) {
  if (way.turns_in_place || way.at.empty()) return {};
  if (s <= way.at.front()) return {way.curvature_1_m.front(), 0};
  for (std::size_t k = 1; k < way.at.size(); ++k) {
    if (s > way.at[k]) continue;
    const double slope = (way.curvature_1_m[k] - way.curvature_1_m[k - 1]) / (way.at[k] - way.at[k - 1]);
    return {way.curvature_1_m[k - 1] + slope * (s - way.at[k - 1]), slope};
  }
  return {way.curvature_1_m.back(), 0};
}

// The motors at an instant; T is double or Jet.
template <class T>
struct Motors {
  T current[2], voltage[2], power[2];
};

// Thesis chapter 2 (right wheel first): F = m dv - m_c d yaw^2, N = I dyaw + m_c d v yaw, load torque
// r F/2 +- r N/(2 l) + I_w dw, motor K_t n i = I_s dw + nu w + T_m sgn(w) + load, V = R i + K_w n w.
// The gear loses a share of the torque that it passes on.
template <class T>
Motors<T> motors(const Question& q, const Bend& bend, const T& u, const T& du, double smoothed_nm) {
  const auto& [kin, mass, motor] = std::tie(q.robot.kinematics, q.robot.mass, q.robot.motor);
  const double r = kin.wheel_radius_m, l = kin.half_track_m;
  const double m = mass.chassis_kg + 2 * mass.wheel_kg + q.payload_kg;
  const double inertia = mass.yaw_inertia_kg_m2 + 0.02 * q.payload_kg;
  const double offset = mass.chassis_kg * kin.com_offset_m;
  const bool in_place = q.way.turns_in_place;
  const T v = in_place ? T(0) : u, dv = in_place ? T(0) : du;
  const T yaw = in_place ? u : T(bend.curvature) * u;
  const T dyaw = in_place ? du : T(bend.curvature) * du + T(bend.slope) * u * u;
  const T force = T(m) * dv - T(offset) * yaw * yaw;
  T moment = T(inertia) * dyaw + T(offset) * v * yaw;
  if (q.scrub > 0) {
    using std::tanh;
    moment = moment + T(q.scrub * m * 9.80665 * l / 2) * tanh(T(1 / q.scrub_rate_rad_s) * yaw);
  }
  Motors<T> out;
  for (int side : {0, 1}) {
    const double sign = side == 0 ? 1 : -1;
    const T w = T(1 / r) * (v + T(sign * l) * yaw), dw = T(1 / r) * (dv + T(sign * l) * dyaw);
    // The direction of a wheel does not change along the way: by the coordinate, not by a speed near zero.
    const double turning = in_place ? sign : 1 + sign * l * bend.curvature;
    const double direction = turning > 0 ? 1.0 : turning < 0 ? -1.0 : 0.0;
    const T friction = T(motor.viscous_friction_nm_s_rad) * w +
                       T(direction * motor.friction_torque_nm[static_cast<std::size_t>(side)]);
    const T passed = T(0.5 * r) * force + T(sign * 0.5 * r / l) * moment +
                     T(mass.wheel_inertia_kg_m2 + motor.rotor_inertia_kg_m2) * dw;
    T torque = passed + friction;
    if (q.gear_loss > 0)
      torque = torque +
               T(direction * q.gear_loss) * soft_abs(passed + T(q.gear_of_friction) * friction, smoothed_nm);
    const double constant = motor.torque_constant_nm_a * motor.gear_ratio;
    out.current[side] = T(1 / constant) * torque;
    out.voltage[side] = T(motor.resistance_ohm) * out.current[side] +
                        T(motor.voltage_constant_v_s_rad * motor.gear_ratio) * w;
    out.power[side] = out.voltage[side] * out.current[side];
  }
  return out;
}

// The variables of a cell from speed u0 to u1 for IPOPT.
template <class T>
struct CellValues {
  T duration;
  T energy;                // without idle power; of the motors where braking is returned whole
  std::vector<T> braking;  // motors' energy by Gauss point and side, where it is not
  std::vector<T> bounded;  // see Transcription::bounds
};

class Transcription final : public Ipopt::TNLP {
 public:
  Transcription(const Question& question, std::vector<double> nodes, std::vector<double> guess)
      : q_(question), nodes_(std::move(nodes)), guess_(std::move(guess)), cells_(nodes_.size() - 1) {
    lossy_ = !q_.fastest && up() != down();
    const bool amperes = std::isfinite(q_.current_a), volts = std::isfinite(q_.voltage_v);
    const auto bound = [&](double most) { bounds_.push_back(most); };
    most_ = q_.way.turns_in_place ? q_.acceleration_m_s2 / q_.robot.kinematics.half_track_m
                                  : q_.acceleration_m_s2;
    if (std::isfinite(most_)) bound(most_);
    for (int place = q_.strict ? 0 : 1; place < (q_.strict ? 3 : 2); ++place) {
      for (int side = 0; side < 2; ++side) {
        if (amperes) bound(q_.current_a);
        if (volts) bound(q_.voltage_v);
      }
    }
    per_cell_ = bounds_.size() + (lossy_ ? 12 : 0);
    speeds_ = cells_ - 1;
  }

  template <class T>
  CellValues<T> cell(std::size_t k, const T& u0, const T& u1) const {
    const double h = nodes_[k + 1] - nodes_[k];
    CellValues<T> c;
    c.duration = T(2 * h) * inverse(u0 + u1);
    const T a = T(0.5 / h) * (u1 * u1 - u0 * u0);
    c.energy = T(0);
    if (!q_.fastest) {
      for (int g = 0; g < 3; ++g) {
        const double f = gauss_at[g];
        const T u = u0 + T(f) * (u1 - u0);
        // Where the robot then is, by the speeds of the last iterate: curvature changes little within a cell.
        const double mean = value_of(u0) + value_of(u1);
        const double share = mean > 0 ? f * (2 * value_of(u0) + f * (value_of(u1) - value_of(u0))) / mean : f;
        const auto at = motors(q_, bend_at(q_.way, nodes_[k] + h * share), u, a, soft_nm);
        for (int side : {0, 1}) {
          const T e = T(gauss_weight[g]) * at.power[side] * c.duration;
          if (lossy_)
            c.braking.push_back(e);
          else
            c.energy = c.energy + e;
        }
      }
    }
    if (std::isfinite(most_)) c.bounded.push_back(a);
    for (int place = q_.strict ? 0 : 1; place < (q_.strict ? 3 : 2); ++place) {
      const T u = place == 0 ? u0 : place == 1 ? T(0.5) * (u0 + u1) : u1;
      // Just inside the cell: the curvature's slope may jump at its ends.
      const double s = nodes_[k] + h * (place == 0 ? 1e-9 : place == 1 ? 0.5 : 1 - 1e-9);
      const auto at = motors(q_, bend_at(q_.way, s), u, a, soft_nm);
      for (int side : {0, 1}) {
        if (std::isfinite(q_.current_a)) c.bounded.push_back(at.current[side]);
        if (std::isfinite(q_.voltage_v)) c.bounded.push_back(at.voltage[side]);
      }
    }
    return c;
  }

  bool get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian, Ipopt::Index& hessian,
                    IndexStyleEnum& style) override {
    n = static_cast<Ipopt::Index>(speeds_ + (lossy_ ? 6 * cells_ : 0));
    m = static_cast<Ipopt::Index>(per_cell_ * cells_ + (q_.deadline_s ? 1 : 0));
    jacobian = 0;
    each_jacobian([&](auto...) { ++jacobian; });
    hessian = static_cast<Ipopt::Index>(2 * speeds_ - 1);
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Ipopt::Index n, Ipopt::Number* low, Ipopt::Number* high, Ipopt::Index m,
                       Ipopt::Number* least, Ipopt::Number* most) override {
    for (Ipopt::Index i = 0; i < n; ++i) low[i] = -unlimited, high[i] = unlimited;
    for (std::size_t k = 1; k < cells_; ++k) {
      low[k - 1] = 1e-7 * std::min(10.0, ceiling(k)), high[k - 1] = ceiling(k);
    }
    for (std::size_t k = 0; k < cells_; ++k) {
      std::size_t row = k * per_cell_;
      for (const double bound : bounds_) least[row] = -bound, most[row] = bound, ++row;
      for (; row < (k + 1) * per_cell_; ++row) least[row] = 0, most[row] = unlimited;
    }
    if (q_.deadline_s) least[m - 1] = -unlimited, most[m - 1] = *q_.deadline_s;
    return true;
  }

  bool get_starting_point(Ipopt::Index, bool, Ipopt::Number* x, bool, Ipopt::Number*, Ipopt::Number*,
                          Ipopt::Index, bool, Ipopt::Number*) override {
    for (std::size_t k = 1; k < cells_; ++k) x[k - 1] = std::min(guess_[k], 0.99 * ceiling(k));
    if (!lossy_) return true;
    for (std::size_t k = 0; k < cells_; ++k) {
      const auto c = cell<double>(k, speed(x, k), speed(x, k + 1));
      for (std::size_t i = 0; i < 6; ++i)
        x[paid(k, i)] = std::max(up() * c.braking[i], down() * c.braking[i]) + 1e-3;
    }
    return true;
  }

  bool eval_f(Ipopt::Index, const Ipopt::Number* x, bool, Ipopt::Number& f) override {
    f = 0;
    for (std::size_t k = 0; k < cells_; ++k) {
      const auto c = cell<double>(k, speed(x, k), speed(x, k + 1));
      f += rate() * c.duration + c.energy;
      for (std::size_t i = 0; i < c.braking.size(); ++i) f += x[paid(k, i)];
    }
    f *= scale();
    return std::isfinite(f);
  }

  bool eval_grad_f(Ipopt::Index n, const Ipopt::Number* x, bool, Ipopt::Number* g) override {
    std::fill(g, g + n, 0.0);
    for (std::size_t k = 0; k < cells_; ++k) {
      const auto c = jets(x, k);
      const Jet f = Jet(rate()) * c.duration + c.energy;
      if (k > 0) g[k - 1] += scale() * f.g0;
      if (k + 1 < cells_) g[k] += scale() * f.g1;
      for (std::size_t i = 0; i < c.braking.size(); ++i) g[paid(k, i)] = scale();
    }
    return true;
  }

  bool eval_g(Ipopt::Index, const Ipopt::Number* x, bool, Ipopt::Index m, Ipopt::Number* g) override {
    double duration = 0;
    for (std::size_t k = 0; k < cells_; ++k) {
      const auto c = cell<double>(k, speed(x, k), speed(x, k + 1));
      std::size_t row = k * per_cell_;
      for (const double value : c.bounded) g[row++] = value;
      for (std::size_t i = 0; i < c.braking.size(); ++i) {
        g[row++] = x[paid(k, i)] - up() * c.braking[i];
        g[row++] = x[paid(k, i)] - down() * c.braking[i];
      }
      duration += c.duration;
    }
    if (q_.deadline_s) g[m - 1] = duration;
    return true;
  }

  bool eval_jac_g(Ipopt::Index, const Ipopt::Number* x, bool, Ipopt::Index, Ipopt::Index, Ipopt::Index* rows,
                  Ipopt::Index* columns, Ipopt::Number* values) override {
    std::size_t at = 0;
    if (values == nullptr) {
      each_jacobian([&](std::size_t row, std::size_t column) {
        rows[at] = static_cast<Ipopt::Index>(row), columns[at++] = static_cast<Ipopt::Index>(column);
      });
      return true;
    }
    std::vector<double> by_speed(speeds_, 0);
    const auto add = [&](std::size_t k, const Jet& j) {
      if (k > 0) values[at++] = j.g0;
      if (k + 1 < cells_) values[at++] = j.g1;
    };
    for (std::size_t k = 0; k < cells_; ++k) {
      const auto c = jets(x, k);
      for (const Jet& j : c.bounded) add(k, j);
      for (const Jet& j : c.braking) {
        for (const double share : {up(), down()}) {
          add(k, Jet(-share) * j);
          values[at++] = 1;
        }
      }
      if (k > 0) by_speed[k - 1] += c.duration.g0;
      if (k + 1 < cells_) by_speed[k] += c.duration.g1;
    }
    if (q_.deadline_s)
      for (const double slope : by_speed) values[at++] = slope;
    return true;
  }

  bool eval_h(Ipopt::Index, const Ipopt::Number* x, bool, Ipopt::Number weight, Ipopt::Index m,
              const Ipopt::Number* lambda, bool, Ipopt::Index, Ipopt::Index* rows, Ipopt::Index* columns,
              Ipopt::Number* values) override {
    if (values == nullptr) {
      for (std::size_t i = 0; i < speeds_; ++i) {
        const auto at = static_cast<Ipopt::Index>(i);
        rows[i] = columns[i] = at;
        if (i > 0) rows[speeds_ + i - 1] = at, columns[speeds_ + i - 1] = at - 1;
      }
      return true;
    }
    std::fill(values, values + 2 * speeds_ - 1, 0.0);
    for (std::size_t k = 0; k < cells_; ++k) {
      const auto c = jets(x, k);
      Jet sum = Jet(weight * scale()) * (Jet(rate()) * c.duration + c.energy);
      if (q_.deadline_s) sum = sum + Jet(lambda[m - 1]) * c.duration;
      std::size_t row = k * per_cell_;
      for (const Jet& j : c.bounded) sum = sum + Jet(lambda[row++]) * j;
      for (const Jet& j : c.braking) {
        sum = sum + Jet(-up() * lambda[row] - down() * lambda[row + 1]) * j;
        row += 2;
      }
      if (k > 0) values[k - 1] += sum.h00;
      if (k + 1 < cells_) values[k] += sum.h11;
      if (k > 0 && k + 1 < cells_) values[speeds_ + k - 1] += sum.h01;
    }
    return true;
  }

  void finalize_solution(Ipopt::SolverReturn, Ipopt::Index, const Ipopt::Number* x, const Ipopt::Number*,
                         const Ipopt::Number*, Ipopt::Index, const Ipopt::Number*, const Ipopt::Number*,
                         Ipopt::Number, const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) override {
    found.way = nodes_;
    found.speed.clear();
    found.duration_s = found.energy_j = 0;
    for (std::size_t k = 0; k <= cells_; ++k) found.speed.push_back(speed(x, k));
    for (std::size_t k = 0; k < cells_; ++k) price(k);
    found.cost_j = found.energy_j + q_.value_of_time_w * found.duration_s;
  }

  Found found;

 private:
  double rate() const { return q_.fastest ? 1 : q_.robot.idle_power_w + q_.value_of_time_w; }
  // Battery power over that of a motor that drives, and of one that brakes.
  double up() const { return 1 + q_.driver_loss; }
  double down() const { return q_.regeneration - q_.driver_loss; }
  double scale() const { return q_.fastest ? 1 : 1e-2; }
  std::size_t paid(std::size_t k, std::size_t i) const { return speeds_ + 6 * k + i; }

  double speed(const Ipopt::Number* x, std::size_t k) const {
    return k == 0 ? q_.start_speed : k == cells_ ? q_.end_speed : x[k - 1];
  }

  CellValues<Jet> jets(const Ipopt::Number* x, std::size_t k) const {
    return cell<Jet>(k, k == 0 ? Jet(q_.start_speed) : Jet::first(x[k - 1]),
                     k + 1 == cells_ ? Jet(q_.end_speed) : Jet::second(x[k]));
  }

  double ceiling(std::size_t k) const {
    if (q_.way.turns_in_place) return std::min(q_.yaw_rate_rad_s, 1e3);
    const double bend = std::fabs(bend_at(q_.way, nodes_[k]).curvature);
    return std::min({q_.speed_m_s, bend > 0 ? q_.yaw_rate_rad_s / bend : 1e3, 1e3});
  }

  template <class Visit>
  void each_jacobian(Visit&& visit) const {
    for (std::size_t k = 0; k < cells_; ++k) {
      for (std::size_t i = 0; i < per_cell_; ++i) {
        if (k > 0) visit(k * per_cell_ + i, k - 1);
        if (k + 1 < cells_) visit(k * per_cell_ + i, k);
        if (i >= bounds_.size()) visit(k * per_cell_ + i, paid(k, (i - bounds_.size()) / 2));
      }
    }
    if (q_.deadline_s)
      for (std::size_t i = 0; i < speeds_; ++i) visit(per_cell_ * cells_, i);
  }

  // The cell's energy as it is driven, in many steps.
  void price(std::size_t k) {
    const double u0 = found.speed[k], u1 = found.speed[k + 1], h = nodes_[k + 1] - nodes_[k];
    const double duration = 2 * h / (u0 + u1), a = (u1 - u0) / duration;
    constexpr int steps = 8;
    for (int i = 0; i < steps; ++i) {
      for (int g = 0; g < 3; ++g) {
        const double t = (i + gauss_at[g]) / steps * duration;
        const Drive d = drive_at(q_, nodes_[k] + (u0 + 0.5 * a * t) * t, u0 + a * t, a);
        found.energy_j += gauss_weight[g] * duration / steps * d.battery_w;
      }
    }
    found.duration_s += duration;
  }

  const Question& q_;
  std::vector<double> nodes_, guess_;
  std::size_t cells_, speeds_ = 0, per_cell_ = 0;
  std::vector<double> bounds_;
  double most_ = 0;
  bool lossy_ = false;
};

// Nodes even in time near both ends, with the corners of the curvature among them.
std::vector<double> first_nodes(const Question& q) {
  std::vector<double> nodes;
  for (int k = 0; k <= q.cells; ++k) {
    const double x = static_cast<double>(k) / q.cells;
    nodes.push_back(q.way.length * x * x * (3 - 2 * x));
  }
  return nodes;
}

// Nodes that share the time, the changes of speed and of acceleration of a solution.
std::vector<double> better_nodes(const Question& q, const Found& coarse) {
  const std::size_t n = coarse.way.size() - 1;
  std::vector<double> weight(n), jump(n);
  double speeds = 1e-300, jumps = 1e-300;
  const auto acceleration = [&](std::size_t k) {
    return (coarse.speed[k + 1] * coarse.speed[k + 1] - coarse.speed[k] * coarse.speed[k]) /
           (2 * (coarse.way[k + 1] - coarse.way[k]));
  };
  for (std::size_t k = 0; k < n; ++k) {
    speeds += std::fabs(coarse.speed[k + 1] - coarse.speed[k]);
    jump[k] = std::fabs(acceleration(std::min(k + 1, n - 1)) - acceleration(k > 0 ? k - 1 : 0));
    jumps += jump[k];
  }
  double sum = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double duration = 2 * (coarse.way[k + 1] - coarse.way[k]) / (coarse.speed[k] + coarse.speed[k + 1]);
    weight[k] = 0.4 * duration / coarse.duration_s +
                0.4 * std::fabs(coarse.speed[k + 1] - coarse.speed[k]) / speeds + 0.2 * jump[k] / jumps;
    sum += weight[k];
  }
  std::vector<double> nodes{0};
  double reached = 0;
  std::size_t k = 0;
  for (int i = 1; i < q.cells; ++i) {
    const double wanted = sum * i / q.cells;
    while (k + 1 < n && reached + weight[k] < wanted) reached += weight[k++];
    const double f = std::min(1.0, (wanted - reached) / weight[k]);
    // Evenly in time within the old cell.
    const double u0 = coarse.speed[k], u1 = coarse.speed[k + 1];
    const double share = f * (2 * u0 + f * (u1 - u0)) / (u0 + u1);
    const double at = coarse.way[k] + share * (coarse.way[k + 1] - coarse.way[k]);
    if (at > nodes.back() + 1e-9 * q.way.length && at < (1 - 1e-9) * q.way.length) nodes.push_back(at);
  }
  nodes.push_back(q.way.length);
  return nodes;
}

std::vector<double> with_corners(const Question& q, std::vector<double> nodes) {
  for (const double corner : q.way.at) {
    if (!(corner > 0 && corner < q.way.length)) continue;
    const auto near = std::min_element(nodes.begin() + 1, nodes.end() - 1, [&](double a, double b) {
      return std::fabs(a - corner) < std::fabs(b - corner);
    });
    const double gap = std::min(*near - *(near - 1), *(near + 1) - *near);
    if (std::fabs(*near - corner) < 0.4 * gap)
      *near = corner;
    else
      nodes.insert(std::upper_bound(nodes.begin(), nodes.end(), corner), corner);
  }
  return nodes;
}

Found solve(const Question& q, std::vector<double> nodes, const Found* before) {
  std::vector<double> guess;
  const double gentle = q.gentle * std::min(1.0, q.acceleration_m_s2);
  for (const double s : nodes) {
    double u = std::min({0.5, 0.5 * q.speed_m_s, 0.5 * q.yaw_rate_rad_s});
    u = std::min(u, std::sqrt(std::min(q.start_speed * q.start_speed + 2 * gentle * s,
                                       q.end_speed * q.end_speed + 2 * gentle * (q.way.length - s))));
    if (before != nullptr) {
      const auto above =
          std::upper_bound(before->way.begin() + 1, before->way.end() - 1, s) - before->way.begin();
      const auto b = static_cast<std::size_t>(above), a = b - 1;
      const double f = (s - before->way[a]) / (before->way[b] - before->way[a]);
      u = std::sqrt((1 - f) * before->speed[a] * before->speed[a] + f * before->speed[b] * before->speed[b]);
    }
    guess.push_back(std::max(u, 1e-5));
  }
  Ipopt::SmartPtr<Transcription> problem = new Transcription(q, std::move(nodes), std::move(guess));
  Ipopt::SmartPtr<Ipopt::IpoptApplication> ipopt = IpoptApplicationFactory();
  ipopt->Options()->SetIntegerValue("print_level", 0);
  ipopt->Options()->SetStringValue("sb", "yes");
  ipopt->Options()->SetNumericValue("tol", 1e-8);
  ipopt->Options()->SetIntegerValue("max_iter", 800);
  ipopt->Options()->SetStringValue("mu_strategy", "adaptive");
  if (ipopt->Initialize() != Ipopt::Solve_Succeeded) return {};
  const auto status = ipopt->OptimizeTNLP(Ipopt::SmartPtr<Ipopt::TNLP>(Ipopt::GetRawPtr(problem)));
  Found found = problem->found;
  found.solved = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  return found;
}

}  // namespace

Drive drive_at(const Question& q, double way, double speed, double acceleration) {
  const auto at = motors<double>(q, bend_at(q.way, way), speed, acceleration, 0);
  Drive d{};
  d.battery_w = q.robot.idle_power_w;
  for (int side : {0, 1}) {
    d.current_a[side] = at.current[side], d.voltage_v[side] = at.voltage[side];
    d.battery_w += at.power[side] * (at.power[side] > 0 ? 1 + q.driver_loss : q.regeneration - q.driver_loss);
  }
  return d;
}

Found least_energy(const Question& question) {
  Question coarse = question;
  coarse.cells = std::max(40, question.cells / 3);
  const Found first = solve(coarse, with_corners(coarse, first_nodes(coarse)), nullptr);
  return first.solved ? least_energy(question, first) : first;
}

Found least_energy(const Question& question, const Found& from) {
  return solve(question, with_corners(question, better_nodes(question, from)), &from);
}

}  // namespace joulecast::oracle
