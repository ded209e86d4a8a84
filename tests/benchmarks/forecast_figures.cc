// How good the consumption forecast is, on virtual robots: plants that share no physics with the model, with
// two to four effects each that the service does not know, noisy sensors, payloads, days that differ. No
// mission is used before it is forecast, and the constants of the forecast were chosen on other robots (seeds
// below 10,000).
//
//   forecast_figures [robots of each kind = 4] [missions of each = 45] [first seed = 90000]
//
// Prints coverage, errors, a reliability table, and the same missions decided on with a constant factor
// of 1.2 and with one fitted multiplier. Takes about 0.1 s of CPU a mission.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "client/virtual_robot/rng.h"
#include "forecast/siblings.h"
#include "virtual_missions.h"

namespace joulecast::forecast {
namespace {

constexpr std::array<const char*, 4> kinds{"amr", "nomad", "p3dx", "tug"};
constexpr std::size_t warm_up = 20;
constexpr double accept_at = 0.95;
constexpr double open_rmf_factor = 1.2;

// One forecast of one mission.
struct Row {
  double measured_j = 0, raw_j = 0, budget_j = 0, multiplier = 1;
  std::array<Prediction, driving_count> told;
  std::array<ScoreDistribution, driving_count> scores;
  std::array<double, driving_count> success{};
  std::array<double, driving_count> arrival_low{}, arrival_high{};
  double arrival = 0;
  bool held = false;  // the reserve, in truth
};

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

double share(std::size_t part, std::size_t of) {
  return of > 0 ? static_cast<double>(part) / static_cast<double>(of) : std::nan("");
}

void print_coverage(const std::vector<Row>& rows, Driving driving, const char* name) {
  const auto d = static_cast<std::size_t>(driving);
  std::vector<double> error, width;
  std::array<std::size_t, 3> inside{};
  constexpr std::array<double, 3> level{0.5, 0.8, 0.9};
  std::size_t charge_inside = 0, below = 0;
  for (const Row& row : rows) {
    Prediction p = row.told[d];
    p.scores = &row.scores[d];
    error.push_back(std::fabs(p.quantile_j(0.5) / row.measured_j - 1));
    width.push_back(p.quantile_j(0.95) / p.quantile_j(0.05) - 1);
    for (std::size_t k = 0; k < level.size(); ++k)
      inside[k] += row.measured_j >= p.quantile_j(0.5 - level[k] / 2) &&
                   row.measured_j <= p.quantile_j(0.5 + level[k] / 2);
    below += row.measured_j < p.quantile_j(0.05);
    charge_inside += row.arrival >= row.arrival_low[d] && row.arrival <= row.arrival_high[d];
  }
  const double coverage = share(inside[2], rows.size());
  std::printf("%-8s %6zu %9.2f%% %9.2f%% %8.1f%% %8.1f%% %8.1f%% +-%.1f %8.1f%% %8.1f%% %10.1f%%\n", name,
              rows.size(), 100 * median(error), 100 * median(width), 100 * share(inside[0], rows.size()),
              100 * share(inside[1], rows.size()), 100 * coverage,
              100 * std::sqrt(coverage * (1 - coverage) / static_cast<double>(rows.size())),
              100 * share(below, rows.size()), 100 * (1 - coverage - share(below, rows.size())),
              100 * share(charge_inside, rows.size()));
}

void print_reliability(const std::vector<Row>& rows, Driving driving, const char* name) {
  const auto d = static_cast<std::size_t>(driving);
  constexpr std::array<double, 8> edge{0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0001};
  double brier = 0;
  std::size_t held = 0;
  for (const Row& row : rows) {
    held += row.held;
    brier += (row.success[d] - row.held) * (row.success[d] - row.held);
  }
  const double base = share(held, rows.size());
  std::printf("\nSuccess probability, %s: Brier %.4f, of the base rate %.4f (%.1f %% succeed)\n", name,
              brier / static_cast<double>(rows.size()), base * (1 - base), 100 * base);
  std::printf("  %-13s %8s %10s %10s %18s\n", "told", "missions", "mean told", "held", "two deviations");
  for (std::size_t k = 0; k + 1 < edge.size(); ++k) {
    std::size_t count = 0, kept = 0;
    double told = 0;
    for (const Row& row : rows) {
      if (row.success[d] < edge[k] || row.success[d] >= edge[k + 1]) continue;
      ++count;
      kept += row.held;
      told += row.success[d];
    }
    if (count == 0) continue;
    told /= static_cast<double>(count);
    std::printf("  %4.2f to %4.2f  %8zu %10.3f %10.3f %18.3f\n", edge[k], std::min(1.0, edge[k + 1]), count,
                told, share(kept, count), 2 * std::sqrt(told * (1 - told) / static_cast<double>(count)));
  }
}

// A rule: how much energy it predicts, and how much it wants in the battery before it starts a mission.
template <class Expect, class Need>
void print_rule(const std::vector<Row>& rows, const char* name, Expect expect, Need need) {
  std::vector<double> error, waste;
  std::size_t short_of = 0, accepted = 0, failed = 0, missed = 0, possible = 0;
  for (const Row& row : rows) {
    const double wanted = need(row);
    error.push_back(std::fabs(expect(row) / row.measured_j - 1));
    waste.push_back(wanted / row.measured_j - 1);
    short_of += row.measured_j > wanted;
    const bool start = wanted <= row.budget_j;
    accepted += start;
    failed += start && !row.held;
    possible += row.held;
    missed += !start && row.held;
  }
  double mean_waste = 0;
  for (const double w : waste) mean_waste += std::max(0.0, w) / static_cast<double>(waste.size());
  std::printf("%-34s %9.2f%% %10.1f%% %9zu %7zu %6.1f%% %8zu %6.1f%% %9.1f%%\n", name, 100 * median(error),
              100 * (1 - share(short_of, rows.size())), accepted, failed, 100 * share(failed, accepted),
              missed, 100 * share(missed, possible), 100 * mean_waste);
}

int run(int each, int missions, std::uint64_t seed) {
  std::vector<Row> rows;
  std::array<std::vector<std::array<OwnFinding, driving_count>>, kinds.size()> found;
  double history_measured = 0, history_raw = 0;
  virtual_robot::Rng rng(seed);
  for (int r = 0; r < each; ++r) {
    for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
      const RobotRun robot = run_virtual_robot(kinds[kind], missions, seed++);
      const ChargeMap battery{battery::Circuit(robot.robot.battery)};
      RobotForecast forecast(robot.robot, robot.drive);
      std::array<Siblings, driving_count> siblings;
      for (std::size_t d = 0; d < driving_count; ++d) {
        std::vector<const OwnFinding*> others;
        for (const auto& f : found[kind]) others.push_back(&f[d]);
        siblings[d] = pool(others);
      }
      forecast.set_siblings(std::move(siblings));
      double own_measured = 0, own_raw = 0;
      for (std::size_t k = 0; k < robot.missions.size(); ++k) {
        const DrivenMission& mission = robot.missions[k];
        const auto f = forecast.forecaster();
        Row row;
        row.measured_j = mission.true_j;
        std::array<PlanSum, driving_count> plan;
        for (std::size_t d = 0; d < driving_count; ++d) {
          const auto driving = static_cast<Driving>(d);
          extend(plan[d], *f, driving, price_plan(robot, mission, *f, driving));
          row.told[d] = f->predict(plan[d], driving);
          row.scores[d] = f->tracks[d].scores;
        }
        // What the model says by itself, from the paces that the plan states, without pauses learnt.
        Forecaster plain = *f;
        plain.usual.pause_s = 0;
        for (const PricedLeg& leg : price_plan(robot, mission, plain, Driving::stated))
          row.raw_j += leg.cost.standing_j + leg.cost.motor_j;
        if (k >= warm_up) {
          // A battery that holds about what this robot has needed so far.
          row.budget_j = own_measured / own_raw * row.raw_j * rng.uniform(0.85, 1.2);
          const double power = row.raw_j / plan[0].duration_s;
          Charge charge{mission.charge_at_start, 0, 0};
          charge.reserve = battery.charge_after(charge.fraction, row.budget_j, power);
          for (std::size_t d = 0; d < driving_count; ++d) {
            row.success[d] = probability_of_reserve(*f, static_cast<Driving>(d), battery, charge, plan[d]);
            const auto arrival = arrival_charge(row.told[d], battery, charge, power);
            row.arrival_low[d] = arrival.front();
            row.arrival_high[d] = arrival.back();
          }
          row.arrival = mission.charge_at_end;
          row.held = mission.charge_at_end >= charge.reserve;
          rows.push_back(row);
        } else {
          history_measured += mission.metered_j;
          history_raw += row.raw_j;
        }
        own_measured += mission.metered_j;
        own_raw += row.raw_j;
        forecast.learn(mission.past);
      }
      found[kind].push_back(forecast.findings());
      std::fprintf(stderr, "\r%zu missions forecast", rows.size());
    }
  }
  std::fprintf(stderr, "\n");
  std::printf("%d robots, %zu missions forecast after %zu of each one's own\n\n",
              each * static_cast<int>(kinds.size()), rows.size(), warm_up);
  std::printf("%-8s %6s %10s %10s %9s %9s %15s %9s %9s %11s\n", "plan", "n", "error", "width 90", "in 50 %",
              "in 80 %", "in 90 %", "below", "above", "charge 90");
  print_coverage(rows, Driving::stated, "stated");
  print_coverage(rows, Driving::usual, "usual");
  print_reliability(rows, Driving::stated, "paces stated");
  print_reliability(rows, Driving::usual, "paces left to habit");

