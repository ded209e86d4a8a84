#include "planning/planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "base/try.h"
#include "planning/numerics.h"
#include "planning/run_planner.h"

namespace joulecast::planning {
namespace {

// `least_s` is rounded up, so that a plan for it exists.
tl::unexpected<Error> too_soon(double deadline_s, double least_s) {
  return fail(Fault::infeasible, "deadline_s",
              fmt::format("is {} s, must be at least {:.6f} s within the robot's limits", deadline_s,
                          std::ceil(least_s * 1e6) / 1e6));
}

constexpr double at_once_w = std::numeric_limits<double>::infinity();  // the price of the fastest motion

// Of all grids of a request at the same time; each takes 0.8 kB (measured): 160 MB.
constexpr std::size_t most_nodes = 200'000;

// Everything that one request needs: its runs, each with its solver, and the dwells between them.
class Request {
 public:
  static Result<Request> make(const robot::RobotModel& robot, const DriveLoads& loads, const Path& path,
                              const Problem& problem, const std::stop_token& stop) {
    if (path.runs.empty() && path.dwell_s() == 0) return invalid("path", "has neither way nor dwell");
    const auto& l = problem.limits;
    for (auto [name, value] : {std::pair{"limits/speed_m_s", l.speed_m_s},
                               {"limits/acceleration_m_s2", l.acceleration_m_s2},
                               {"limits/yaw_rate_rad_s", l.yaw_rate_rad_s},
                               {"limits/wheel_speed_rad_s", l.wheel_speed_rad_s},
                               {"limits/current_a", l.current_a},
                               {"limits/voltage_v", l.voltage_v}}) {
      if (!(value > 0)) return invalid(name, "is " + std::to_string(value) + ", must be positive");
    }
    if (!(l.least_speed_m_s >= 0 && l.least_speed_m_s < l.speed_m_s))
      return fail(Fault::infeasible, "limits/least_speed_m_s",
                  fmt::format("is {}, limits/speed_m_s allows {}", l.least_speed_m_s, l.speed_m_s));
    for (auto [name, value] : {std::pair{"value_of_time_w", problem.value_of_time_w},
                               {"start_speed_m_s", problem.start_speed_m_s},
                               {"end_speed_m_s", problem.end_speed_m_s}}) {
      if (!(std::isfinite(value) && value >= 0)) return invalid(name, "must not be negative");
    }
    if (!(loads.electric().idle_w + problem.value_of_time_w >= 0))
      return invalid("value_of_time_w", "plus the idle power must not be negative");
    if (problem.deadline_s && !(std::isfinite(*problem.deadline_s) && *problem.deadline_s > 0)) {
      return invalid("deadline_s", "must be positive");
    }
    if (problem.energy_budget_j &&
        !(std::isfinite(*problem.energy_budget_j) && !problem.deadline_s && problem.value_of_time_w == 0)) {
      return invalid("energy_budget_j", "must be a number, without a deadline and a value of time");
    }
    const bool moving_start = problem.start_speed_m_s > 0, moving_end = problem.end_speed_m_s > 0;
    if (moving_start &&
        (path.runs.empty() || path.runs.front().turn != 0 || path.runs.front().dwell_before_s > 0)) {
      return invalid("start_speed_m_s", "must be 0 where the path begins with a stop or a turn in place");
    }
    if (moving_end && (path.runs.empty() || path.runs.back().turn != 0 || path.dwell_after_s > 0)) {
      return invalid("end_speed_m_s", "must be 0 where the path ends with a stop or a turn in place");
    }
    Request request(loads, path, problem, stop);
    std::size_t nodes = 0;
    std::map<std::array<double, 3>, std::size_t> uniform_runs;  // planners by length and loads
    for (std::size_t k = 0; k < path.runs.size(); ++k) {
      if (stop.stop_requested()) return stopped();
      const Run& run = path.runs[k];
      if (robot.limits.payload_kg > 0 && run.payload_kg > robot.limits.payload_kg) {
        return fail(Fault::infeasible, "payload_kg",
                    "is " + std::to_string(run.payload_kg) + ", this robot carries at most " +
                        std::to_string(robot.limits.payload_kg));
      }
      const double start = k == 0 ? problem.start_speed_m_s : 0,
                   end = k + 1 == path.runs.size() ? problem.end_speed_m_s : 0;
      std::size_t& first = request.of_run_.emplace_back(request.runs_.size());
      const std::optional<WheelLoads> uniform = loads.uniform_loads(run);
      if (uniform) {
        const auto [low, high] = std::minmax((*uniform)[0].t0, (*uniform)[1].t0);
        const auto [like, is_new] = uniform_runs.try_emplace({run.length(), low, high}, first);
        if (!is_new && request.runs_[like->second].answers(run, *uniform, start, end)) {
          first = like->second;
          request.counts_[first] += 1;
          continue;
        }
      }
      TRY_ASSIGN(auto planner, RunPlanner::make(robot, loads, run, uniform, problem, start, end));
      request.runs_.push_back(std::move(planner));
      request.counts_.push_back(1);
      if ((nodes += request.runs_.back().nodes()) > most_nodes) return too_long();
    }
    request.dwell_s_ = path.dwell_s();
    return request;
  }

