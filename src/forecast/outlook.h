#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "battery/circuit.h"
#include "forecast/leg_cost.h"
#include "forecast/robot_forecast.h"

namespace joulecast::forecast {

// Energy at the terminals against charge, for one mean power. Between charges a and b a battery holds
// 3600 C integral U(s) ds; of it the terminals give the share V/U, V being the voltage under the mean power
// with all branches settled. The ripple of the power about its mean costs r (<I^2> - <I>^2) more, which is
// neglected (below 0.5 % of the energy where r I is below 1 % of U), and V/U is taken at the charge where the
// draw begins.
class ChargeMap {
 public:
  explicit ChargeMap(const battery::Circuit& circuit);

  double reserve_fraction() const { return circuit_.reserve_fraction(); }
  const battery::Circuit& circuit() const { return circuit_; }

  // From one charge down to another [J]; negative when `to` is above `from`.
  double energy_j(double from, double to, double mean_power_w) const;
  // Charge after so much energy left; may be below 0.
  double charge_after(double from, double energy_j, double mean_power_w) const;
  // Charge at which the terminals under this power reach the cut-off voltage; 0 when they hold it to the end.
  double cutoff_charge(double mean_power_w) const;
  // Standard deviation of energy over that of the same charge, relative: of the curve's voltage, and of the
  // map's approximations.
  double relative_deviation() const { return circuit_.typical_curve() ? 0.008 : 0.004; }
  // d energy / d charge at a charge [J].
  double slope_j(double charge, double mean_power_w) const;

 private:
  double share(double charge, double mean_power_w) const;  // V/U
  double stored_j(double charge) const;                    // from empty

  battery::Circuit circuit_;
  std::vector<double> stored_j_;  // at charges k / (size - 1)
};

inline constexpr std::array<double, 3> stated_quantiles{0.05, 0.5, 0.95};

struct PricedTask {
  std::vector<PricedLeg> legs;
  std::vector<PricedLeg> to_charger;  // from where this task ends
};

// The charge that a plan may use.
struct Charge {
  double fraction = 0;
  double deviation = 0;  // standard deviation of `fraction`; 0: taken as exact
  double reserve = 0;    // to be left at the end
};

struct TaskOutlook {
  double mean_j = 0;                 // of this task alone
  double duration_s = 0;             // from now to its end, median
  double probability = 0;            // of holding the reserve to its end
  std::array<double, 3> energy_j{};  // from now, at stated_quantiles
  std::array<double, 3> charge{};    // on arrival, at stated_quantiles
};

// The last moment at which leaving for the charger still keeps the reserve with the requested confidence.
struct Departure {
  std::size_t after_tasks = 0;  // how many tasks are done first; 0: leave from here
  double at_s = 0;              // expected time from now at which they are done
  double wait_s = 0;            // that it may stand there before it leaves
  double probability = 0;       // of reaching the charger with the reserve when it leaves at `at_s`
};

struct Outlook {
  std::vector<TaskOutlook> tasks;
  std::optional<TaskOutlook> charger;  // the way to the charger after the last task
  double mean_j = 0;                   // of everything, the way to the charger included
  std::array<double, 3> energy_j{};
  std::array<double, 3> duration_s{};   // at stated_quantiles
  double probability = 0;               // of finishing everything with the reserve
  std::optional<std::size_t> fails_at;  // first task (tasks.size(): the way to the charger) likelier to break
                                        // the reserve than not
  std::optional<std::size_t> likeliest_failure;  // where the reserve is likeliest to be broken first
  std::optional<Departure> latest_departure;     // absent: not even from here, or no charger given
  bool charger_given = false;
};

// `from_here` are the legs to the charger from where the robot is, empty when no charger is given; every task
// then has its own.
Outlook look_ahead(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
                   std::span<const PricedTask> tasks, std::span<const PricedLeg> from_here, double standing_w,
                   double confidence);

// The recent moving legs of a robot, each with the halts that usually follow it, summed.
struct TypicalDriving {
  PlanSum sum;
  // Standard errors of way and duration over energy, relative, by how the legs differ.
  double way_error = 0, duration_error = 0;
};

// Range and run time of a robot that continues so: both by the legs' energies, ways, durations and halts.
struct Reach {
  double usable_j = 0;
  double usable_deviation_j = 0;
  double energy_per_m_j = 0;        // median over so long a way; NaN: its legs cover no way
  double mean_power_w = 0;          // likewise
  std::array<double, 3> range_m{};  // at stated_quantiles: the first is nearly always exceeded
  std::array<double, 3> run_time_s{};
};
Reach reach(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
            const TypicalDriving& typical);

// The robot's recent moving legs carrying another payload; a straight drive while it has none.
std::vector<PlannedLeg> typical_legs(const Forecaster& forecaster, double payload_kg);
TypicalDriving typical_driving(const Forecaster& forecaster, std::vector<PricedLeg> legs);

// At the robot's pace, where none is stated.
TypicalDriving typical_driving(const Forecaster& forecaster, const LegPricer& pricer,
                               const StatedPace& stated, double payload_kg);

// The probability that a plan ends with the reserve.
double probability_of_reserve(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
                              const PlanSum& plan);

// The same for many short plans of one robot, given by sums alone: model energies and durations of
// minimum-energy drives, split into with and without payload. The legs of a plan count as four of equal size.
class QuickSuccess {
 public:
  // `mean_power_w` is of such drives, for the cut-off.
  QuickSuccess(const Forecaster& forecaster, const ChargeMap& battery, const Charge& charge,
               double standing_w, double mean_power_w);
  double probability(double energy_j, double duration_s, double loaded_j, double loaded_s,
                     double payload_kg) const;

 private:
  const Forecaster* forecaster_;
  double standing_w_;
  double budget_j_, deviation_j_;
};

// The charge left after the predicted energy, at stated_quantiles.
std::array<double, 3> arrival_charge(const Prediction& prediction, const ChargeMap& battery,
                                     const Charge& charge, double mean_power_w);

// The legs of a plan, summed.
PlanSum sum_of(const Forecaster& forecaster, std::span<const PricedLeg> legs);
// Adds them to a plan.
void extend(PlanSum& sum, const Forecaster& forecaster, std::span<const PricedLeg> legs);

// Whether a plan states the robot's halts.
bool states_halts(std::span<const PlannedLeg> legs);

// Legs priced at the stated pace, else by the robot's habit. Where the pace is not wholly stated, a leg may
// be followed by one of the robot's usual halts, unless the plan itself states the halts.
std::vector<PricedLeg> price(const Forecaster& forecaster, const LegPricer& pricer,
                             std::span<const PlannedLeg> legs, const StatedPace& stated, bool halts_stated);
// The obstacle of the first impossible leg; empty where all can be driven.
std::optional<Error> obstacle(const LegPricer& pricer, std::span<const PlannedLeg> legs,
                              std::span<const PricedLeg> priced);

}  // namespace joulecast::forecast
