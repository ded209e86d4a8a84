#include "foreign_coverage.h"

#include <algorithm>
#include <cstdio>
#include <span>

#include "forecast/outlook.h"
#include "foreign_missions.h"

namespace joulecast::forecast {
namespace {

constexpr std::size_t robots = 5, missions = 45, learnt = 30, lent = 24, most_empty = 20;

enum class Stated { ways, cruises, all };

bool loaded(const DrivenMission& mission) {
  return mission.plan.front().leg.payload_kg > 0;
}

PlanSum sum_of_plan(const RobotRun& run, const DrivenMission& mission, const Forecaster& forecaster,
                    Stated what) {
  const LegPricer pricer(run.robot, run.drive);
  PlanSum sum;
  for (const StatedLeg& stated : mission.plan) {
    const bool stands = stated.leg.motion == Motion::stand, turns = stated.leg.motion == Motion::turn;
    StatedPace pace;
    if (stands && what == Stated::ways) continue;
    if (!stands && what != Stated::ways) (turns ? pace.yaw_rate_rad_s : pace.speed_m_s) = stated.speed;
    if (!stands && what == Stated::all)
      (turns ? pace.yaw_acceleration_rad_s2 : pace.acceleration_m_s2) = stated.acceleration;
    extend(sum, forecaster, price(forecaster, pricer, std::span(&stated.leg, 1), pace, what != Stated::ways));
  }
  return sum;
}

class Counting {
 public:
  void ask(const RobotRun& run, const DrivenMission& mission, const Forecaster& forecaster, Stated what,
           const std::string& row) {
    const PlanSum sum = sum_of_plan(run, mission, forecaster, what);
    const Prediction energy = forecaster.energy(sum), duration = forecaster.duration(sum);
    const auto inside = [](const Prediction& p, double value) {
      return value >= p.quantile(0.05) && value <= p.quantile(0.95);
    };
    RowCoverage& counted = coverage.rows[row];
    counted.energy_error.push_back(mission.true_j / energy.quantile(0.5) - 1);
    counted.duration_error.push_back(mission.duration_s / duration.quantile(0.5) - 1);
    counted.energy_width += (energy.quantile(0.95) - energy.quantile(0.05)) / energy.quantile(0.5);
    counted.energy_inside += inside(energy, mission.true_j);
    counted.duration_inside += inside(duration, mission.duration_s);
    for (const double share : {0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2}) {
      const double budget_j = share * energy.quantile(0.5), stated = energy.probability_below(budget_j);
      const bool is_known = forecaster.missions >= 5 && !row.starts_with("first payload");
      StatedChances& chances =
          (is_known ? coverage.known
                    : coverage.little_known)[std::min<std::size_t>(9, static_cast<std::size_t>(10 * stated))];
      ++chances.count;
      chances.sum += stated;
      chances.held += mission.true_j <= budget_j;
    }
  }

  ForeignCoverage coverage;
};

std::string after(const char* what, std::size_t count) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%s, after %2zu", what, count);
  return text.data();
}

void count_kind(std::uint64_t seed, bool exact, Counting& counting) {
  const std::vector<RobotRun> runs = run_foreign_kind(seed, exact, robots, missions);
  std::vector<std::array<OwnFinding, subject_count>> findings;
  for (const RobotRun& run : runs) {
    const auto asked = std::span(run.missions).subspan(learnt);
    RobotForecast forecast(run.robot, run.drive), empty(run.robot, run.drive);
    std::size_t empty_missions = 0;
    for (std::size_t k = 0; k < learnt; ++k) {
      forecast.learn(run.missions[k].past);
      if (!loaded(run.missions[k]) && empty_missions++ < most_empty) empty.learn(run.missions[k].past);
      if (k + 1 == lent) findings.push_back(forecast.findings());
      if (constexpr std::array<std::size_t, 5> at{1, 2, 5, 10, learnt}; std::ranges::count(at, k + 1) == 0)
        continue;
      const auto now = forecast.forecaster();
      for (const DrivenMission& mission : asked) {
        counting.ask(run, mission, *now, Stated::ways, after("ways", k + 1));
        counting.ask(run, mission, *now, Stated::cruises, after("cruises, halts", k + 1));
        counting.ask(run, mission, *now, Stated::all,
                     after(exact ? "all, driven so" : "all, driven otherwise", k + 1));
      }
    }
    for (const DrivenMission& mission : run.missions) {
      if (!loaded(mission)) continue;
      counting.ask(run, mission, *empty.forecaster(), Stated::ways, "first payload, ways");
      counting.ask(run, mission, *empty.forecaster(), Stated::all, "first payload, all");
    }
  }
  for (std::size_t r = 0; r < runs.size(); ++r) {
    std::array<Siblings, subject_count> siblings;
    for (std::size_t s = 0; s < subject_count; ++s) {
      std::vector<const OwnFinding*> others;
      for (std::size_t other = 0; other < runs.size(); ++other)
        if (other != r) others.push_back(&findings[other][s]);
      siblings[s] = pool(static_cast<Subject>(s), others);
    }
    RobotForecast cold(runs[r].robot, runs[r].drive);
    cold.set_siblings(std::move(siblings));
    const auto now = cold.forecaster();
    for (const DrivenMission& mission : std::span(runs[r].missions).subspan(learnt)) {
      counting.ask(runs[r], mission, *now, Stated::ways, "by siblings, ways");
      counting.ask(runs[r], mission, *now, Stated::all, "by siblings, all");
    }
  }
}

}  // namespace

ForeignCoverage foreign_coverage(std::uint64_t seed, std::size_t kinds) {
  Counting counting;
  for (std::size_t kind = 0; kind < kinds; ++kind) count_kind(seed + kind, kind % 2 == 0, counting);
  return std::move(counting.coverage);
}

}  // namespace joulecast::forecast