  // Solves every run at one price of time; as fast as the limits allow at an infinite one.
  Result<void> solve(double price_w, const std::optional<Due>& due = {}) {
    keep();
    price_w_ = price_w;
    answers_.clear();
    answers_.reserve(runs_.size());
    std::size_t nodes = 0;
    for (RunPlanner& run : runs_) {
      TRY_ASSIGN(RunAnswer answer, run.solve(price_w, stop_, due));
      iterations_ += answer.iterations;
      if ((nodes += run.nodes()) > most_nodes) return too_long();
      if (brief() && run.uniform()) answer.forget_motion();
      if (due) price_w_ = answer.price_w;
      answers_.push_back(std::move(answer));
    }
    return {};
  }

  // Of the fastest motion that the limits allow.
  double least_time_s() {
    double sum = dwell_s_;
    for (std::size_t k = 0; k < runs_.size(); ++k) sum += counts_[k] * runs_[k].shortest_s();
    return sum;
  }

  // Solves at the value of time, or at the price that meets the deadline or the energy budget.
  Result<void> solve() {
    if (problem_.energy_budget_j) return spend(*problem_.energy_budget_j);
    if (!problem_.deadline_s) return solve(problem_.value_of_time_w);
    const double deadline = *problem_.deadline_s;
    // On rough grids, to see whether the deadline is earlier.
    auto free = roughly(problem_.value_of_time_w);
    if (free && free->duration_s <= deadline * 1.02) {
      TRY(solve(problem_.value_of_time_w));
      if (duration_s() <= deadline) return {};
      bound_by(deadline);
    } else if (!free) {
      // Without idle power, friction and value of time only a deadline ends the motion.
      if (free.error().fault != Fault::infeasible || free.error().field != "value_of_time_w")
        return tl::unexpected(std::move(free.error()));
      endless_ = true;
      free = roughly(1.0);
      if (!free) return tl::unexpected(std::move(free.error()));
    }
    usual_w_ = std::fabs(free->energy_j / free->duration_s);
    price_w_ = endless_ ? 1.0 : problem_.value_of_time_w;
    return meet(deadline, 2e-4 * deadline);
  }

  // Whether closed forms answer every run at the value of time, in time for the deadline; then solved.
  bool solve_at_once() {
    if (problem_.deadline_s || problem_.energy_budget_j) return false;
    price_w_ = problem_.value_of_time_w;
    answers_.clear();
    for (const RunPlanner& run : runs_) {
      auto answer = run.closed_form(price_w_);
      if (!answer) return false;
      answers_.push_back(std::move(*answer));
    }
    return true;
  }

  // The best motion found that ends by the deadline; ends at most `early_s` before it where one price of time
  // does.
  Result<void> meet(double deadline, double early_s) {
    keeps_until_s_ = deadline;
    kept_.answers.clear();
    if (!answers_.empty()) usual_w_ = std::fabs(energy_j() / duration_s());
    TRY(search(deadline, early_s));
    keep();
    if (!kept_.answers.empty()) std::swap(answers_, kept_.answers), price_w_ = kept_.price_w;
    return {};
  }

