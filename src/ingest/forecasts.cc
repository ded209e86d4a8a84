#include "ingest/forecasts.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/try.h"
#include "forecast/correction.h"
#include "robot/robot_fields.h"

namespace joulecast::ingest {
namespace {

using forecast::subject_count;
using Json = nlohmann::json;

constexpr std::size_t most_lenders = 20;

// Digits beyond the fifth are noise, and cost space.
double shortened(double value) {
  constexpr double nothing = 1e-200;
  if (std::fabs(value) < nothing) return 0;
  if (!std::isfinite(value)) return value;
  const double scale = std::pow(10.0, 4 - std::floor(std::log10(std::fabs(value))));
  return std::round(value * scale) / scale;
}

// The present estimate of the charge, above the robot file's reserve. NaN: unknown.
forecast::Charge live_charge(const RobotSnapshot& live, const robot::Battery& battery) {
  const double deviation = live.charge.estimate.sd;
  return {live.state_of_charge, std::isfinite(deviation) ? deviation : 0, battery.reserve_fraction};
}

}  // namespace

struct Forecasts::Entry {
  std::mutex mutex;
  std::string robot_id;
  std::string kind;
  std::shared_ptr<const ModelInForce> model;
  std::unique_ptr<forecast::RobotForecast> forecast;
  std::deque<forecast::PastMission> kept;
  bool is_read = false;  // what is kept was read from the store
  std::optional<drift::Mark> change;
  std::int64_t borrowed_at = -1;  // the kind's missions when its findings were pooled
  RobotOutlook outlook;