  const double multiplier = history_measured / history_raw;
  std::printf(
      "\nThe same missions, started when the battery holds what a rule wants (one multiplier for all: "
      "%.4f)\n",
      multiplier);
  std::printf("%-34s %10s %11s %9s %15s %16s %10s\n", "rule", "error", "sufficed", "started", "failed",
              "missed", "idle");
  print_rule(
      rows, "model x 1.2 (Open-RMF)", [](const Row& r) { return r.raw_j; },
      [](const Row& r) { return open_rmf_factor * r.raw_j; });
  print_rule(
      rows, "model x fitted (RouteE)", [&](const Row& r) { return multiplier * r.raw_j; },
      [&](const Row& r) { return multiplier * r.raw_j; });
  print_rule(
      rows, "model x fitted x 1.2", [&](const Row& r) { return multiplier * r.raw_j; },
      [&](const Row& r) { return open_rmf_factor * multiplier * r.raw_j; });
  for (const Driving driving : {Driving::stated, Driving::usual}) {
    const auto d = static_cast<std::size_t>(driving);
    const auto at = [d](const Row& r, double probability) {
      Prediction p = r.told[d];
      p.scores = &r.scores[d];
      return p.quantile_j(probability);
    };
    print_rule(
        rows, driving == Driving::stated ? "forecast, 95 %, paces stated" : "forecast, 95 %, habit",
        [&](const Row& r) { return at(r, 0.5); }, [&](const Row& r) { return at(r, accept_at); });
  }
  return 0;
}

}  // namespace
}  // namespace joulecast::forecast

int main(int count, char** arguments) {
  const auto number = [&](int index, int fallback) {
    return index < count ? std::atoi(arguments[index]) : fallback;
  };
  return joulecast::forecast::run(number(1, 4), number(2, 45), static_cast<std::uint64_t>(number(3, 90'000)));
}
