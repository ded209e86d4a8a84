#include "forecast/outlook.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <utility>

#include "planning/numerics.h"

namespace joulecast::forecast {
namespace {

constexpr double normal_95 = 1.6448536269514722;
constexpr std::array<double, 3> normal_quantile{-normal_95, 0, normal_95};
constexpr double plain_drive_m = 10;  // used as a robot's leg while it has none
constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();

// Energy that a plan may take from the battery, and its standard deviation.
struct Budget {
  double energy_j = 0;
  double deviation_j = 0;
};

double mean_power(const Forecaster& forecaster, const PlanSum& sum, double energy_j) {
  const double duration_s = forecaster.duration(sum).expected();
  return duration_s > 0 ? energy_j / duration_s : 0;
}

double lowest_charge(const ChargeMap& battery, const Charge& charge, double power_w) {
  return std::max(charge.reserve, battery.cutoff_charge(power_w));
}

Budget budget(const ChargeMap& battery, const Charge& charge, double lowest, double power_w) {
  const double energy_j = battery.energy_j(charge.fraction, lowest, power_w);
  return {energy_j, std::hypot(charge.deviation * battery.slope_j(charge.fraction, power_w),
                               battery.relative_deviation() * std::max(0.0, energy_j))};
}

// Quantiles of a sum of independent parts, from each one's own: exact for normals, and close where one
// dominates.
double joined(double middle, double sign, std::initializer_list<double> offsets) {
  double squares = 0;
  for (const double offset : offsets) squares += offset * offset;
  return middle + sign * std::sqrt(squares);
}

TaskOutlook stage(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge, double lowest,
                  const PlanSum& sum) {
  const Prediction p = forecaster.energy(sum);
  const double power = mean_power(forecaster, sum, p.expected());
  const Budget spend = budget(battery, charge, lowest, power);
  TaskOutlook out;
  out.duration_s = forecaster.duration(sum).quantile(0.5);
  out.probability = p.probability_below(spend.energy_j, spend.deviation_j);
  for (std::size_t k = 0; k < stated_quantiles.size(); ++k) out.energy_j[k] = p.quantile(stated_quantiles[k]);
  out.charge = arrival_charge(p, battery, charge, power);
  return out;
}

// The longest wait after which the plan still keeps the reserve with the confidence.
double longest_wait(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
                    double lowest, const PlanSum& plan, double standing_w, double confidence) {
  const auto holds = [&](double wait_s) {
    PlanSum waited = plan;
    forecaster.extend(waited, {Motion::stand, 0, 0, {wait_s, standing_w * wait_s, 0, 0}});
    const Prediction p = forecaster.energy(waited);
    const Budget spend = budget(battery, charge, lowest, mean_power(forecaster, waited, p.expected()));
    return p.probability_below(spend.energy_j, spend.deviation_j) >= confidence;
  };
  if (!(standing_w > 0)) return std::numeric_limits<double>::infinity();
  return planning::last_that(holds, 0, 1.2 * battery.energy_j(1, 0, standing_w) / standing_w, 16);
}

constexpr std::size_t steps = 200;

}  // namespace

ChargeMap::ChargeMap(const battery::Circuit& circuit) : circuit_(circuit), stored_j_(steps + 1, 0.0) {
  const double h = 1.0 / static_cast<double>(steps), coulombs = 3600 * circuit_.capacity_ah();
  for (std::size_t k = 0; k < steps; ++k) {
    const double s = h * static_cast<double>(k);
    stored_j_[k + 1] =
        stored_j_[k] +
        coulombs * h * 0.5 * (circuit_.open_circuit_voltage_v(s) + circuit_.open_circuit_voltage_v(s + h));
  }
}

double ChargeMap::stored_j(double charge) const {
  const double coulombs = 3600 * circuit_.capacity_ah();
  if (charge <= 0) return coulombs * charge * circuit_.open_circuit_voltage_v(0);
  if (charge >= 1) return stored_j_.back() + coulombs * (charge - 1) * circuit_.open_circuit_voltage_v(1);
  const double at = charge * static_cast<double>(steps);
  const auto k = std::min(static_cast<std::size_t>(at), steps - 1);
  return std::lerp(stored_j_[k], stored_j_[k + 1], at - static_cast<double>(k));
}

double ChargeMap::share(double charge, double mean_power_w) const {
  const battery::State state = battery::Circuit::rested(std::clamp(charge, 0.02, 1.0));
  const double open = circuit_.inner_voltage_v(state);
  const double resistance = circuit_.ohmic_resistance_ohm(state) + circuit_.branch_resistance_ohm(0, state) +
                            circuit_.branch_resistance_ohm(1, state);
  const double left = 1 - 4 * resistance * mean_power_w / (open * open);
  return 0.5 * (1 + std::sqrt(std::max(0.0, left)));
}

double ChargeMap::energy_j(double from, double to, double mean_power_w) const {
  return share(std::max(from, to), mean_power_w) * (stored_j(from) - stored_j(to));
}

double ChargeMap::charge_after(double from, double energy_j, double mean_power_w) const {
  const double wanted = stored_j(from) - energy_j / share(from, mean_power_w);
  const double coulombs = 3600 * circuit_.capacity_ah();
  if (wanted <= 0) return wanted / (coulombs * circuit_.open_circuit_voltage_v(0));
  if (wanted >= stored_j_.back())
    return 1 + (wanted - stored_j_.back()) / (coulombs * circuit_.open_circuit_voltage_v(1));
  const auto above = std::ranges::upper_bound(stored_j_, wanted);
  const auto k = static_cast<std::size_t>(above - stored_j_.begin()) - 1;
  return (static_cast<double>(k) + (wanted - stored_j_[k]) / (stored_j_[k + 1] - stored_j_[k])) /
         static_cast<double>(steps);
}

double ChargeMap::cutoff_charge(double mean_power_w) const {
  const auto above_cutoff = [&](double charge) {
    const battery::State state = battery::Circuit::rested(charge);
    return share(charge, mean_power_w) * circuit_.inner_voltage_v(state) > circuit_.cutoff_voltage_v();
  };
  if (above_cutoff(0)) return 0;
  return 1 - planning::last_that([&](double used) { return above_cutoff(1 - used); }, 0, 1, 20);
}

double ChargeMap::slope_j(double charge, double mean_power_w) const {
  return 3600 * circuit_.capacity_ah() * circuit_.open_circuit_voltage_v(charge) *
         share(charge, mean_power_w);
}

std::array<double, 3> arrival_charge(const Prediction& prediction, const ChargeMap& battery,
                                     const Charge& charge, double mean_power_w) {
  std::array<double, 3> out;
  for (std::size_t k = 0; k < stated_quantiles.size(); ++k)
    out[k] =
        battery.charge_after(charge.fraction, prediction.quantile(1 - stated_quantiles[k]), mean_power_w);
  const double middle = out[1];
  const double deviation =
      std::hypot(charge.deviation, battery.relative_deviation() * (charge.fraction - middle));
  for (std::size_t k = 0; k < stated_quantiles.size(); ++k)
    out[k] =
        joined(middle, stated_quantiles[k] < 0.5 ? -1 : 1, {out[k] - middle, normal_quantile[k] * deviation});
  for (double& c : out) c = std::clamp(c, 0.0, 1.0);
  return out;
}

void extend(PlanSum& sum, const Forecaster& forecaster, std::span<const PricedLeg> legs) {
  for (const PricedLeg& leg : legs) forecaster.extend(sum, leg);
}

PlanSum sum_of(const Forecaster& forecaster, std::span<const PricedLeg> legs) {
  PlanSum sum;
  extend(sum, forecaster, legs);
  return sum;
}

bool states_halts(std::span<const PlannedLeg> legs) {
  return std::ranges::any_of(legs, [](const PlannedLeg& leg) { return leg.motion == Motion::stand; });
}

std::vector<PricedLeg> price(const Forecaster& forecaster, const LegPricer& pricer,
                             std::span<const PlannedLeg> legs, const StatedPace& stated, bool halts_stated) {
  const Habit habit = forecaster.habit.with(stated);
  std::vector<PricedLeg> priced;
  priced.reserve(legs.size());
  for (const PlannedLeg& leg : legs) {
    const bool moving = leg.motion != Motion::stand;
    priced.push_back({leg.motion, leg.payload_kg, leg.motion == Motion::drive ? leg.way : 0,
                      pricer.usual(leg, habit),
                      stated.whole(leg.motion)    ? Driving::stated
                      : stated.cruise(leg.motion) ? Driving::paced
                                                  : Driving::usual,
                      moving && !halts_stated && !stated.whole(leg.motion)});
  }
  return priced;
}

std::optional<Error> obstacle(const LegPricer& pricer, std::span<const PlannedLeg> legs,
                              std::span<const PricedLeg> priced) {
  const auto stuck = std::ranges::find_if(priced, [](const PricedLeg& leg) { return leg.cost.impossible; });
  if (stuck == priced.end()) return std::nullopt;
  return pricer.obstacle(legs[static_cast<std::size_t>(stuck - priced.begin())]);
}

std::vector<PlannedLeg> typical_legs(const Forecaster& forecaster, double payload_kg) {
  std::vector<PlannedLeg> legs;
  for (const Leg& leg : forecaster.typical)
    legs.push_back({leg.motion, leg.way, leg.curvature_1_m, payload_kg, leg.duration_s});
  if (legs.empty()) legs.push_back({Motion::drive, plain_drive_m, 0, payload_kg, 0});
  return legs;
}

TypicalDriving typical_driving(const Forecaster& forecaster, std::vector<PricedLeg> legs) {
  TypicalDriving typical;
  std::vector<std::array<double, 3>> amounts;  // energy, way and duration of each leg
  std::array<double, 3> all{};
  for (PricedLeg& leg : legs) {
    leg.may_halt = true;
    forecaster.extend(typical.sum, leg);
    PlanSum one;
    forecaster.extend(one, leg);
    amounts.push_back({forecaster.energy(one).expected(), one.way_m, forecaster.duration(one).expected()});
    for (std::size_t k = 0; k < all.size(); ++k) all[k] += amounts.back()[k];
  }
  for (const auto& [energy_j, way_m, duration_s] : amounts) {
    typical.way_error = std::hypot(typical.way_error, way_m / all[1] - energy_j / all[0]);
    typical.duration_error = std::hypot(typical.duration_error, duration_s / all[2] - energy_j / all[0]);
  }
  return typical;
}

TypicalDriving typical_driving(const Forecaster& forecaster, const LegPricer& pricer,
                               const StatedPace& stated, double payload_kg) {
  return typical_driving(forecaster,
                         price(forecaster, pricer, typical_legs(forecaster, payload_kg), stated, false));
}

double probability_of_reserve(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
                              const PlanSum& plan) {
  const Prediction p = forecaster.energy(plan);
  const double power = mean_power(forecaster, plan, p.expected());
  const Budget spend = budget(battery, charge, lowest_charge(battery, charge, power), power);
  return p.probability_below(spend.energy_j, spend.deviation_j);
}

QuickSuccess::QuickSuccess(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
                           double standing_w, double mean_power_w)
    : forecaster_(&forecaster), standing_w_(standing_w) {
  const Budget spend = budget(battery, charge, lowest_charge(battery, charge, mean_power_w), mean_power_w);
  budget_j_ = spend.energy_j;
  deviation_j_ = spend.deviation_j;
}

double QuickSuccess::probability(double energy_j, double duration_s, double loaded_j, double loaded_s,
                                 double payload_kg) const {
  constexpr double legs = 4;
  const LegCost stand{duration_s, standing_w_ * duration_s, 0, 0};
  LegCost empty, loaded;
  loaded.motor_j = loaded_j - standing_w_ * loaded_s;
  empty.motor_j = energy_j - stand.standing_j - loaded.motor_j;
  constexpr double usual_speed = 0.6;  // of the limit, where the correction's part for speed is zero
  empty.speed_fraction = loaded.speed_fraction = usual_speed;
  PlanSum sum;
  forecaster_->extend(sum, {Motion::stand, 0, 0, stand});
  for (const auto& [part, payload] : {std::pair{&empty, 0.0}, std::pair{&loaded, payload_kg}}) {
    part->motor_j /= legs / 2;
    forecaster_->extend(sum, {Motion::drive, payload, 0, *part}, legs / 2);
  }
  return forecaster_->energy(sum).probability_below(budget_j_, deviation_j_);
}

Outlook look_ahead(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
                   std::span<const PricedTask> tasks, std::span<const PricedLeg> from_here, double standing_w,
                   double confidence) {
  Outlook out;
  out.charger_given = !from_here.empty() || (!tasks.empty() && !tasks.front().to_charger.empty());
  std::vector<PlanSum> sums(tasks.size() + 1);  // by the number of finished tasks
  for (std::size_t k = 0; k < tasks.size(); ++k) {
    sums[k + 1] = sums[k];
    extend(sums[k + 1], forecaster, tasks[k].legs);
  }
  PlanSum whole = sums.back();
  if (out.charger_given) extend(whole, forecaster, tasks.empty() ? from_here : tasks.back().to_charger);
  const Prediction all = forecaster.energy(whole);
  const double lowest = lowest_charge(battery, charge, mean_power(forecaster, whole, all.expected()));

  double expected_before = 0, probability_before = 1, worst = 0;
  const auto note = [&](TaskOutlook& stage_outlook, const PlanSum& sum, std::size_t index) {
    stage_outlook = stage(forecaster, battery, charge, lowest, sum);
    const double expected = forecaster.energy(sum).expected();
    stage_outlook.mean_j = expected - expected_before;
    expected_before = expected;
    // Energy only grows along the way, so a reserve once broken stays broken.
    stage_outlook.probability = std::min(stage_outlook.probability, probability_before);
    if (const double lost = probability_before - stage_outlook.probability; lost > worst) {
      worst = lost;
      out.likeliest_failure = index;
    }
    if (stage_outlook.probability < 0.5 && !out.fails_at) out.fails_at = index;
    probability_before = stage_outlook.probability;
  };
  out.tasks.resize(tasks.size());
  for (std::size_t k = 0; k < tasks.size(); ++k) note(out.tasks[k], sums[k + 1], k);
  if (out.charger_given) note(out.charger.emplace(), whole, tasks.size());
  out.mean_j = all.expected();
  for (std::size_t k = 0; k < stated_quantiles.size(); ++k)
    out.energy_j[k] = all.quantile(stated_quantiles[k]);
  const Prediction duration = forecaster.duration(whole);
  for (std::size_t k = 0; k < stated_quantiles.size(); ++k)
    out.duration_s[k] = duration.quantile(stated_quantiles[k]);
  out.probability = probability_before;
  if (tasks.empty() && !out.charger_given)
    out.probability = probability_of_reserve(forecaster, battery, charge, whole);

  if (!out.charger_given) return out;
  std::optional<PlanSum> leaving;
  for (std::size_t k = 0; k <= tasks.size(); ++k) {
    PlanSum plan = sums[k];
    extend(plan, forecaster, k == 0 ? from_here : tasks[k - 1].to_charger);
    const Prediction p = forecaster.energy(plan);
    const Budget spend = budget(battery, charge, lowest, mean_power(forecaster, plan, p.expected()));
    const double probability = p.probability_below(spend.energy_j, spend.deviation_j);
    if (probability < confidence) break;
    out.latest_departure = Departure{k, forecaster.duration(sums[k]).quantile(0.5), 0, probability};
    leaving = plan;
  }
  if (leaving)
    out.latest_departure->wait_s =
        longest_wait(forecaster, battery, charge, lowest, *leaving, standing_w, confidence);
  return out;
}

Reach reach(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
            const TypicalDriving& typical) {
  PlanSum sum = typical.sum;
  Prediction energy = forecaster.energy(sum);
  Reach out;
  out.energy_per_m_j = nowhere;
  const double power_w = mean_power(forecaster, sum, energy.expected());
  const Budget spend = budget(battery, charge, lowest_charge(battery, charge, power_w), power_w);
  out.usable_j = std::max(0.0, spend.energy_j);
  out.usable_deviation_j = spend.deviation_j;
  if (sum.impossible) {
    out.range_m.fill(nowhere);
    out.run_time_s.fill(nowhere);
    out.mean_power_w = nowhere;
  }
  if (sum.impossible || !(energy.expected() > 0)) return out;
  // As often as the charge lasts: the legs' own scatter averages out, their common deviation does not.
  sum.repeat(std::max(1.0, out.usable_j / energy.expected()));
  energy = forecaster.energy(sum);
  Prediction duration = forecaster.duration(sum);
  // Halts lengthen both: their part of the uncertainty is not independent.
  const double halted_j = std::sqrt(energy.halts.variance()) / energy.expected(),
               halted_s = std::sqrt(duration.halts.variance()) / duration.expected();
  for (Prediction* part : {&energy, &duration}) {
    part->fixed += part->halts.mean();
    part->halts = {};
  }
  const double energy_j = energy.quantile(0.5), duration_s = duration.quantile(0.5);
  const double way_m = sum.way_m > 0 ? sum.way_m : nowhere, times = out.usable_j / energy_j;
  out.mean_power_w = energy_j / duration_s;
  out.energy_per_m_j = energy_j / way_m;
  for (std::size_t k = 0; k < stated_quantiles.size(); ++k) {
    const double q = stated_quantiles[k], z = normal_quantile[k], sign = q < 0.5 ? -1 : 1;
    const double by_energy = energy_j / energy.quantile(1 - q) - 1,
                 by_time = duration.quantile(q) / duration_s - 1,
                 by_charge = out.usable_j > 0 ? z * out.usable_deviation_j / out.usable_j : 0;
    const auto share = [&](std::initializer_list<double> offsets) {
      return std::max(0.0, joined(1, sign, offsets));
    };
    out.range_m[k] = way_m * times * share({by_energy, by_charge, z * halted_j, z * typical.way_error});
    out.run_time_s[k] =
        duration_s * times *
        share({by_energy, by_charge, by_time, z * (halted_s - halted_j), z * typical.duration_error});
  }
  return out;
}

}  // namespace joulecast::forecast