  // The fastest motion found within the budget; spends all but a thousandth of the budget's excess over the
  // least energy, or 1e-5 of the budget.
  Result<void> spend(double budget_j) {
    constexpr double of_rows = 2e-5;  // excess of rows' energies over the solvers'
    keeps_until_j_ = (1 - of_rows) * budget_j;
    if (solve(at_once_w) && energy_j() <= keeps_until_j_) return {};  // an error where no limit bounds it
    answers_.clear();
    binds_ = Bound::energy_budget;
    double least_j = 0, usual_w = 1;  // endless motions may take nearly nothing
    if (auto ok = solve(0); ok)
      least_j = energy_j(), usual_w = std::max(std::fabs(least_j / duration_s()), 1e-3);
    else if (ok.error().fault != Fault::infeasible || ok.error().field != "value_of_time_w")
      return ok;
    const double spare_j = keeps_until_j_ - least_j, smallest_j = 1e-12 * budget_j;
    if (spare_j < 0) return {};  // the plan's energy is compared with the budget
    // log(E - E_min) falls nearly linearly in -log(price).
    Search at{-std::log(usual_w), -0.8, -std::log(1e6 * usual_w), -std::log(1e-6 * usual_w)};
    const auto above = [&](double energy_j, double least_energy_j) {
      return std::log(std::max(smallest_j, energy_j - least_energy_j) /
                      std::max(smallest_j, keeps_until_j_ - least_energy_j));
    };
    if (std::ranges::any_of(runs_, [](const RunPlanner& run) { return run.on_grid(); })) {
      TRY_ASSIGN(const PlanCost rough, least_j > 0 ? roughly(0) : PlanCost{});
      const auto roughly_above = [&](double x) {
        return roughly(std::exp(-x)).map([&](const PlanCost& c) {
          return above(c.energy_j, rough.energy_j);
        });
      };
      TRY(draw_in(at, 0.02, roughly_above));
    }
    const auto truly_above = [&](double x) -> Result<double> {
      TRY(solve(std::exp(-x)));
      return above(energy_j(), least_j);
    };
    const double rest = std::clamp(1e-5 * budget_j / std::max(spare_j, smallest_j), 1e-3, 0.5);
    TRY(draw_in(at, -std::log1p(-rest), truly_above));
    keep();
    if (kept_.answers.empty()) return solve(0);
    std::swap(answers_, kept_.answers), price_w_ = kept_.price_w;
    return {};
  }

  Result<void> search(double deadline, double early_s) {
    const double least_s = least_time_s();
    if (deadline < least_s * (1 - 1e-9)) return too_soon(deadline, least_s);
    binds_ = Bound::deadline;
    const bool grids = std::ranges::any_of(runs_, [](const RunPlanner& run) { return run.on_grid(); });
    if (deadline <= least_s * (1 + 1e-7)) {
      // The error that a grid states of itself is less certain the higher the price of time.
      for (const double dear : {0.0, 3.0, 30.0, 300.0}) {
        if (grids && dear > 0) break;
        TRY(solve(price_w_ + dear * std::max(usual_w_, 1e-3)));
        bound_by(deadline);
      }
      return solve(at_once_w);
    }
    // log(T - T_min) falls nearly linearly in log(idle + price).
    const double idle = endless_ ? 0 : std::max(loads_.electric().idle_w, 1e-3 * usual_w_);
    Search at;
    if (!endless_) at.least = std::log(idle + problem_.value_of_time_w);
    at.most = std::log(1e6 * std::max(usual_w_, 1e-3));
    at.x = std::min(std::log(idle + price_w_), at.most);
    const auto late = [&](double duration_s) {
      return std::log(std::max(1e-12, duration_s - least_s) / (deadline - least_s));
    };
    const auto price_at = [&](double x) {
      return x == at.least ? problem_.value_of_time_w : std::exp(x) - idle;
    };
    const auto roughly_late = [&](double x) {
      return roughly(price_at(x)).map([&](const PlanCost& cost) { return late(cost.duration_s); });
    };
    const auto truly_late = [&](double x) -> Result<double> {
      TRY(solve(price_at(x)));
      bound_by(deadline);
      return late(duration_s());
    };
    // A price below the value of time is none; of a higher one, energy is too small a share for solvers to
    // see.
    if (grids) {
      // Rough grids do not distinguish the highest prices.
      Search near = at;
      const double most_w = 30 * std::max(usual_w_, 1e-3);
      near.most = std::max(at.x, std::log(most_w));
      if (path_.runs.size() == 1) {
        // Found together with the motion, to the solver's tolerance of the duration.
        TRY_ASSIGN(const double y, roughly_late(at.x));
        const double guess = std::clamp(at.x - y / at.slope, at.least, near.most);
        TRY(solve(price_at(guess), Due{deadline * (1 - 2e-6) - dwell_s_, most_w}));
        at.x = std::clamp(std::log(idle + price_w_), at.least, near.most);
      } else {
        TRY(draw_in(near, 0.02, roughly_late));
        if (near.x < near.most) at.x = near.x, at.slope = near.slope;
      }
    }
    // The unused time may cost a small share of the energy, or of the freedom that the deadline leaves.
    const double little_s =
        std::max({1e-6 * deadline, 1e-3 * (deadline - least_s), 1e-4 * usual_w_ * deadline / price_at(at.x)});
    const double early = -std::log1p(-std::min(0.5, std::min(early_s, little_s) / (deadline - least_s)));
    const double y = answers_.empty() || price_w_ < problem_.value_of_time_w ? 1 : late(duration_s());
    if (y <= 0 && y > -early)
      bound_by(deadline);
    else
      TRY(draw_in(at, early, truly_late));
    keep();
    // Closer to the shortest time than any finite price comes.
    return kept_.answers.empty() ? solve(at_once_w) : Result<void>{};
  }

