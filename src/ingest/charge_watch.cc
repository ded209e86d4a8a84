#include "ingest/charge_watch.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <tuple>
#include <utility>

namespace joulecast::battery {

inline void to_json(nlohmann::json& document, const Seen& seen) {
  document = {seen.count, seen.mean, seen.variance};
}

inline void from_json(const nlohmann::json& document, Seen& seen) {
  std::tie(seen.count, seen.mean, seen.variance) = document.get<std::tuple<double, double, double>>();
}

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ChargingHabit, current_a, taper_charge, taper_time_s, end_current_a)

}  // namespace joulecast::battery

namespace joulecast::ingest {
namespace {

using Json = nlohmann::json;

constexpr double standing_rad_s = 0.05;  // encoders of a robot at rest read less

bool moves(const signals::Sample& sample) {
  return std::fabs(sample.wheel_velocity_rad_s[0]) > standing_rad_s ||
         std::fabs(sample.wheel_velocity_rad_s[1]) > standing_rad_s;
}

}  // namespace

std::size_t drop_charging(double capacity_ah, std::vector<signals::Sample>& samples) {
  using battery::ChargingPhase;
  battery::ChargingObserver charging(capacity_ah);
  std::vector<signals::Sample> kept, undecided;
  kept.reserve(samples.size());
  const auto keep_undecided = [&] {
    kept.insert(kept.end(), undecided.begin(), undecided.end());
    undecided.clear();
  };
  for (const signals::Sample& s : samples) {
    const ChargingPhase phase =
        charging.add({s.utime_us, s.battery_voltage_v, s.battery_current_a, moves(s), signals::unmeasured});
    if (phase == ChargingPhase::suspected) {
      undecided.push_back(s);
    } else if (charging.charging()) {
      undecided.clear();
    } else {
      keep_undecided();
      kept.push_back(s);
    }
  }
  keep_undecided();
  const std::size_t dropped = samples.size() - kept.size();
  samples = std::move(kept);
  return dropped;
}

ChargeWatch::ChargeWatch(const robot::RobotModel& robot)
    : tracker_(robot.battery, robot.idle_power_w),
      charging_(robot.battery.capacity_ah * robot.battery.ageing_factor.value_or(1)) {}

ChargeWatch::Share ChargeWatch::add(const signals::Sample& sample, double modelled_power_w) {
  utime_us_ = sample.utime_us;
  tracker_.add({sample.utime_us, sample.battery_voltage_v, sample.battery_current_a, modelled_power_w});
  const bool was_full = charging_.phase() == battery::ChargingPhase::full;
  const battery::ChargingPhase phase =
      charging_.add({sample.utime_us, sample.battery_voltage_v, sample.battery_current_a, moves(sample),
                     tracker_.estimate().charge});
  if (phase == battery::ChargingPhase::full && !was_full) tracker_.observe_full();
  if (phase == battery::ChargingPhase::suspected) return Share::undecided;
  return charging_.charging() ? Share::charger : Share::robot;
}

ChargeView ChargeWatch::view() const {
  ChargeView out;
  out.estimate = tracker_.estimate();
  out.phase = charging_.phase();
  out.stay = charging_.stay();
  out.habit = charging_.habit();
  out.to_full = charging_.charging()
                    ? charging_.remaining(out.estimate.charge, out.estimate.sd)
                    : battery::time_to_full(out.habit, tracker_.filter().circuit().capacity_ah(),
                                            out.estimate.charge, out.estimate.sd);
  return out;
}

std::string ChargeWatch::memory_json() const {
  Json document;
  if (const auto memory = tracker_.memory()) {
    const auto& [mean, covariance, known] = memory->filter;
    Json lower = Json::array();
    for (Eigen::Index row = 0; row < covariance.rows(); ++row)
      for (Eigen::Index column = 0; column <= row; ++column) lower.push_back(covariance(row, column));
    document["filter"] = {{"utime_us", memory->utime_us},
                          {"known", known},
                          {"mean", std::vector(mean.begin(), mean.end())},
                          {"covariance", std::move(lower)}};
  }
  document["habit"] = charging_.habit();
  return document.dump();
}

void ChargeWatch::recall(const std::string& text) {
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_object()) return;
  try {
    charging_.recall(document.at("habit").get<battery::ChargingHabit>());
    if (!document.contains("filter")) return;
    const Json& filter = document.at("filter");
    battery::ChargeTracker::Memory memory;
    auto& [mean, covariance, known] = memory.filter;
    memory.utime_us = filter.at("utime_us").get<std::int64_t>();
    known = filter.at("known").get<bool>();
    std::size_t k = 0;
    for (Eigen::Index row = 0; row < covariance.rows(); ++row) {
      mean[row] = filter.at("mean").at(static_cast<std::size_t>(row)).get<double>();
      for (Eigen::Index column = 0; column <= row; ++column, ++k)
        covariance(row, column) = covariance(column, row) = filter.at("covariance").at(k).get<double>();
    }
    if (tracker_.recall(memory)) utime_us_ = memory.utime_us;
  } catch (const Json::exception&) {
    // Written by another version: the charge is estimated again from the voltage.
  }
}

void ChargeWatch::recall(std::int64_t utime_us, double charge) {
  auto memory = tracker_.memory();
  if (!std::isfinite(charge)) return;
  if (!memory) {
    memory = battery::ChargeTracker::Memory{tracker_.filter().memory(), utime_us};
  } else if (memory->utime_us >= utime_us) {
    return;
  }
  memory->filter.mean[0] = charge;
  memory->filter.known = true;
  memory->utime_us = utime_us;
  if (tracker_.recall(*memory)) utime_us_ = utime_us;
}

void ChargeWatch::take_over(const ChargeWatch& old) {
  if (const auto memory = old.tracker_.memory()) tracker_.recall(*memory);
  charging_.recall(old.charging_.habit());
  utime_us_ = old.utime_us_;
}

}  // namespace joulecast::ingest
