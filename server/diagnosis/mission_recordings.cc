#include "server/diagnosis/mission_recordings.h"

#include <algorithm>
#include <utility>

#include "base/try.h"
#include "ingest/charge_watch.h"

namespace joulecast::server {
namespace {

// All pages of a query of a mission's recording.
template <class Item>
Result<std::vector<Item>> all_of(const history::Store& store, history::MissionKey key,
                                 Result<history::ItemPage<Item>> (history::Store::*query)(
                                     history::MissionKey, history::TimeRange, const history::PageRequest&)
                                     const) {
  history::PageRequest page{history::max_telemetry_samples, {}};
  std::vector<Item> all;
  do {
    TRY_ASSIGN(auto got, (store.*query)(key, {}, page));
    std::ranges::move(got.items, std::back_inserter(all));
    page.cursor = std::move(got.next_cursor);
  } while (!page.cursor.empty());
  return all;
}

class Reader {
 public:
  Reader(const history::Store& store, const RecordingsWanted& wanted) : store_(store), wanted_(wanted) {}

  bool full() const { return result_.missions.size() >= wanted_.max_missions; }

  Result<void> take(const history::Mission& mission) {
    LeftOut& out = result_.left_out;
    if (wanted_.except.contains(mission.key)) return ++out.excepted, Result<void>{};
    if (mission.state == history::MissionState::open) return ++out.open, Result<void>{};
    const history::MissionFindings findings = history::findings_of(mission);
    if (!findings.annulled.empty()) return ++out.annulled, Result<void>{};
    if (!findings.teaches() && wanted_.only.empty()) return ++out.contradicted, Result<void>{};
    if (full() || result_.samples + static_cast<std::size_t>(std::max<std::int64_t>(mission.samples, 0)) >
                      wanted_.max_samples)
      return ++out.too_many, Result<void>{};
    TRY_ASSIGN(auto samples, all_of(store_, mission.key, &history::Store::telemetry));
    telemetry::put_in_order(samples);
    // The accounts of a mission do not apply once the retention has dropped a part of it.
    if (static_cast<std::int64_t>(samples.size()) * 10 < mission.samples * 9 || samples.size() < 2)
      return ++out.no_telemetry, Result<void>{};
    if (const auto charging = mission.sample_faults.find("charging");
        charging != mission.sample_faults.end() && charging->second > 0)
      out.charging_samples += ingest::drop_charging(wanted_.battery_capacity_ah, samples);
    if (samples.size() < 2) return ++out.no_telemetry, Result<void>{};
    TRY_ASSIGN(const auto changes, all_of(store_, mission.key, &history::Store::covariates));
    result_.samples += samples.size();
    result_.missions.push_back({mission.key,
                                mission.start_utime_us,
                                {mission.robot_id, mission.mission_id, mission.payload_kg, std::move(samples),
                                 signals::series_of(changes)}});
    return {};
  }

  StoredRecordings finish() {
    std::ranges::stable_sort(result_.missions, {}, &StoredRecording::start_utime_us);
    return std::move(result_);
  }

 private:
  const history::Store& store_;
  const RecordingsWanted& wanted_;
  StoredRecordings result_;
};

}  // namespace

Result<StoredRecordings> read_recordings(const history::Store& store, const RecordingsWanted& wanted) {
  Reader reader(store, wanted);
  for (const history::MissionKey key : wanted.only) {
    TRY_ASSIGN(const history::Mission mission, store.mission(key));
    if (mission.robot_id != wanted.robot_id)
      return fail(Fault::not_found, "missions",
                  "mission " + std::to_string(key) + " is not one of robot " + wanted.robot_id);
    TRY(reader.take(mission));
  }
  if (!wanted.only.empty()) return reader.finish();

  history::MissionFilter filter;
  filter.robot_ids = {wanted.robot_id};
  filter.started.from_utime_us = wanted.since_utime_us.value_or(history::whole_past);
  history::PageRequest page;
  do {
    TRY_ASSIGN(history::MissionPage found, store.missions(filter, page));
    for (const history::Mission& mission : found.missions) TRY(reader.take(mission));
    page.cursor = std::move(found.next_cursor);
  } while (!page.cursor.empty() && !reader.full());
  return reader.finish();
}

}  // namespace joulecast::server