  // Where the search for a logarithm of a price is, and how fast the lateness changes with it there.
  struct Search {
    double x = 0, slope = -0.8;
    double least = -std::numeric_limits<double>::infinity(), most = 0;
  };

  // Moves to where late(x), which falls, is at most 0 and more than -early: by the secant through the last
  // two places or by halving where the secant leaves the bracket or stalls.
  template <class Late>
  static Result<void> draw_in(Search& at, double early, Late&& late) {
    double slow = -std::numeric_limits<double>::infinity(), fast = -slow, wide = fast;
    double stride = 1, last_x = 0, last_y = 0;
    for (int k = 0; k < 60 && fast - slow > 1e-9; ++k) {
      const double x = at.x;
      TRY_ASSIGN(const double y, late(x));
      if (k > 0) at.slope = std::clamp((y - last_y) / (x - last_x), -5.0, -0.05);
      if (y <= 0 && y > -early) break;
      (y > 0 ? slow : fast) = x;
      if (x == (y > 0 ? at.most : at.least)) break;
      last_x = x, last_y = y;
      const double step = -(y + 0.5 * early) / at.slope;
      const bool enclosed = std::isfinite(fast - slow);
      at.x = std::clamp(x + (enclosed ? step : std::clamp(stride * step, -3.0, 3.0)), at.least, at.most);
      if (!enclosed) stride *= 1.2;
      const bool stalls = enclosed && k % 4 == 3 && fast - slow > 0.5 * std::exchange(wide, fast - slow);
      if (stalls || !(at.x > slow && at.x < fast)) at.x = enclosed ? 0.5 * (slow + fast) : at.x;
    }
    return {};
  }

  // Energy and duration at a price of time, to some thousandths.
  Result<PlanCost> roughly(double price_w) {
    PlanCost cost{dwell_s_ * loads_.electric().idle_w, dwell_s_};
    std::size_t nodes = 0;
    for (std::size_t k = 0; k < runs_.size(); ++k) {
      TRY_ASSIGN(const RunAnswer answer, runs_[k].solve_roughly(price_w, stop_));
      iterations_ += answer.iterations;
      if ((nodes += runs_[k].nodes()) > most_nodes) return too_long();
      cost.energy_j += counts_[k] * answer.energy_j, cost.duration_s += counts_[k] * answer.duration_s;
    }
    return cost;
  }

  // The last solution minimises the sum of energy and the price of its time: no motion that ends by the
  // deadline costs less than that sum with the deadline's time at the price above the value of time.
  void bound_by(double deadline) {
    double least_j = cost_j() + (price_w_ - problem_.value_of_time_w) * (duration_s() - deadline);
    least_j -= sum_of([](const RunAnswer& a) { return a.gap_j + a.discretisation_j; });
    least_j_ = std::max(least_j_, least_j);
  }

  // Keeps the last solution where it ends by the deadline and is the cheapest that does, or keeps to the
  // budget and is the fastest.
  void keep() {
    if (answers_.size() != runs_.size()) return;
    if (!(energy_j() <= keeps_until_j_ && duration_s() <= keeps_until_s_)) return;
    const double cost = problem_.energy_budget_j ? duration_s() : cost_j();
    if (kept_.answers.empty() || cost < kept_.cost) {
      kept_ = {std::move(answers_), price_w_, cost};
      answers_.clear();
    }
  }

  // Over the path's runs.
  template <class Of>
  double sum_of(Of&& of) const {
    double sum = 0;
    for (std::size_t k = 0; k < answers_.size(); ++k) sum += counts_[k] * std::invoke(of, answers_[k]);
    return sum;
  }
  double duration_s() const { return dwell_s_ + sum_of(&RunAnswer::duration_s); }
  double energy_j() const { return dwell_s_ * loads_.electric().idle_w + sum_of(&RunAnswer::energy_j); }
  double cost_j() const { return energy_j() + problem_.value_of_time_w * duration_s(); }
  PlanCost cost() const {
    PlanCost cost{energy_j(), duration_s(), price_w_, 0, true};
    for (std::size_t k = 0; k < runs_.size(); ++k) {
      cost.closed_form = cost.closed_form && answers_[k].method != Method::interior_point;
      if (runs_[k].run().turn == 0)
        cost.peak_speed_m_s = std::max(cost.peak_speed_m_s, answers_[k].peak_speed);
    }
    return cost;
  }

  Result<Plan> written();

 private:
  Request(const DriveLoads& loads, const Path& path, const Problem& problem, std::stop_token stop)
      : loads_(loads), path_(path), problem_(problem), stop_(std::move(stop)) {}