  // Its typical driving, valid while its inputs are unchanged.
  struct Typical {
    std::shared_ptr<const forecast::Forecaster> forecaster;
    double payload_kg = 0;
    forecast::TypicalDriving driving;
  };
  Typical typical;
};

Forecasts::Forecasts(const history::Store& store) : store_(store) {}
Forecasts::~Forecasts() = default;

std::string legs_json(const std::deque<forecast::PastMission>& missions) {
  Json document = Json::array();
  for (const forecast::PastMission& mission : missions) {
    Json legs = Json::array();
    for (const forecast::Leg& leg : mission.legs) {
      legs.push_back({static_cast<int>(leg.motion), shortened(leg.duration_s), shortened(leg.way),
                      shortened(leg.speed), shortened(leg.curvature_1_m), shortened(leg.payload_kg),
                      shortened(leg.battery_j)});
      if (leg.planned_way > 0)
        for (const double planned : {leg.planned_way, leg.planned_speed, leg.planned_s})
          legs.back().push_back(shortened(planned));
    }
    document.push_back({mission.start_utime_us, std::move(legs)});
  }
  return document.dump();
}

std::optional<std::deque<forecast::PastMission>> legs_from_json(const std::string& text) {
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_array()) return std::nullopt;
  std::deque<forecast::PastMission> missions;
  try {
    for (const Json& entry : document) {
      forecast::PastMission mission{entry.at(0).get<std::int64_t>(), {}};
      for (const Json& leg : entry.at(1)) {
        const int motion = leg.at(0).get<int>();
        if (motion < 0 || motion >= static_cast<int>(forecast::motion_count)) return std::nullopt;
        const auto number = [&](std::size_t k) { return leg.at(k).get<double>(); };
        const auto planned = [&](std::size_t k) { return leg.size() > k ? number(k) : 0.0; };
        mission.legs.push_back({static_cast<forecast::Motion>(motion), number(1), number(2), number(3),
                                number(4), number(5), number(6), planned(7), planned(8), planned(9)});
      }
      missions.push_back(std::move(mission));
    }
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return missions;
}

Forecasts::Entry& Forecasts::entry(const std::string& robot_id) {
  const std::lock_guard lock(mutex_);
  auto& slot = entries_[robot_id];
  if (slot == nullptr) {
    slot = std::make_unique<Entry>();
    slot->robot_id = robot_id;
  }
  return *slot;
}

Result<void> Forecasts::read(const std::shared_ptr<const ModelInForce>& model) {
  if (model == nullptr) return {};
  Entry& slot = entry(model->robot.robot_id);
  const auto is_read = [&slot] {
    const std::lock_guard lock(slot.mutex);
    return slot.is_read;
  };
  if (is_read()) return {};
  TRY_ASSIGN(const auto stored, store_.learned(slot.robot_id, topic));
  auto missions = stored ? legs_from_json(stored->body_json) : std::nullopt;
  const std::lock_guard lock(slot.mutex);
  slot.is_read = true;
  slot.kept = std::move(missions).value_or(std::deque<forecast::PastMission>{});
  slot.model.reset();
  slot.forecast.reset();
  bring_up(slot, model);
  return {};
}

// Requires the entry's lock. The entry then uses this model and the legs that are kept.
void Forecasts::bring_up(Entry& entry, const std::shared_ptr<const ModelInForce>& model) {
  if (entry.model == model) return;
  const bool first = entry.forecast == nullptr;
  entry.model = model;
  entry.kind = robot::kind_of(model->robot);
  entry.outlook.model = model;
  entry.outlook.battery = answers::charge_map(model->robot.battery);
  if (first) {
    begin(entry);
    for (const forecast::PastMission& mission : entry.kept) entry.forecast->learn(mission);
  } else {
    entry.forecast->set_model(model->robot, model->drive);
  }
  lend(entry);
  borrow(entry);
}

// A forecast that has learned from no mission yet.
void Forecasts::begin(Entry& entry) {
  entry.forecast = std::make_unique<forecast::RobotForecast>(entry.model->robot, entry.model->drive);
  entry.forecast->set_change(entry.change);
  entry.borrowed_at = -1;
  borrow(entry);
}

void Forecasts::lend(Entry& entry) {
  entry.outlook.forecaster = entry.forecast->forecaster();
  auto found =
      std::make_shared<const std::array<forecast::OwnFinding, subject_count>>(entry.forecast->findings());
  const std::lock_guard lock(mutex_);
  Kind& kind = kinds_[entry.kind];
  auto& slot = kind.findings[entry.robot_id];
  kind.missions += (*found)[0].missions - (slot != nullptr ? (*slot)[0].missions : 0);
  slot = std::move(found);
}

void Forecasts::borrow(Entry& entry) {
  std::vector<std::shared_ptr<const std::array<forecast::OwnFinding, subject_count>>> lenders;
  {
    const std::lock_guard lock(mutex_);
    Kind& kind = kinds_[entry.kind];
    // The findings are pooled again after a tenth more missions.
    const std::int64_t news = kind.missions - entry.borrowed_at;
    if (entry.borrowed_at >= 0 && 10 * news <= entry.borrowed_at) return;
    entry.borrowed_at = kind.missions;
    for (const auto& [id, finding] : kind.findings)
      if (id != entry.robot_id && (*finding)[0].missions > 0) lenders.push_back(finding);
  }
  const std::size_t count = std::min(lenders.size(), most_lenders);
  std::ranges::partial_sort(lenders, lenders.begin() + static_cast<std::ptrdiff_t>(count),
                            std::ranges::greater{}, [](const auto& l) { return (*l)[0].missions; });
  lenders.resize(count);
  std::array<forecast::Siblings, subject_count> siblings;
  for (std::size_t k = 0; k < subject_count; ++k) {
    std::vector<const forecast::OwnFinding*> others;
    for (const auto& lender : lenders) others.push_back(&(*lender)[k]);
    siblings[k] = forecast::pool(static_cast<forecast::Subject>(k), others);
  }
  entry.forecast->set_siblings(std::move(siblings));
  entry.outlook.forecaster = entry.forecast->forecaster();
}

forecast::Reach Forecasts::reach(const std::shared_ptr<const ModelInForce>& model,
                                 const RobotSnapshot& live) {
  (void)read(model);
  return live_reach(model, live);
}

forecast::Reach Forecasts::live_reach(const std::shared_ptr<const ModelInForce>& model,
                                      const RobotSnapshot& live) {
  constexpr double nan = signals::unmeasured;
  const forecast::Charge charge = live_charge(live, model->robot.battery);
  if (!std::isfinite(charge.fraction)) return {nan, nan, nan, nan, {nan, nan, nan}, {nan, nan, nan}};
  const bool heard = live.sample.utime_us != 0 && std::isfinite(live.sample.payload_kg);
  const double payload_kg = heard ? live.sample.payload_kg : 0;
  Entry& slot = entry(model->robot.robot_id);
  const std::lock_guard lock(slot.mutex);
  bring_up(slot, model);
  borrow(slot);
  const std::shared_ptr<const forecast::Forecaster>& forecaster = slot.outlook.forecaster;
  if (slot.typical.forecaster != forecaster || slot.typical.payload_kg != payload_kg) {
    const forecast::LegPricer pricer(model->robot, model->drive);
    slot.typical = {forecaster, payload_kg, forecast::typical_driving(*forecaster, pricer, {}, payload_kg)};
  }
  return forecast::reach(*forecaster, *slot.outlook.battery, charge, slot.typical.driving);
}

RobotOutlook Forecasts::of(std::shared_ptr<const ModelInForce> model) {
  (void)read(model);
  Entry& slot = entry(model->robot.robot_id);
  const std::lock_guard lock(slot.mutex);
  bring_up(slot, model);
  borrow(slot);
  slot.outlook.siblings_pending = siblings_pending_;
  return slot.outlook;
}

history::Learned Forecasts::learn(const std::shared_ptr<const ModelInForce>& model,
                                  forecast::PastMission mission) {
  Entry& slot = entry(model->robot.robot_id);
  const std::lock_guard lock(slot.mutex);
  bring_up(slot, model);
  borrow(slot);
  std::erase_if(mission.legs, [](const forecast::Leg& leg) { return !std::isfinite(leg.battery_j); });
  (void)drop(slot, mission.start_utime_us);  // of a log that is replayed again
  slot.forecast->learn(mission);
  if (!mission.legs.empty()) slot.kept.push_back(std::move(mission));
  while (slot.kept.size() > kept_missions) slot.kept.pop_front();
  lend(slot);
  return document_of(slot);
}

void Forecasts::set_change(const std::string& robot_id, const std::optional<drift::Mark>& change) {
  Entry& slot = entry(robot_id);
  const std::lock_guard lock(slot.mutex);
  slot.change = change;
  if (slot.forecast == nullptr) return;
  slot.forecast->set_change(change);
  lend(slot);
}

void Forecasts::learnt_elsewhere(const std::string& robot_id) {
  Entry* slot = nullptr;
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(robot_id);
    if (found == entries_.end()) return;
    slot = found->second.get();
  }
  const std::lock_guard lock(slot->mutex);
  slot->is_read = false;
}

history::Learned Forecasts::document_of(const Entry& entry) {
  return {entry.robot_id, std::string(topic), entry.kept.empty() ? 0 : entry.kept.back().start_utime_us,
          legs_json(entry.kept)};
}

// Whether the mission was kept; the forecast is then trained on the others.
bool Forecasts::drop(Entry& entry, std::int64_t start_utime_us) {
  const auto is_it = [&](const forecast::PastMission& m) { return m.start_utime_us == start_utime_us; };
  if (std::erase_if(entry.kept, is_it) == 0) return false;
  begin(entry);
  for (const forecast::PastMission& mission : entry.kept) entry.forecast->learn(mission);
  return true;
}

std::optional<history::Learned> Forecasts::forget(const std::shared_ptr<const ModelInForce>& model,
                                                  std::int64_t start_utime_us) {
  (void)read(model);
  Entry& slot = entry(model->robot.robot_id);
  const std::lock_guard lock(slot.mutex);
  bring_up(slot, model);
  if (!drop(slot, start_utime_us)) return std::nullopt;
  lend(slot);
  return document_of(slot);
}

}  // namespace joulecast::ingest
