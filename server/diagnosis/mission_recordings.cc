#include "server/diagnosis/mission_recordings.h"

#include <algorithm>
#include <utility>

#include "base/try.h"
#include "ingest/charge_watch.h"

namespace joulecast::server {
namespace {

Result<std::vector<signals::Sample>> samples_of(const history::Store& store, history::MissionKey key) {
  std::vector<signals::Sample> samples;
  history::PageRequest page;
  page.limit = history::max_telemetry_samples;
  do {
    TRY_ASSIGN(history::TelemetryPage got, store.telemetry(key, {}, page));
    if (samples.empty()) {
      samples = std::move(got.samples);
    } else {
      samples.insert(samples.end(), got.samples.begin(), got.samples.end());
    }
    page.cursor = std::move(got.next_cursor);
  } while (!page.cursor.empty());
  std::ranges::stable_sort(samples, {}, &signals::Sample::utime_us);
  const auto same = std::ranges::unique(samples, {}, &signals::Sample::utime_us);
  samples.erase(same.begin(), same.end());
  return samples;
}

Result<std::vector<signals::CovariateSeries>> covariates_of(const history::Store& store,
                                                            history::MissionKey key) {
  std::vector<signals::CovariateChange> changes;
  history::PageRequest page;
  page.limit = history::max_telemetry_samples;
  do {
    TRY_ASSIGN(history::CovariatePage got, store.covariates(key, {}, page));
    changes.insert(changes.end(), std::make_move_iterator(got.changes.begin()),
                   std::make_move_iterator(got.changes.end()));
    page.cursor = std::move(got.next_cursor);
  } while (!page.cursor.empty());
  return signals::series_of(changes);
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
    TRY_ASSIGN(std::vector<signals::Sample> samples, samples_of(store_, mission.key));
    // The accounts of a mission do not apply once the retention has dropped a part of it.
    if (static_cast<std::int64_t>(samples.size()) * 10 < mission.samples * 9 || samples.size() < 2)
      return ++out.no_telemetry, Result<void>{};
    if (const auto charging = mission.sample_faults.find("charging");
        charging != mission.sample_faults.end() && charging->second > 0)
      out.charging_samples += ingest::drop_charging(wanted_.battery_capacity_ah, samples);
    if (samples.size() < 2) return ++out.no_telemetry, Result<void>{};
    TRY_ASSIGN(std::vector<signals::CovariateSeries> covariates, covariates_of(store_, mission.key));
    result_.samples += samples.size();
    result_.missions.push_back({mission.key,
                                mission.start_utime_us,
                                {mission.robot_id, mission.mission_id, mission.payload_kg, std::move(samples),
                                 std::move(covariates)}});
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
  filter.start_from_utime_us = wanted.since_utime_us;
  history::PageRequest page;
  do {
    TRY_ASSIGN(history::MissionPage found, store.missions(filter, page));
    for (const history::Mission& mission : found.missions) {
      TRY(reader.take(mission));
    }
    page.cursor = std::move(found.next_cursor);
  } while (!page.cursor.empty() && !reader.full());
  return reader.finish();
}

}  // namespace joulecast::server