  static tl::unexpected<Error> too_long() {
    return fail(Fault::too_large, "path",
                fmt::format("needs grids of more than {} nodes; request it in parts", most_nodes));
  }

  // Long paths keep no motion that can be found again when it is written.
  bool brief() const { return runs_.size() > 100; }

  const DriveLoads& loads_;
  const Path& path_;
  const Problem& problem_;
  std::stop_token stop_;
  // Alike runs, as the straights and turns of a grid, share a planner; answers_ and counts_ are by planner.
  std::vector<RunPlanner> runs_;
  std::vector<double> counts_;       // runs of the path that share it
  std::vector<std::size_t> of_run_;  // planner of each of the path's runs
  std::vector<RunAnswer> answers_;
  struct Kept {
    std::vector<RunAnswer> answers;
    double price_w = 0, cost = 0;
  };
  Kept kept_;
  double keeps_until_s_ = unlimited, keeps_until_j_ = unlimited;
  double dwell_s_ = 0, price_w_ = 0;
  int iterations_ = 0;
  double usual_w_ = 0;                                         // the mean power in free time, without sign
  double least_j_ = -std::numeric_limits<double>::infinity();  // where there is a deadline: no motion that
                                                               // meets it costs less
  std::optional<Bound> binds_;                                 // of the whole motion
  bool endless_ = false;                                       // without a price of time
};

// Writes rows and integrates the drive model's power flow along them.
class Writer {
 public:
  Writer(const DriveLoads& loads, bool rows) : loads_(loads), rows_(rows) {}

  struct State {
    double way = 0, speed = 0, acceleration = 0;
  };

  // `at(row, fraction)` is the motion within the cell that begins at `row`; fractions are of its duration.
  template <class At>
  void run(const Run& run, const std::vector<double>& times, At&& at) {
    uniform_ = loads_.uniform(run);
    if (uniform_) {
      here_ = loads_.instant(run, run.at(0), 1, 1);
      pace_ = here_.wheel_speed_rad_s;
    }
    if (rows_) reserve(plan_.profile.size() + times.size());
    for (std::size_t k = 0; k < times.size(); ++k) {
      const bool last = k + 1 == times.size();
      const State s = last ? at(k - 1, 1.0) : at(k, 0.0);
      const dynamics::PowerFlow<double> here = flow(run, s);
      row(run, s, start_s_ + times[k], here.battery_power_w);
      if (last) break;
      const double span = times[k + 1] - times[k];
      const State next = at(k, 1.0);
      int parts = loads_.scrubs() ? parts_of(run, s, next.speed) : 1;
      if (const Electric& e = loads_.electric(); e.up != e.down) {
        const dynamics::PowerFlow<double> there = flow(run, next);
        for (const std::size_t side : {0u, 1u})
          parts =
              std::max(parts, parts_of_turn(here.motor_power_w[side], there.motor_power_w[side], e.idle_w));
      }
      for (int part = 0; part < parts; ++part)
        for (const auto& [place, weight] : gauss2)
          add(flow(run, at(k, (part + place) / parts)), weight * span / parts);
    }
    if (run.turn == 0) driven_m_ += run.length();
    start_s_ += times.back();
  }

  void dwell(double duration_s, const Pose& pose, double payload_kg) {
    if (duration_s <= 0) return;
    const double idle = loads_.electric().idle_w;
    for (bool end : {false, true}) {
      push(start_s_ + (end ? duration_s : 0), driven_m_, pose, 0, 0, 0, 0, payload_kg, idle);
      if (!end) {
        plan_.ledger[signals::Term::accessories] += idle * duration_s;
        plan_.summary.energy_j += idle * duration_s;
      }
    }
    start_s_ += duration_s;
  }

  Plan finish() { return std::move(plan_); }
  Plan& plan() { return plan_; }

 private:
  int parts_of(const Run& run, const State& from, double to_speed) const {
    return loads_.at(run, run.at(from.way))[0].parts(from.speed, to_speed);
  }

  // Two places a span: exact for power that is cubic in time, a quadratic of the speed, and drag, at constant
  // acceleration.
  dynamics::PowerFlow<double> flow(const Run& run, const State& s) {
    if (uniform_) {
      for (std::size_t side : {0u, 1u}) {
        here_.wheel_speed_rad_s[side] = pace_[side] * s.speed;
        here_.wheel_acceleration_rad_s2[side] = pace_[side] * s.acceleration;
      }
      return loads_.model().flow(here_);
    }
    return loads_.model().flow(loads_.instant(run, just_after(run, s.way), s.speed, s.acceleration));
  }

  // As in the rows: the curvature's slope jumps at knots.
  static Place just_after(const Run& run, double way) { return run.at(way + 1e-9 * run.length()); }

  void add(const dynamics::PowerFlow<double>& f, double seconds) {
    using signals::Term;
    for (std::size_t k = 0; k < signals::term_count; ++k)
      plan_.ledger.value[k] += f.ledger.value[k] * seconds;
    plan_.summary.energy_j += f.battery_power_w * seconds;
    plan_.summary.braking_j += f.ledger[Term::braking] * seconds;
    plan_.summary.recovered_j += f.ledger[Term::recovered] * seconds;
  }

  void reserve(std::size_t rows) {
    Profile& p = plan_.profile;
    for (std::vector<double>* column :
         {&p.time_s, &p.distance_m, &p.x_m, &p.y_m, &p.heading_rad, &p.speed_m_s, &p.yaw_rate_rad_s,
          &p.acceleration_m_s2, &p.yaw_acceleration_rad_s2, &p.payload_kg, &p.power_w, &p.energy_j}) {
      if (rows > column->capacity()) column->reserve(std::max(rows, 2 * column->size()));
    }
  }

  void row(const Run& run, const State& s, double time_s, double power) {
    const Knot knot = run.at(s.way);
    if (run.turn != 0) {
      push(time_s, driven_m_, knot.pose, 0, run.turn * s.speed, 0, run.turn * s.acceleration, run.payload_kg,
           power);
    } else {
      push(time_s, driven_m_ + s.way, knot.pose, s.speed, knot.curvature_1_m * s.speed, s.acceleration,
           knot.curvature_1_m * s.acceleration + just_after(run, s.way).curvature_slope * s.speed * s.speed,
           run.payload_kg, power);
    }
  }

  void push(double time_s, double distance_m, const Pose& pose, double speed, double yaw, double acceleration,
            double yaw_acceleration, double payload_kg, double power_w) {
    Summary& s = plan_.summary;
    s.peak_speed_m_s = std::max(s.peak_speed_m_s, speed);
    s.peak_yaw_rate_rad_s = std::max(s.peak_yaw_rate_rad_s, std::fabs(yaw));
    s.peak_power_w = std::max(s.peak_power_w, power_w);
    if (!rows_) return;
    Profile& p = plan_.profile;
    p.time_s.push_back(time_s);
    p.distance_m.push_back(distance_m);
    p.x_m.push_back(pose.x_m), p.y_m.push_back(pose.y_m), p.heading_rad.push_back(pose.heading_rad);
    p.speed_m_s.push_back(speed), p.yaw_rate_rad_s.push_back(yaw);
    p.acceleration_m_s2.push_back(acceleration), p.yaw_acceleration_rad_s2.push_back(yaw_acceleration);
    p.payload_kg.push_back(payload_kg);
    p.power_w.push_back(power_w);
    p.energy_j.push_back(plan_.summary.energy_j);
  }

  const DriveLoads& loads_;
  const bool rows_;
  Plan plan_;
  // For a run with constant loads: its instant except for the motion, and the wheels' rotation per unit of
  // way.
  bool uniform_ = false;
  dynamics::Instant here_;
  std::array<double, 2> pace_{};
  double start_s_ = 0, driven_m_ = 0;
};

Result<Plan> Request::written() {
  Writer writer(loads_, problem_.rows);
  Certificate& c = writer.plan().certificate;
  std::array<bool, bound_count> binding{};
  Pose pose;
  std::vector<double> left = counts_;  // runs to be written
  for (std::size_t k = 0; k < path_.runs.size(); ++k) {
    if (stop_.stop_requested()) return stopped();
    const Run& run = path_.runs[k];
    RunPlanner& planner = runs_[of_run_[k]];
    RunAnswer& answer = answers_[of_run_[k]];
    if (!answer.has_motion()) {
      TRY_ASSIGN(answer, planner.solve(price_w_, stop_));
    }
    writer.plan().run_duration_s.push_back(answer.duration_s);
    writer.dwell(run.dwell_before_s, run.knots.front().pose, run.payload_kg);
    pose = run.knots.back().pose;
    std::vector<double> times;
    if (answer.line) {
      const LineMotion& line = *answer.line;
      times = line.times(std::max<std::size_t>(8, problem_.intervals_per_run));
      writer.run(run, times, [&](std::size_t i, double f) {
        const double t = times[i] + f * (times[i + 1] - times[i]);
        const LineState s = line.state(t);
        return Writer::State{s.position, std::max(0.0, s.speed), s.acceleration};
      });
    } else {
      const std::vector<double>&way = answer.way, &speed = answer.speed;
      const double most = planner.acceleration_limit();
      times.push_back(0);
      for (std::size_t i = 0; i + 1 < way.size(); ++i)
        times.push_back(times.back() + 2 * (way[i + 1] - way[i]) / (speed[i] + speed[i + 1]));
      writer.run(run, times, [&](std::size_t i, double f) {
        const double span = times[i + 1] - times[i], rate = (speed[i + 1] - speed[i]) / span,
                     v = speed[i] + f * span * rate;
        // A difference over a short span passes the limit by its rounding.
        const bool rounded = std::fabs(rate) <= most * (1 + 1e-6);
        return Writer::State{way[i] + f * span * 0.5 * (speed[i] + v), v,
                             rounded ? std::clamp(rate, -most, most) : rate};
      });
      c.discretisation_j += answer.discretisation_j;
    }
    if (--left[of_run_[k]] == 0 && brief()) answer.forget_motion();
    if (writer.plan().profile.size() > most_rows) {
      return fail(Fault::too_large, "columns",
                  fmt::format("the motion has more than {} rows; request it without columns, or in parts",
                              most_rows));
    }
    c.method = k == 0 || c.method == answer.method ? answer.method : Method::mixed;
    c.gap_j += answer.gap_j;
    c.residual = std::max(c.residual, answer.residual);
    c.convex = c.convex && answer.convex;
    for (std::size_t b = 0; b < bound_count; ++b) binding[b] = binding[b] || answer.binding[b];
  }
  writer.dwell(path_.dwell_after_s, pose, path_.final_payload_kg);
  c.iterations = iterations_;
  c.time_multiplier_w = price_w_;
  c.shortest_time_s = least_time_s();
  // A motion that ends at the deadline saves at most the price of the time in between; the fastest motion has
  // no price. Each is compared with those of all prices that were tried.
  if (binds_ == Bound::deadline && problem_.deadline_s) {
    c.gap_j +=
        std::isfinite(price_w_) ? price_w_ * std::max(0.0, *problem_.deadline_s - duration_s()) : unlimited;
    c.gap_j = std::min(c.gap_j, std::max(0.0, cost_j() - least_j_));
  }
  // Likewise, a faster motion within the budget is worth at most the energy left over.
  if (binds_ == Bound::energy_budget) c.gap_j += std::max(0.0, *problem_.energy_budget_j - energy_j());
  if (binds_) binding[static_cast<std::size_t>(*binds_)] = true;
  for (std::size_t b = 0; b < bound_count; ++b) {
    if (binding[b]) c.binding.push_back(static_cast<Bound>(b));
  }
  Summary& s = writer.plan().summary;
  s.duration_s = duration_s();
  s.distance_m = path_.distance_m();
  s.turned_rad = path_.turned_rad();
  // Answers have ten digits: an energy that one contains is a budget.
  if (problem_.energy_budget_j && s.energy_j > (1 + 1e-9) * *problem_.energy_budget_j) {
    return fail(Fault::infeasible, "energy_budget_j",
                fmt::format("is {} J, the path needs no less than {:.6f} J", *problem_.energy_budget_j,
                            std::ceil(s.energy_j * 1e6) / 1e6));
  }
  return writer.finish();
}

Result<Request> solved(const robot::RobotModel& robot, const DriveLoads& loads, const Path& path,
                       const Problem& problem, const std::stop_token& stop) {
  auto request = Request::make(robot, loads, path, problem, stop);
  if (request) TRY(request->solve());
  return request;
}

}  // namespace

Limits limits_of(const robot::RobotModel& robot) {
  const auto given = [](double value) { return value > 0 ? value : unlimited; };
  Limits limits;
  limits.speed_m_s = given(robot.limits.speed_m_s);
  limits.acceleration_m_s2 = given(robot.limits.acceleration_m_s2);
  limits.yaw_rate_rad_s = given(robot.limits.yaw_rate_rad_s);
  limits.current_a = given(robot.limits.current_a);
  limits.voltage_v = given(robot.battery.nominal_voltage_v);
  return limits;
}

std::string_view name_of(Method method) {
  constexpr std::array<std::string_view, 4> names = {"closed_form", "quadrature", "interior_point", "mixed"};
  static_assert(static_cast<Method>(names.size() - 1) == Method::mixed);
  return names[static_cast<std::size_t>(method)];
}

std::string_view name_of(Bound bound) {
  constexpr std::array<std::string_view, bound_count> names = {
      "speed", "yaw_rate", "wheel_speed", "acceleration", "current", "voltage", "deadline", "energy_budget"};
  return names[static_cast<std::size_t>(bound)];
}

Result<Planner> Planner::make(const robot::RobotModel& robot, std::optional<double> regeneration) {
  TRY_ASSIGN(auto loads, DriveLoads::make(robot, regeneration));
  return Planner(robot, std::move(loads));
}

Result<Plan> Planner::plan(const Path& path, const Problem& problem, std::stop_token stop) const {
  return solved(robot_, loads_, path, problem, stop).and_then([](Request&& request) {
    return request.written();
  });
}

std::optional<Plan> Planner::plan_at_once(const Path& path, const Problem& problem) const {
  if (path.runs.size() != 1 || !loads_.uniform(path.runs[0])) return std::nullopt;
  auto request = Request::make(robot_, loads_, path, problem, {});
  if (!request || !request->solve_at_once()) return std::nullopt;
  auto plan = request->written();
  if (!plan) return std::nullopt;
  return std::move(*plan);
}

Result<PlanCost> Planner::cost(const Path& path, const Problem& problem, std::stop_token stop) const {
  return solved(robot_, loads_, path, problem, stop).map([](const Request& request) {
    return request.cost();
  });
}

Result<PlanCost> Planner::cost(Run run, double payload_kg, const Problem& problem,
                               std::stop_token stop) const {
  run.dwell_before_s = 0;
  run.payload_kg = payload_kg;
  Path path;
  path.runs.push_back(std::move(run));
  path.final_payload_kg = payload_kg;
  return cost(path, problem, std::move(stop));
}

Result<double> Planner::needed_speed(const Path& path, const Problem& problem, std::stop_token stop) const {
  if (!problem.deadline_s) return invalid("deadline_s", "is required");
  const double deadline = *problem.deadline_s;
  Problem limited = problem;
  limited.limits.least_speed_m_s = 0;  // bounds no least time
  // Seconds late under a speed limit; the end speeds must remain allowed.
  const auto late = [&](double speed) -> Result<double> {
    limited.limits.speed_m_s = speed;
    TRY_ASSIGN(Request request, Request::make(robot_, loads_, path, limited, stop));
    return request.least_time_s() - deadline;
  };
  TRY_ASSIGN(const double fastest, late(problem.limits.speed_m_s));
  if (fastest > 1e-6 * deadline) return too_soon(deadline, deadline + fastest);
  const double ends = std::max(problem.start_speed_m_s, problem.end_speed_m_s);
  if (path.distance_m() == 0) return 0.0;
  // No slower than the distance over the whole time.
  double low = std::max({ends, path.distance_m() / deadline, problem.limits.least_speed_m_s, 1e-9});
  TRY_ASSIGN(const double late_low, late(low));
  if (late_low <= 0) return low;
  double high = low, late_high = late_low;
  while (late_high > 0) {
    high *= 2;
    if (high >= problem.limits.speed_m_s) {
      high = problem.limits.speed_m_s, late_high = std::min(fastest, 0.0);
      break;
    }
    TRY_ASSIGN(late_high, late(high));
  }
  if (!std::isfinite(high)) return high;
  // Time falls as a distance over the speed: nearly linear in its inverse.
  const double pace = zero_between([&](double p) { return late(1 / p).value_or(0); }, 1 / high, late_high,
                                   1 / low, late_low, 1e-4);
  return 1 / pace;
}

Result<std::vector<PlanCost>> Planner::pareto(const Path& path, const Problem& problem, std::size_t count,
                                              std::stop_token stop) const {
  if (count < 2) return invalid("count", "must be at least 2");
  Problem hurried = problem;
  hurried.hurried = true;
  hurried.energy_budget_j.reset();
  TRY_ASSIGN(Request request, Request::make(robot_, loads_, path, hurried, stop));
  TRY(request.solve(problem.value_of_time_w));
  const PlanCost free = request.cost();
  std::vector<PlanCost> front{free};
  // The shortest time itself costs an unbounded price; the front ends a hundredth of the way before it.
  const double shortest = request.least_time_s();
  if (free.duration_s < shortest * (1 + 1e-5)) return front;
  const double fastest = std::max(shortest * (1 + 2e-6), shortest + 0.01 * (free.duration_s - shortest));
  const double spacing = (free.duration_s - fastest) / static_cast<double>(count - 1);
  for (std::size_t k = 1; k < count; ++k) {
    const double deadline = free.duration_s - static_cast<double>(k) * spacing;
    TRY(request.meet(deadline, std::min(1e-4 * deadline, 0.1 * spacing)));
    // Nearer to the shortest time than grids distinguish, motions are the same.
    if (const PlanCost cost = request.cost(); cost.duration_s < front.back().duration_s * (1 - 1e-9))
      front.push_back(cost);
  }
  return front;
}

Result<Plan> plan(const robot::RobotModel& robot, const Path& path, const Problem& problem,
                  std::stop_token stop) {
  TRY_ASSIGN(const Planner planner, Planner::make(robot, problem.regeneration));
  return planner.plan(path, problem, std::move(stop));
}

}  // namespace joulecast::planning
